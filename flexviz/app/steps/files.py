"""Files in step 1: save, download, report and record the session."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from flexviz.app.page import Page, dim, off
from flexviz.app.recordings import KINDS, Kind, Recordings, State
from flexviz.app.state import Changed, Turn
from flexviz.app.store import Store
from flexviz.app.style import half
from flexviz.app.workspace import FileContent, report_file, save_output, short, zip_file
from flexviz.errors import InputError
from flexviz.jobs import InThread
from flexviz.wording import escape

VIEWER = "127.0.0.1:9876"  # default of a viewer started with `rerun`


class Files:
    """Save, download, report, record."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store, self._page = store, page
        self._recorded: Path | None = None  # the last complete recording
        self._notes: dict[Kind, str] = {}
        gui = page.gui
        hint = "into ./sessions, with all results and the history"
        save = page.button("Save session", self._save, hint=hint)
        hint = "with its measurement set, as one zip file"
        download = page.client_button("Download session", self._download, hint=hint)
        self._report = page.client_button("Report", self._write_report)
        self._fetch = page.client_button("Download recording", self._send_recording)
        hint = "records the analysis live in a Rerun file in ./sessions"
        self._record = page.checkbox("Record", False, partial(self._switch, "file"), hint=hint)
        hint = "sends the same to a Rerun viewer on this machine"
        self._live = page.checkbox("Live viewer", False, partial(self._switch, "viewer"), hint=hint)
        self._address = page.watch(gui.add_text("Viewer at", VIEWER, visible=False))
        self._note = gui.add_html("")
        self.recordings = Recordings(store, page.call, self._heard)
        for box in (self._record, self._live):
            page.style(half, box)
        page.row((save, download))
        page.row((self._report, self._fetch))
        page.command("Save the session", self._save)
        page.client_command("Send the session as a zip", self._download)
        page.client_command("Send a report", self._write_report)
        page.command("Begin or end a recording", self._toggle)
        store.subscribe(Changed.OPENED, self._opened, Turn.CONTROLS)
        store.subscribe(Changed.OPENED | Changed.ANALYSIS, self._refresh, Turn.CONTROLS)
        store.subscribe(Changed.TICK, self._tick, Turn.CONTROLS)

    def _opened(self) -> None:
        """Start new recordings for a new set."""
        for kind in KINDS:
            if self._box(kind).value:
                self.recordings.stop(kind)
                self._switch(kind, True)

    def _refresh(self) -> None:
        analysis, file = self._store.analysis, self._recorded
        nothing = analysis.identification is None and analysis.diagnosis is None
        why = "no results yet; press Find the missing effect (step 4) or Run (step 3) first"
        off(self._report, why if nothing else "", "all results as one self-contained HTML file")
        why = "nothing is recorded yet; switch Record on, and off again to finish"
        off(self._fetch, why if file is None else "", f"{file.name if file else ''}, to be opened with Rerun")
        why = "switch Live viewer off first" if self._live.value else ""
        off(self._address, why, "where the viewer listens; start one with: rerun --port 9876")

    def _tick(self) -> None:
        if size := self.recordings.size():
            self._say("file", f"Recording: {size / 1e6:.1f} MB so far.")

    def _start(self, doing: str, done: Any, make: Callable[..., Any], *more: Any) -> None:
        """Call `make` with the session, its set and `more`, and `done` with the result."""
        store = self._store
        store.say(doing, "busy")
        task = InThread(make, store.session, store.measurements, *more)
        store.tasks.start(task, done, stopped=lambda: store.say(f"stopped {doing}"))

    def _save(self) -> None:
        session, before = self._store.session, self._store.folder

        def saved(folder: Path) -> None:
            self._store.mark_saved(session, folder)
            elsewhere = before is not None and before.resolve() != folder.resolve()
            why = f"; {short(before)} is left as it is" if before is not None and elsewhere else ""
            self._store.say(f"session saved in {short(folder)}{why}")

        self._start("saving", saved, save_output, self._store.folder)

    def _download(self, client: int) -> None:
        self._start("preparing the download", partial(self._send, client), zip_file)

    def _write_report(self, client: int) -> None:
        if self._report.disabled:
            raise InputError(str(self._report.hint))
        self._start("writing the report", partial(self._send, client), report_file, self._store.folder)

    def _send_recording(self, client: int) -> None:
        if self._recorded is not None:
            self._send(client, FileContent(self._recorded.name, self._recorded.read_bytes()))

    def _send(self, client: int, file: FileContent) -> None:
        self._page.send_file(client, file.name, file.content)
        self._store.say(f"{file.name}: {len(file.content) / 1e6:.1f} MB sent")

    def _toggle(self) -> None:
        self._record.value = not self._record.value
        self._switch("file", self._record.value)

    def _switch(self, kind: Kind, on: bool) -> None:
        if not on:
            self.recordings.stop(kind)
            self._say(kind, "The recording is being closed." if kind == "file" else "")
        else:
            try:
                self.recordings.start(kind, self._address.value)
                self._say(kind, "A recording begins." if kind == "file" else "Calling the viewer.")
            except Exception:
                self._switched_off(kind)
                raise
        self._refresh()

    def _switched_off(self, kind: Kind) -> None:
        self._box(kind).value = False
        self._address.visible |= kind == "viewer"

    def _heard(self, kind: Kind, state: State, value: Any) -> None:
        if state == "failed":
            self._switched_off(kind)
            self._say(kind, "")
            self._store.fail(value)
        elif state == "open":
            where = f"Sent to {self._address.value or VIEWER}."
            self._say(kind, f"Recording in {short(value.file)}." if kind == "file" else where)
        elif kind == "viewer":
            self._say(kind, "")
        else:
            self._recorded = value.file
            self._say(kind, f"Recorded in {short(value.file)} ({value.bytes / 1e6:.1f} MB).")
            self._store.note_recording(value.file)
        self._refresh()

    def _box(self, kind: Kind) -> Any:
        return self._record if kind == "file" else self._live

    def _say(self, kind: Kind, text: str) -> None:
        self._notes[kind] = text
        self._note.content = dim(
            "".join(f"<div>{escape(said)}</div>" for said in self._notes.values() if said)
        )
