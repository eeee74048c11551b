"""Another set in step 1: upload one, or a robot; simulate a set that hides an effect."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexviz.app.inbox import Inbox
from flexviz.app.work import open_set
from flexviz.app.workspace import NOTHING, PRESETS, SURPRISE, hideable, output_dir, simulate_quiz
from flexviz.errors import FlexvizError, InputError
from flexviz.jobs import JobEvent
from flexviz.robot import Robot
from flexviz.wording import escape, plural

if TYPE_CHECKING:
    from flexviz.app.application import Application

KEYS = ("quiz", "unpack", "accept")  # its jobs
WAITING = "A zip, or measurements.toml and the files it names; or a robot's URDF, to simulate it."


class AnotherSet:
    """Made inside the step's folder."""

    def __init__(self, app: Application) -> None:
        self._app = app
        self._inbox = Inbox()
        self._robots: dict[str, str | Path] = {name: name for name in PRESETS}
        gui = app.server.gui
        with gui.add_folder("Another set", expand_by_default=False):
            self.upload = gui.add_upload_button(
                "Upload", color="gray",
                hint="a zip of a measurement set or session, its files one by one, or a robot's URDF",
            )  # fmt: skip
            self._waiting = gui.add_html("")
            self._robot: Any = gui.add_dropdown(
                "Robot", PRESETS, initial_value=PRESETS[0], hint="an uploaded URDF can be chosen here too"
            )
            self.effect: Any = gui.add_dropdown(
                "Hide", (SURPRISE, NOTHING, *hideable()), initial_value=SURPRISE
            )
            self.quiz = gui.add_button(
                "Quiz me", color="gray",
                hint="simulates a set with a hidden effect; the truth stays hidden until you ask for it",
            )  # fmt: skip
        self._wait()
        app.press(self.quiz, "quiz", self._simulate)
        app.watch(self._robot, "quiz-robot", lambda _: None)
        app.watch(self.effect, "quiz-effect", lambda _: None)
        app.on("upload", self._uploaded)

        @self.upload.on_upload
        async def _(event: Any) -> None:
            file = event.target.value
            app.queue.put("upload", (file.name, file.content), each=True)

    @property
    def waiting(self) -> str:
        """What is said about uploads (HTML)."""
        return self._waiting.content

    def close(self) -> None:
        """Forget what was uploaded and not used."""
        self._inbox.close()

    def heard(self, event: JobEvent) -> None:
        """What unpacking or simulating has to say."""
        app, key = self._app, event.job.key
        if event.kind == "progress":
            app.say(f"simulating: {100 * float(event.value.share or 0.0):.0f} %", "busy")
        elif event.kind == "failed":
            app.fail(event.value)
        elif event.kind == "stopped":
            app.say("stopped simulating" if key == "quiz" else "stopped reading the upload")
        elif event.kind == "done" and key == "unpack":
            self._look(self._inbox.urdf())
        elif event.kind == "done":
            self._wait()
            app.say(f"opening {event.value.name}", "busy")
            app.submit("open", open_set, event.value, in_process=False)

    def _simulate(self) -> None:
        self._app.say("simulating", "busy")
        self._app.submit("quiz", simulate_quiz, self._robots[self._robot.value], self.effect.value)

    def _uploaded(self, upload: tuple[str, bytes]) -> None:
        name, content = upload
        if name.lower().endswith(".zip"):
            self._app.say("unpacking", "busy")
            self._app.submit("unpack", self._inbox.unpack, name, content, in_process=False)
            return
        try:
            file = self._inbox.put(name, content)
        except FlexvizError as error:
            self._app.fail(f"upload: {error}")
            return
        self._look(file if file.suffix.lower() == ".urdf" else None)

    def _look(self, urdf: Path | None) -> None:
        """Is there a whole set now, or a robot alone?"""
        try:
            missing = self._inbox.missing()
            if self._inbox.no_set and urdf is not None:
                self._robot_came(urdf)
            elif missing:
                text = (
                    f"{plural(self._inbox.count, 'file')} uploaded; still missing: {', '.join(missing[:6])}"
                )
                self._waiting.content = f'<div class="fv fv-warn">{escape(text)}</div>'
                self._app.say(text)
            else:
                self._app.say("reading the upload", "busy")
                self._app.submit("accept", self._inbox.take, output_dir(), in_process=False)
        except FlexvizError as error:
            self._app.fail(f"upload: {error}")

    def _robot_came(self, urdf: Path) -> None:
        """A URDF alone: it can be simulated, or be the robot of a set that follows."""
        try:
            robot = Robot.load(urdf)
        except FlexvizError as error:
            urdf.unlink()
            raise InputError(str(error).replace(f"{urdf.parent}/", "")) from None
        self._robots[urdf.name] = urdf
        self._robot.options = tuple(self._robots)
        self._robot.value = urdf.name
        text = (
            f"{urdf.name}: {robot.name}, {plural(robot.n, 'joint')}. Quiz me simulates a set with it; "
            "or upload the measurements.toml that names it."
        )
        self._waiting.content = f'<div class="fv fv-dim">{escape(text)}</div>'
        self._app.say(f"{urdf.name} uploaded")

    def _wait(self) -> None:
        self._waiting.content = f'<div class="fv fv-dim">{WAITING}</div>'
