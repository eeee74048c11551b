"""Files in step 1: save, download, report and record the session."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexviz.app.controls import off
from flexviz.app.recordings import KINDS, Kind, Recordings
from flexviz.app.style import half
from flexviz.app.workspace import report, save, session_zip
from flexviz.errors import InputError
from flexviz.jobs import JobEvent
from flexviz.wording import escape

if TYPE_CHECKING:
    from flexviz.app.application import Application

KEYS = ("save", "download", "report")  # its jobs
WORDS = {"save": "saving", "download": "preparing the download", "report": "writing the report"}
VIEWER = "127.0.0.1:9876"  # where a viewer that was started with `rerun` listens


class Files:
    """Made inside the step's folder."""

    def __init__(self, app: Application) -> None:
        self._app = app
        self._asked: int | None = None  # the browser that wants a download
        self._recorded: Path | None = None  # the last recording that is whole
        self._said: dict[Kind, str] = {}
        gui = app.server.gui
        self._save = gui.add_button(
            "Save session", color="gray", hint="into ./sessions, with all results and the history"
        )
        self._download = gui.add_button(
            "Download session", color="gray", hint="with its measurement set, as one zip file"
        )
        self._report = gui.add_button("Report", color="gray")
        self._fetch = gui.add_button("Download recording", color="gray")
        self._record = gui.add_checkbox(
            "Record", False, hint="records what happens, as it happens, in a Rerun file in ./sessions"
        )
        self._live = gui.add_checkbox(
            "Live viewer", False, hint="sends the same to a Rerun viewer that runs on this machine"
        )
        self._address = gui.add_text("Viewer at", VIEWER, visible=False)
        self._note = gui.add_html("")
        self.recordings = Recordings(app, self._recording)
        for box in (self._record, self._live):
            app.add_style(half(box._impl.uuid))
        app.row(self._save, self._download)
        app.row(self._report, self._fetch)
        app.press(self._save, "save", self.save)
        app.watch(self._record, "record", lambda on: self._switch("file", on))
        app.watch(self._live, "record-live", lambda on: self._switch("viewer", on))
        app.watch(self._address, "viewer-address", lambda _: None)
        app.press_of(self._download, "download", self.download)
        app.press_of(self._report, "report", self.report)
        app.press_of(self._fetch, "fetch", self._fetches)

    def opened(self) -> None:
        """A new set is shown: it gets recordings of its own."""
        for kind in KINDS:
            if self._box(kind).value:
                self.recordings.stop(kind)
                self._switch(kind, True)
        self.refresh()

    def refresh(self) -> None:
        """Show what may be pressed, and why not."""
        analysis = self._app.session.analysis
        nothing = analysis.identification is None and analysis.diagnosis is None
        why = "nothing was found yet; press Find the missing effect (step 4) or Run (step 3) first"
        off(self._report, why if nothing else "", "what was found, as one HTML file that needs nothing else")
        file = self._recorded
        why = "nothing is recorded yet; switch Record on, and off again when all is in it"
        off(self._fetch, why if file is None else "", f"{file.name if file else ''}, to be opened with Rerun")
        why = "switch Live viewer off first" if self._live.value else ""
        off(self._address, why, "where the viewer listens; start one with: rerun --port 9876")

    def tick(self) -> None:
        """Let the recordings go on."""
        self.recordings.tick()
        size = self.recordings.size()
        if size:
            self._say("file", f"Recording: {size / 1e6:.1f} MB so far.")

    def heard(self, event: JobEvent) -> None:
        """What saving and sending have to say."""
        app, key = self._app, event.job.key
        if event.kind == "failed":
            app.fail(event.value)
        elif event.kind == "stopped":
            app.say(f"stopped {WORDS[key]}")
        elif event.kind == "done" and key == "save":
            app.saved(event.job.args[0], event.value)
            app.say(f"session saved in {short(event.value)}")
        elif event.kind == "done":
            self._send(*event.value)

    # -- out of the browser --------------------------------------------------------------------------

    def _start(self, key: str, function: Any, *more: Any) -> None:
        app = self._app
        app.say(WORDS[key], "busy")
        app.submit(key, function, app.session, app.measurements, *more, in_process=False)

    def save(self) -> None:
        """Save the session."""
        self._start("save", save, self._app.folder)

    def download(self, client: int) -> None:
        """Send the session to a browser."""
        self._asked = client
        self._start("download", session_zip)

    def report(self, client: int) -> None:
        """Send a report to a browser."""
        if self._report.disabled:
            raise InputError(str(self._report.hint))
        self._asked = client
        self._start("report", report, self._app.folder)

    def _fetches(self, client: int) -> None:
        if self._recorded is not None:
            self._asked = client
            self._send(self._recorded.name, self._recorded.read_bytes())

    def _send(self, name: str, content: bytes) -> None:
        client = self._app.server.get_clients().get(self._asked if self._asked is not None else -1)
        if client is not None:
            client.send_file_download(name, content, save_immediately=True)
        self._app.say(f"{name}: {len(content) / 1e6:.1f} MB sent")

    # -- recordings ----------------------------------------------------------------------------------

    def toggle(self) -> None:
        """Begin or end a recording."""
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
                self._box(kind).value = False
                self._address.visible |= kind == "viewer"
                raise
        self.refresh()

    def _recording(self, kind: Kind, state: str, value: Any) -> None:
        """What a recording has to say."""
        app = self._app
        if state == "failed":
            self._box(kind).value = False
            self._address.visible |= kind == "viewer"
            self._say(kind, "")
            app.fail(value)
        elif state == "open":
            where = self._address.value or VIEWER
            self._say(kind, f"Recording in {short(value)}." if kind == "file" else f"Sent to {where}.")
        elif kind == "viewer":
            self._say(kind, "")
        else:
            self._recorded = value.file
            self._say(kind, f"Recorded in {short(value.file)} ({value.bytes / 1e6:.1f} MB).")
            app.session = app.session.with_recording(value.file)
        self.refresh()

    def _box(self, kind: Kind) -> Any:
        return self._record if kind == "file" else self._live

    def _say(self, kind: Kind, text: str) -> None:
        self._said[kind] = text
        lines = "".join(f"<div>{escape(said)}</div>" for said in self._said.values() if said)
        content = f'<div class="fv fv-dim">{lines}</div>' if lines else ""
        if content != self._note.content:
            self._note.content = content


def short(path: Path) -> str:
    """A path as a person in the present folder would write it."""
    try:
        return f"./{path.resolve().relative_to(Path.cwd())}"
    except ValueError:
        return str(path)
