"""One's own robot: look at a URDF and logs, and make a measurement set of them, in the child process."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from flexviz.base.errors import InputError
from flexviz.base.files import write_file
from flexviz.base.jobs import Task
from flexviz.base.progress import ProgressCallback, StopCallback, part
from flexviz.checks import Issue
from flexviz.data.importing import Draft, LogPreview, edited, import_logs, inspect_logs, preview, readable
from flexviz.robot.robot import Robot

MAPPING_FILE = "mapping.toml"


@dataclass(frozen=True, eq=False)
class OwnFiles:
    """What a URDF and logs hold.

    Attributes:
        issues: of the draft, if nothing is missing in it.
        refused: name of a log that cannot be read -> why.
        links: of the URDF, in its order.
        prismatic: names of the joints that slide.
    """

    robot: str
    joints: int
    links: tuple[str, ...]
    prismatic: tuple[str, ...]
    logs: tuple[str, ...]
    refused: Mapping[str, str]
    draft: Draft
    issues: tuple[Issue, ...]
    preview: LogPreview


@dataclass(frozen=True)
class LookAtFiles(Task[OwnFiles]):
    """Draft a mapping of uploaded logs, as `import` does without a terminal; the last run validates."""

    urdf: Path
    logs: tuple[Path, ...]

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> OwnFiles:
        try:
            robot = Robot.load(self.urdf)
            good, refused = readable(self.logs, progress=part(progress, 0.0, 0.5), should_stop=should_stop)
            if not good:
                reasons = "; ".join(f"{name}: {why}" for name, why in refused.items())
                raise InputError(f"none of the logs can be used: {reasons}")
            found = inspect_logs(
                good, str(self.urdf), progress=part(progress, 0.5, 1.0), should_stop=should_stop
            )
        except InputError as error:
            raise without_folder(error, self.urdf.parent) from None
        draft = found.draft
        if len(draft.groups) > 1:
            draft.validation = {draft.groups[-1]}
        slides = tuple(name for name, slide in zip(robot.joints, robot.prismatic, strict=True) if slide)
        seen = preview(draft, should_stop=should_stop)
        logs = tuple(path.name for path in good)
        return OwnFiles(
            self.urdf.name, robot.n, robot.links, slides, logs, refused, draft, found.issues, seen
        )


@dataclass(frozen=True, eq=False)
class OwnSet:
    """What an import found, and the set it wrote, if any."""

    folder: Path | None
    issues: tuple[Issue, ...]


@dataclass(frozen=True, eq=False)
class ImportOwn(Task[OwnSet]):
    """Import the logs of a draft into the folder `out`; None: only check. `accept` what looks wrong."""

    draft: Draft
    urdf: Path
    out: Path | None
    accept: bool = False

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> OwnSet:
        folder = self.urdf.parent
        try:
            write_file(folder / MAPPING_FILE, mapping_text(self.draft, folder / MAPPING_FILE))
            done = import_logs(
                folder / MAPPING_FILE,
                self.out,
                accept=self.accept,
                progress=progress,
                should_stop=should_stop,
            )
        except InputError as error:
            raise without_folder(error, folder) from None
        return OwnSet(done.folder, done.issues)


def mapping_text(draft: Draft, file: Path) -> str:
    """The mapping file of a draft, with paths relative to the future `file`."""
    return edited(draft).text(file)


def without_folder(error: InputError, folder: Path) -> InputError:
    """The error without the uploads' folder, which means nothing to a user."""
    return InputError(str(error).replace(f"{folder}/", "").replace(f"{MAPPING_FILE}: ", ""))
