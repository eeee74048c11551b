"""The app's output in ./sessions: sessions, uploaded and simulated sets, recordings."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from flexviz.base.errors import InputError
from flexviz.base.files import temporary_folder
from flexviz.base.jobs import Task
from flexviz.base.progress import ProgressCallback, StopCallback
from flexviz.content.session import Analysis, Session, SessionChanged, save_session, zipped
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS
from flexviz.model.simulation import Run, make_plan, simulate_preset, simulated_effects
from flexviz.outlets.app.uploads import new_folder
from flexviz.outlets.report import session_animation, session_report

if TYPE_CHECKING:
    from flexviz.outlets.recording import Recorded

PRESETS = ("planar-2r", "panda")
SURPRISE, NOTHING = "surprise me", "nothing"


def output_dir() -> Path:
    """./sessions; InputError inside the installed package."""
    import flexviz

    folder = Path.cwd() / "sessions"
    if folder.resolve().is_relative_to(Path(flexviz.__file__).resolve().parent):
        raise InputError("nothing is written into the installed package: start flexviz in another folder")
    return folder


def unsaved_dir() -> Path:
    return output_dir() / ".unsaved"


def stamped(name: str) -> Path:
    """A new folder named `name` with a time stamp."""
    return new_folder(output_dir(), f"{name[:36]}-{time.strftime('%Y%m%d-%H%M%S')}")


def new_recording(name: str) -> Path:
    """A new recording file named `name` with a time stamp."""
    folder = output_dir()
    folder.mkdir(parents=True, exist_ok=True)
    return folder / f"{stamped(name).name}.rrd"


def short(path: Path) -> str:
    """A path relative to the current folder, if possible."""
    try:
        return f"./{path.resolve().relative_to(Path.cwd())}"
    except ValueError:
        return str(path)


@dataclass(frozen=True)
class FileContent:
    """A file for a browser."""

    name: str
    content: bytes


def save_output(session: Session, measurements: MeasurementSet, folder: Path | None) -> Path:
    """Save a session and return its folder: `folder`, or a new one in the output folder.

    A new one if `folder` is elsewhere, or if another program has saved there meanwhile.
    """
    if folder is not None and folder.resolve().parent == output_dir().resolve():
        with suppress(SessionChanged):
            return save_session(session, measurements, folder)
    return save_session(session, measurements, stamped(measurements.name))


def zip_file(session: Session, measurements: MeasurementSet) -> FileContent:
    """A zip of a session and its measurement set."""
    with temporary_folder("download") as temporary:
        folder = temporary / f"{measurements.name}-session"
        save_session(session, measurements, folder, carry=True)
        return FileContent(f"{folder.name}.zip", zipped(folder))


@dataclass(frozen=True)
class ModelFiles(FileContent):
    """An export, and lines on what its formats do not contain."""

    left_out: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ExportModel(Task[ModelFiles]):
    """The present model in one format, or in all of them (""): its only file, or a zip of all."""

    in_process = False

    analysis: Analysis
    measurements: MeasurementSet
    format: str

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> ModelFiles:
        from flexviz.outlets.exporting import session_robot, write  # heavy

        identified = session_robot(self.measurements, self.analysis)
        with temporary_folder("export") as temporary:
            folder = temporary / f"{self.measurements.name}-{self.format or 'export'}"
            done = write(identified, folder, (self.format,) if self.format else ())
            left = {text: None for name, texts in done.left_out.items() for text in _named(name, texts)}
            lines = (*identified.remarks, *left)
            files = [file for files in done.files.values() for file in files]
            if len(files) == 1:
                return ModelFiles(files[0].name, files[0].read_bytes(), lines)
            return ModelFiles(f"{folder.name}.zip", zipped(folder), lines)


def _named(name: str, texts: Sequence[str]) -> list[str]:
    return [f"{name} does not contain {text}" for text in texts]


@dataclass(frozen=True, eq=False)
class WriteReport(Task[FileContent]):
    """The report of a session as one HTML file; `folder` is that of the saved session."""

    in_process = False
    doing: ClassVar[str] = "writing the report"

    session: Session
    measurements: MeasurementSet
    folder: Path | None

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> FileContent:
        callbacks = {"progress": progress, "should_stop": should_stop}
        text = session_report(self.session, self.measurements, "html", folder=self.folder, **callbacks)
        return FileContent(f"{self.measurements.name}-report.html", text.encode())


@dataclass(frozen=True, eq=False)
class WriteAnimation(WriteReport):
    """Measured and identified robot in motion as one HTML file."""

    doing: ClassVar[str] = "writing the animation"

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> FileContent:
        text = session_animation(self.session, self.measurements, progress=progress, should_stop=should_stop)
        return FileContent(f"{self.measurements.name}-animation.html", text.encode())


@dataclass(frozen=True, eq=False)
class RecordSession(Task["Recorded"]):
    """A new recording of a session in ./sessions, with the motions that are simulated by now."""

    in_process = False

    session: Session
    measurements: MeasurementSet
    runs: Mapping[str, Run]  # group → simulated motion of the newest model

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> Recorded:
        from flexviz.outlets.recording import record_session  # heavy

        file = new_recording(self.measurements.name)
        runs = dict(self.runs)  # others may come meanwhile
        return record_session(self.session, self.measurements, file, progress, should_stop, runs)


@dataclass(frozen=True)
class SimulateQuiz(Task[Path]):
    """Simulate a set with a hidden effect, which only its truth.json reveals; returns its folder."""

    robot: str | Path  # a preset's name, or the path of a URDF
    effect: str  # its name, `SURPRISE` or `NOTHING`

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> Path:
        robot = self.robot
        if not isinstance(robot, Path) and robot not in PRESETS:
            raise InputError(f"{robot!r} cannot be simulated here")
        rng = np.random.default_rng()
        seed = int(rng.integers(1, 100_000))
        name = str(rng.choice(hideable())) if self.effect == SURPRISE else self.effect
        if name not in (*hideable(), NOTHING):
            raise InputError(f"{name!r} cannot be hidden")
        folder = new_folder(output_dir(), f"quiz-{Path(robot).stem}-{seed}")
        folder.parent.mkdir(parents=True, exist_ok=True)
        on_one_joint = name != NOTHING and EFFECTS[name].scope == "joint"
        joint = f":{rng.choice(make_plan(robot).robot.joints)}" if on_one_joint else ""
        simulate_preset(
            robot, folder, [] if name == NOTHING else [name + joint], seed,
            progress=progress, should_stop=should_stop,
        )  # fmt: skip
        return folder


def hideable() -> tuple[str, ...]:
    """Effects that can be hidden in a simulated set."""
    return tuple(name for name in simulated_effects() if EFFECTS[name].scope != "episode")
