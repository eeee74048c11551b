"""Files in step 1: save, download, report and record the session."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexviz.base.errors import InputError
from flexviz.base.jobs import InThread, Result, Task
from flexviz.content.session import Analysis
from flexviz.content.wording import escape
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import Page, dim, off
from flexviz.outlets.app.recordings import Recordings, State
from flexviz.outlets.app.rerun_page import RerunPage
from flexviz.outlets.app.state import Changed, Turn
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.workspace import (
    FileContent,
    RecordSession,
    WriteAnimation,
    WriteReport,
    save_output,
    short,
    zip_file,
)

if TYPE_CHECKING:
    from flexviz.outlets.recording import Recorded


class Files:
    """Save, download, report, record."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store, self._page = store, page
        self._recorded: tuple[Path, Analysis] | None = None  # the last complete recording, and of what
        self._viewer = RerunPage()
        self._shown = ""  # a link to what Rerun shows (HTML)
        hint = "into ./sessions, with all results and the history"
        save = page.button("Save session", self._save, hint=hint)
        hint = "with its measurement set, as one zip file"
        download = page.client_button("Download session", self._download, hint=hint)
        self._report = page.client_button("Report", partial(self._write_page, WriteReport))
        self._animation = page.client_button("Animation", partial(self._write_page, WriteAnimation))
        hint = "records the session as it is now, and shows it in Rerun's viewer in a new tab"
        show = page.client_button("Open in Rerun", self._open_recording, hint=hint)
        hint = "a Rerun file with the measured signals, all results and what is simulated by now"
        recording = page.client_button("Download recording", self._send_recording, hint=hint)
        hint = "records the analysis live in a Rerun file in ./sessions"
        self._record = page.checkbox("Record", False, self._switch, hint=hint)
        self._note = ExplainedHtml(page.gui)
        self.recordings = Recordings(store, page.call, self._heard)
        page.row((save, download))
        page.row((self._report, self._animation))
        page.row((show, recording))
        page.command("Save the session", self._save)
        page.client_command("Send the session as a zip", self._download)
        page.client_command("Send a report", partial(self._write_page, WriteReport))
        page.client_command("Send an animation", partial(self._write_page, WriteAnimation))
        page.client_command("Send a recording of the session", self._send_recording)
        page.client_command("Show the session in Rerun", self._open_recording)
        page.command("Begin or end a recording", self._toggle)
        store.subscribe(Changed.OPENED, self._opened, Turn.CONTROLS)
        store.subscribe(Changed.OPENED | Changed.ANALYSIS, self._refresh, Turn.CONTROLS)
        store.subscribe(Changed.TICK, self._tick, Turn.CONTROLS)
        store.subscribe(Changed.CLOSED, self._viewer.close)

    def _opened(self) -> None:
        """Start a new recording for a new set."""
        if self._record.value:
            self.recordings.stop()
            self._switch(True)

    def _refresh(self) -> None:
        analysis = self._store.analysis
        nothing = analysis.identification is None and analysis.diagnosis is None
        why = "no results yet; press Find the missing effect (step 4) or Run (step 3) first"
        why = why if nothing else ""
        off(self._report, why, "all results as one self-contained HTML file")
        off(self._animation, why, "measured and identified robot in motion, as one self-contained HTML file")

    def _tick(self) -> None:
        if size := self.recordings.size():
            self._say(f"Recording: {size / 1e6:.1f} MB so far.")

    def _start(self, doing: str, task: Task[Result], done: Callable[[Result], None]) -> None:
        """Start a task with progress and Stop, beside what is computing; `doing` is said meanwhile."""
        store = self._store
        if store.running:  # its progress and Stop stay
            store.say(doing, "busy")
            store.tasks.start(task, done, stopped=lambda: store.say(f"stopped {doing}"))
        else:
            store.await_task(task, done, begin=doing, stopped=f"stopped {doing}")

    def _save(self) -> None:
        session, before = self._store.session, self._store.folder

        def saved(folder: Path) -> None:
            self._store.mark_saved(session, folder)
            elsewhere = before is not None and before.resolve() != folder.resolve()
            why = f"; {short(before)} is left as it is" if before is not None and elsewhere else ""
            self._store.say(f"session saved in {short(folder)}{why}")

        store = self._store
        store.say("saving", "busy")
        store.tasks.start(InThread(save_output, session, store.measurements, before), saved)

    def _download(self, client: int) -> None:
        store = self._store
        task = InThread(zip_file, store.session, store.measurements)
        self._start("preparing the download", task, partial(self._send, client))

    def _write_page(self, kind: type[WriteReport], client: int) -> None:
        if self._report.disabled:
            raise InputError(str(self._report.hint))
        store = self._store
        task = kind(store.session, store.measurements, store.folder)
        self._start(kind.doing, task, partial(self._send, client))

    def _send_recording(self, client: int) -> None:
        self._with_recording(lambda file: self._send(client, FileContent(file.name, file.read_bytes())))

    def _open_recording(self, client: int) -> None:
        def opened(file: Path, address: str) -> None:
            self._page.open_tab(client, address)
            self._shown = f'<a href="{escape(address)}" target="_blank">{escape(file.name)} in Rerun</a>'
            self._say(f"{short(file)} is shown in Rerun; on this machine only.")
            self._store.say(f"Rerun shows {file.name} in a new tab")

        def show(file: Path) -> None:
            task = InThread(self._viewer.show, file)
            self._start("starting Rerun's viewer", task, partial(opened, file))

        self._with_recording(show)

    def _with_recording(self, act: Callable[[Path], None]) -> None:
        """Call `act` with a recording of the present session; one is made unless there is one."""
        store, known = self._store, self._recorded
        if known is not None and known[1] is store.analysis and known[0].is_file():
            act(known[0])
            return
        of, task = store.analysis, RecordSession(store.session, store.measurements, store.derived.replays)

        def recorded(made: Recorded) -> None:
            if not made.complete:
                store.say(f"stopped recording; what was written is in {short(made.file)}")
                return
            self._take_recording(made, of)
            act(made.file)

        self._start("recording the session", task, recorded)

    def _take_recording(self, made: Recorded, of: Analysis) -> None:
        self._recorded = made.file, of
        self._say(f"Recorded in {short(made.file)} ({made.bytes / 1e6:.1f} MB).")
        self._store.note_recording(made.file)

    def _send(self, client: int, file: FileContent) -> None:
        self._page.send_file(client, file.name, file.content)
        self._store.say(f"{file.name}: {len(file.content) / 1e6:.1f} MB sent")

    def _toggle(self) -> None:
        self._record.value = not self._record.value
        self._switch(self._record.value)

    def _switch(self, on: bool) -> None:
        if not on:
            self.recordings.stop()
            self._say("The recording is being closed.")
            return
        try:
            self.recordings.start()
        except Exception:
            self._record.value = False
            raise
        self._say("A recording begins.")

    def _heard(self, state: State, value: Any) -> None:
        if state == "failed":
            self._record.value = False
            self._say("")
            self._store.fail(value)
        elif state == "open":
            self._say(f"Recording in {short(value.file)}.")
        else:
            self._take_recording(value, self._store.analysis)

    def _say(self, text: str) -> None:
        self._note.content = dim((f"<div>{escape(text)}</div>" if text else "") + self._shown)
