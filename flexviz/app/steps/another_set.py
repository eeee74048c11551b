"""Another set in step 1: upload a set or a robot, or simulate a set with a hidden effect."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from flexviz.app.page import Page, dim, warning
from flexviz.app.state import Changed
from flexviz.app.store import Store
from flexviz.app.uploads import UploadFolder, describe_robot, take
from flexviz.app.workspace import NOTHING, PRESETS, SURPRISE, SimulateQuiz, hideable, output_dir
from flexviz.errors import FlexvizError
from flexviz.jobs import InChild, InThread, Task
from flexviz.progress import Progress
from flexviz.view import by_title
from flexviz.wording import escape, plural

WAITING = "A zip, or measurements.toml and its files; or a robot's URDF, to simulate it."
MAX_MISSING_FILES = 6  # listed in the message


class AnotherSet:
    """Upload and quiz."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store = store
        self._uploads = UploadFolder()
        self._robots: dict[str, str | Path] = {name: name for name in PRESETS}
        gui = page.gui
        with gui.add_folder("Another set", expand_by_default=False):
            hint = "a zip of a measurement set or session, its files one by one, or a robot's URDF"
            self.upload = page.upload("Upload", self._uploaded, hint=hint)
            self._waiting = gui.add_html(dim(WAITING))
            hint = "an uploaded URDF can be chosen here too"
            self._robot = page.dropdown("Robot", PRESETS, hint=hint)
            self._effects = {SURPRISE: SURPRISE, NOTHING: NOTHING} | by_title(hideable())
            self._effect = page.dropdown("Hide", tuple(self._effects))
            hint = "simulates a set with a hidden effect; the truth stays hidden until you ask for it"
            self.quiz = page.button("Quiz me", self._simulate, hint=hint)
        store.subscribe(Changed.CLOSED, self._uploads.close)

    def _simulate(self) -> None:
        def progress(news: Progress) -> None:
            self._store.say(f"simulating: {100 * (news.share or 0.0):.0f} %", "busy")

        self._store.say("simulating", "busy")
        self._store.tasks.start(
            SimulateQuiz(self._robots[self._robot.value], self._effects[self._effect.value]),
            self._open,
            progress=progress,
            stopped=lambda: self._store.say("stopped simulating"),
        )

    def _read(
        self, task: Task[Any], done: Callable[[Any], None], failed: Callable[[], object] = object
    ) -> None:
        def fail(reason: str) -> None:
            failed()
            self._store.fail(f"upload: {reason}")

        stopped = partial(self._store.say, "stopped reading the upload")
        self._store.tasks.start(task, done, stopped=stopped, failed=fail)

    def _uploaded(self, file: Any) -> None:
        """Handle an uploaded file (`name`, `content`)."""
        if file.name.lower().endswith(".zip"):
            self._store.say("unpacking", "busy")
            self._read(InThread(self._uploads.unpack, file.name, file.content), self._unpacked)
            return
        try:
            place = self._uploads.put(file.name, file.content)
        except FlexvizError as error:
            self._store.fail(f"upload: {error}")
            return
        self._look(place if place.suffix.lower() == ".urdf" else None)

    def _unpacked(self, _: None) -> None:
        self._look(self._uploads.urdf())

    def _look(self, urdf: Path | None) -> None:
        """Read the upload if the set is complete; offer a robot without a set."""
        store, uploads = self._store, self._uploads
        try:
            missing = uploads.missing()
            if uploads.no_set and urdf is not None:
                self._offer_robot(urdf)
            elif missing:
                names = ", ".join(missing[:MAX_MISSING_FILES])
                text = f"{plural(uploads.count, 'file')} uploaded; still missing: {names}"
                self._waiting.content = warning(escape(text))
                store.say(text)
            else:
                store.say("reading the upload", "busy")
                self._read(InChild(take, uploads.folder, output_dir()), self._taken)
        except FlexvizError as error:
            store.fail(f"upload: {error}")

    def _offer_robot(self, urdf: Path) -> None:
        """Offer a URDF without a set for simulation, if the worker can read it."""

        def described(found: str) -> None:
            self._robots[urdf.name] = urdf
            self._robot.options = tuple(self._robots)
            self._robot.value = urdf.name
            text = f"{urdf.name}: {found}. Quiz me simulates a set with it; "
            self._waiting.content = dim(escape(text + "or upload a measurements.toml that refers to it."))
            self._store.say(f"{urdf.name} uploaded")

        self._read(InChild(describe_robot, urdf), described, partial(urdf.unlink, missing_ok=True))

    def _taken(self, folder: Path) -> None:
        self._uploads.begin()
        self._open(folder)

    def _open(self, folder: Path) -> None:
        self._waiting.content = dim(WAITING)
        self._store.open_path(folder)
