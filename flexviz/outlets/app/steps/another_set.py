"""Another set in step 1: upload a set, or a robot with or without logs, or simulate a hidden effect."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from flexviz.base.errors import FlexvizError
from flexviz.base.jobs import InChild, InThread, Task
from flexviz.base.progress import Progress
from flexviz.content.view import by_title
from flexviz.content.wording import escape, plural
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.own_robot import MAPPING_FILE
from flexviz.outlets.app.page import Page, dim, warning
from flexviz.outlets.app.state import Changed
from flexviz.outlets.app.steps.own_robot import OwnRobot
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.uploads import LARGEST_UPLOAD, MAX_FILES, UploadFolder, describe_robot, take
from flexviz.outlets.app.workspace import NOTHING, PRESETS, SURPRISE, SimulateQuiz, hideable, output_dir

WAITING = "A robot's URDF and logs; a zip of a set, or its files; or a URDF alone, to simulate it."
MAX_MISSING_FILES = 6  # listed in the message


class AnotherSet:
    """Upload and quiz."""

    def __init__(self, store: Store, page: Page, own: OwnRobot) -> None:
        self._store, self._own = store, own
        self._uploads = UploadFolder()
        self._coming = 0  # files that a browser has announced and not sent yet
        self._taken_in = False  # whether one was kept since the last look
        self._refused: dict[str, str] = {}  # name -> why
        self._urdf: Path | None = None  # the last one
        self._fresh: Path | None = None  # the same until the next look
        self._robots: dict[str, str | Path] = {name: name for name in PRESETS}
        own.on_close = self._forget
        page.receive(self._uploaded, self._announced)
        gui = page.gui
        hint = f"or drop them anywhere on this page. {own.where}"
        page.upload("Your robot: URDF and logs", self._uploaded, hint=hint)
        with gui.add_folder("Another set", expand_by_default=False):
            hint = "a robot's URDF and logs, a zip of a measurement set or session, or its files"
            self.upload = page.upload("Upload", self._uploaded, hint=hint)
            self._waiting = ExplainedHtml(gui, dim(WAITING))
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

    def _announced(self, text: str) -> None:
        """Handle what a browser says of files to come: {"files": 3, "skipped": [[name, bytes]]}."""
        try:
            said = json.loads(text)
            count, skipped = int(said["files"]), [(str(name), int(size)) for name, size in said["skipped"]]
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
            return
        if not 0 <= count <= MAX_FILES:
            self._store.fail(f"upload: {count} files; at most {MAX_FILES} are accepted")
            return
        self._coming, self._refused = count, {}
        for name, size in skipped:
            largest = f"{LARGEST_UPLOAD / 2**20:.0f} MB"
            why = f"{size / 2**20:.0f} MB; at most {largest} are accepted" if size else "is empty"
            self._refuse(name, why)
        if count:
            self._store.go("Data")
            self._store.say(f"{plural(count, 'file')} on the way")

    def _refuse(self, name: str, why: str) -> None:
        name = name[:60]
        self._refused[name] = why = why.removeprefix(f"{name}: ")
        self._store.fail(f"upload: {name}: {why}")

    def _uploaded(self, file: Any) -> None:
        """Handle an uploaded file (`name`, `content`)."""
        self._coming = max(self._coming - 1, 0)
        if file.name.lower().endswith(".zip"):
            self._store.say("unpacking", "busy")
            self._read(InThread(self._uploads.unpack, file.name, file.content), self._unpacked)
            return
        try:
            place = self._uploads.put(file.name, file.content)
            self._taken_in = True
            if place.suffix.lower() == ".urdf":
                self._choose_robot(place)
        except FlexvizError as error:
            self._refuse(file.name, str(error))
        if self._taken_in and not self._coming:
            urdf, self._taken_in, self._fresh = self._fresh, False, None
            self._look(urdf)

    def _choose_robot(self, urdf: Path) -> None:
        """Take this URDF instead of an earlier one."""
        if self._urdf is not None and self._urdf != urdf and self._urdf.parent == urdf.parent:
            self._refused[self._urdf.name] = f"{urdf.name} is used instead, expected one robot"
        self._urdf = self._fresh = urdf

    def _unpacked(self, _: None) -> None:
        self._urdf = self._uploads.urdf()
        self._look(self._urdf)

    def _look(self, urdf: Path | None) -> None:
        """Read the upload if the set is complete; offer a robot without a set, or with logs."""
        store, uploads = self._store, self._uploads
        try:
            missing, robot = uploads.missing(), self._urdf
            logs = uploads.logs(MAPPING_FILE) if uploads.no_set else []
            if logs and robot is not None and robot.is_file() and uploads.no_set:
                store.go("Data")
                self._own.begin(robot, logs, self._refused)
            elif uploads.no_set and urdf is not None:
                self._offer_robot(urdf)
            elif missing:
                names = ", ".join(missing[:MAX_MISSING_FILES])
                also = " (or the URDF of the robot that these logs are of)" if uploads.no_set else ""
                text = f"{plural(uploads.count, 'file')} uploaded; still missing: {names}{also}"
                self._waiting.content = warning(escape(text))
                store.say(text)
            else:
                self._own.hide()
                store.say("reading the upload", "busy")
                self._read(InChild(take, uploads.folder, output_dir()), self._taken)
        except FlexvizError as error:
            store.fail(f"upload: {error}")

    def _forget(self) -> None:
        """Begin anew after one's own robot was opened or discarded."""
        self._uploads.begin()
        self._refused, self._urdf, self._fresh = {}, None, None

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
