"""Files in step 1: save, download and record the session; upload a set; simulate one that hides an effect."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexviz.app.style import half, in_row
from flexviz.app.uploads import Inbox
from flexviz.app.work import open_set
from flexviz.app.workspace import (
    PRESETS,
    SURPRISE,
    hideable,
    output_dir,
    record,
    save,
    session_zip,
    simulate_quiz,
    unpack_upload,
)
from flexviz.errors import FlexvizError
from flexviz.jobs import JobEvent
from flexviz.view.text import escape

if TYPE_CHECKING:
    from flexviz.app.application import Application

KEYS = ("save", "download", "quiz", "record", "unpack")  # its jobs
WORDS = {
    "save": "saving",
    "download": "preparing the download",
    "quiz": "simulating",
    "record": "recording",
    "unpack": "unpacking",
}


class Files:
    """Made inside the step's folder."""

    def __init__(self, app: Application) -> None:
        self._app = app
        self._inbox = Inbox()
        self._file: Path | None = None  # the recording
        self._recorded: Any = None  # the result it holds
        self._asked: int | None = None  # the browser that wants a download
        gui = app.server.gui
        self._save = gui.add_button(
            "Save session", color="gray", hint="into ./sessions, with the set, all results and the history"
        )
        self._download = gui.add_button("Download session", color="gray", hint="the same as one zip file")
        self._record = gui.add_checkbox(
            "Record", False, hint="keeps a Rerun recording in ./sessions up to date with every result"
        )
        self._note = gui.add_html("")
        with gui.add_folder("Another set", expand_by_default=False):
            self._upload = gui.add_upload_button(
                "Upload", color="gray", hint="a zip of a measurement set or session, or its files one by one"
            )
            self._waiting = gui.add_html(
                '<div class="fv fv-dim">A zip, or measurements.toml and the files it names one by one.</div>'
            )
            self._preset: Any = gui.add_dropdown("Robot", PRESETS, initial_value=PRESETS[0])
            self._effect: Any = gui.add_dropdown("Hide", (SURPRISE, *hideable()), initial_value=SURPRISE)
            self._quiz = gui.add_button(
                "Quiz me", color="gray",
                hint="simulates a set with a hidden effect; the truth stays hidden until you ask for it",
            )  # fmt: skip
        app.add_style(half(self._record._impl.uuid))
        app.add_style(in_row(self._save._impl.uuid, self._download._impl.uuid))
        app.press(self._save, "save", lambda: self._start("save", save, app.folder))
        app.press(self._quiz, "quiz", self._simulate)
        app.watch(self._record, "record", lambda _: self._recording())
        app.watch(self._preset, "quiz-robot", lambda _: None)
        app.watch(self._effect, "quiz-effect", lambda _: None)
        app.on("download", self._downloads)
        app.on("upload", self._uploaded)

        @self._download.on_click
        async def _(event: Any) -> None:
            if event.client_id is not None:
                app.queue.put("download", event.client_id)

        @self._upload.on_upload
        async def _(event: Any) -> None:
            file = event.target.value
            app.queue.put("upload", (file.name, file.content), each=True)

    def opened(self) -> None:
        """A new set is shown: it gets a recording of its own."""
        self._file, self._recorded = None, None
        self._recording()

    def refresh(self) -> None:
        """A result may have come."""
        self._recording()

    def heard(self, event: JobEvent) -> None:
        """What saving, recording or simulating has to say."""
        app, key = self._app, event.job.key
        if event.kind == "progress" and key == "quiz":
            app.say(f"simulating: {100 * float(event.value):.0f} %", "busy")
        elif event.kind == "failed":
            app.fail(event.value)
            if key == "record":
                self._record.value = False
        elif event.kind == "stopped" and key != "record":
            app.say(f"stopped {WORDS[key]}")
        elif event.kind == "done":
            if key == "save":
                app.saved(event.job.args[0], event.value)
            self._done(key, event.value)

    def _done(self, key: str, value: Any) -> None:
        app = self._app
        if key == "save":
            app.say(f"session saved in {_short(value)}")
        elif key == "download":
            name, content = value
            client = app.server.get_clients().get(self._asked if self._asked is not None else -1)
            if client is not None:
                client.send_file_download(name, content, save_immediately=True)
            app.say(f"{name}: {len(content) / 1e6:.1f} MB sent")
        elif key in ("quiz", "unpack"):
            self._open(value)
        elif key == "record":
            self._note.content = f'<div class="fv fv-dim">Recorded in {escape(_short(value))}.</div>'
            app.session = app.session.with_recording(value)

    def _start(self, key: str, function: Any, *more: Any) -> None:
        app = self._app
        app.say(WORDS[key], "busy")
        app.submit(key, function, app.session, app.measurements, *more, in_process=False)

    def _downloads(self, client_id: int) -> None:
        self._asked = client_id
        self._start("download", session_zip)

    def _simulate(self) -> None:
        self._app.say(WORDS["quiz"], "busy")
        self._app.submit("quiz", simulate_quiz, self._preset.value, self._effect.value)

    def _uploaded(self, upload: tuple[str, bytes]) -> None:
        name, content = upload
        try:
            if name.lower().endswith(".zip"):
                self._app.say("unpacking", "busy")
                self._app.submit("unpack", unpack_upload, name, content, in_process=False)
                return
            self._inbox.put(name, content)
            missing = self._inbox.missing()
        except FlexvizError as error:
            self._app.fail(f"upload: {error}")
            return
        if missing:
            text = f"{len(self._inbox.files)} uploaded; still missing: {', '.join(missing[:6])}"
            self._waiting.content = f'<div class="fv fv-warn">{escape(text)}</div>'
            return
        self._waiting.content = ""
        self._open(self._inbox.write(output_dir()))

    def _open(self, folder: Path) -> None:
        self._app.say(f"opening {folder.name}", "busy")
        self._app.submit("open", open_set, folder, in_process=False)

    def _recording(self) -> None:
        """Record the present result, where that is wanted and not done."""
        app = self._app
        session = getattr(app, "session", None)
        if not self._record.value or session is None:
            self._note.content = "" if not self._record.value else self._note.content
            return
        result = session.analysis.identification
        if self._file is not None and result is self._recorded:
            return
        if self._file is None:
            self._file = output_dir() / f"{app.measurements.name}.rrd"
        self._recorded = result
        self._note.content = '<div class="fv fv-dim">Recording.</div>'
        app.submit("record", record, app.measurements.path, result, self._file)


def _short(path: Path) -> str:
    """A path as a person in the present folder would write it."""
    try:
        return f"./{path.resolve().relative_to(Path.cwd())}"
    except ValueError:
        return str(path)
