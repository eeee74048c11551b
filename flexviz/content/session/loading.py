"""Opening a session: its measurement set, checked for changes, and its history."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.analysis.identification import Identification
from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.content.session.document import (
    OLD_ARRAYS,
    SESSION_FILE,
    Document,
    SetReference,
    read_document,
    read_reference,
)
from flexviz.content.session.packing import Unpacker, numbers, read_arrays, read_npz
from flexviz.content.session.saving import remember, save_session, stamp_of
from flexviz.content.session.state import HISTORY, Session, SessionStep
from flexviz.data.measurements import FILE_NAME, MeasurementSet, read_set, set_of
from flexviz.model.effects import EFFECTS, choose_effects

READ_ATTEMPTS = 4  # another process may save meanwhile


@dataclass(frozen=True, eq=False)
class OpenedSession:
    """A saved session with its measurement set.

    Attributes:
        folder: of the session.
        measurements: its set; the first warning names files that have changed.
        session: states, notes, recordings. If data have changed, no result is up to date.
        changed: files of the set that have changed since the session was saved.
        saved, version: time of saving (ISO 8601, UTC) and version of flexviz; empty if unknown.
    """

    folder: Path
    measurements: MeasurementSet
    session: Session
    changed: tuple[str, ...] = ()
    saved: str = ""
    version: str = ""

    @staticmethod
    def open(source: str | Path | MeasurementSet) -> OpenedSession:
        """Open a saved session or start one on a measurement set; see `open_session`."""
        return open_session(source)

    def save(self, folder: str | Path | None = None, *, carry: bool = False) -> Path:
        """Save the session, by default to its own folder; see `save_session`.

        Raises:
            InputError: also without a folder for a set in memory, which has none.
        """
        if folder is None and not (self.measurements.in_files or is_session(self.folder)):
            raise InputError(f'the set "{self.measurements.name}" is in memory, expected a folder')
        return save_session(self.session, self.measurements, Path(folder or self.folder), carry=carry)


def is_session(path: Path) -> bool:
    """Whether a path is a session folder or its session.json."""
    return (path / SESSION_FILE).is_file() or (path.name == SESSION_FILE and path.is_file())


def open_session(source: str | Path | MeasurementSet) -> OpenedSession:
    """Open a session folder (or its session.json), or start a session on a measurement set, also in memory.

    Raises:
        InputError: naming the file, for anything that is wrong.
    """
    if isinstance(source, MeasurementSet) or not is_session(Path(source)):
        measurements = set_of(source)
        return OpenedSession(measurements.path, measurements, Session.of(measurements))
    folder = _folder_of(source)
    return open_with(folder, read_measurements(folder))


def _folder_of(path: str | Path) -> Path:
    path = Path(path)
    return path.parent if path.name == SESSION_FILE else path


def read_measurements(folder: Path) -> MeasurementSet:
    """The measurement set of the session in a folder."""
    try:
        reference = read_reference(folder)
        place = reference.locate(folder)
        reference.require_files(place)
    except InputError as error:
        if error.file is not None:
            raise
        raise InputError(str(error), file=folder / SESSION_FILE, place="set") from None
    return read_set(place)


def open_with(folder: Path, measurements: MeasurementSet) -> OpenedSession:
    """Open the session in a folder, given its measurement set."""
    file = folder / SESSION_FILE
    try:
        for left in reversed(range(READ_ATTEMPTS)):
            before = stamp_of(folder)
            document = numbers(read_document(folder))
            try:
                arrays = _arrays(document, folder)
                break
            except FileNotFoundError:
                if not left or stamp_of(folder) == before:
                    raise
        remember(folder, before)
        return _unpacked(document, arrays, folder, measurements)
    except InputError as error:
        raise InputError(f"not a usable session: {error}", file=file) from None
    except Exception as error:  # whatever the content makes the results' classes raise
        what = getattr(error, "filename", None) or type(error).__name__
        raise InputError(
            f"not a usable session ({what}: {getattr(error, 'strerror', None) or error})", file=file
        ) from None


def relocate(path: str | Path, place: str | Path) -> OpenedSession:
    """Open a session whose measurement set has moved to `place`; save it to keep the new location."""
    folder = _folder_of(path)
    if (folder / FILE_NAME).is_file():
        raise InputError("the session carries its measurement set and cannot use another one", file=folder)
    return open_with(folder, read_set(place))


def _arrays(document: Document, folder: Path) -> list[np.ndarray]:
    arrays: list[np.ndarray] = []
    for entry in document["arrays"]:
        if entry.get("file") == OLD_ARRAYS:
            arrays += read_npz(folder / OLD_ARRAYS)
        else:
            arrays += read_arrays(folder, entry)
    return arrays


def _unpacked(
    document: Document, arrays: list[np.ndarray], folder: Path, measurements: MeasurementSet
) -> OpenedSession:
    changed = SetReference.from_json(document["set"]).changes(measurements)
    if changed:
        fact = Fact("set-changed", "odd", values={"files": tuple(changed)})
        measurements = replace(measurements, warnings=(fact, *measurements.warnings))
    unpacker = Unpacker(measurements.path, arrays, document.get("shared", []))
    session: Session = unpacker.unpack(Session, document)

    def checked(steps: Sequence[SessionStep]) -> tuple[SessionStep, ...]:
        return tuple(_checked(step, measurements, document, bool(changed)) for step in steps)

    session = replace(
        session,
        present=checked([session.present])[0],
        past=checked(session.past[-HISTORY:]),
        future=checked(session.future[:HISTORY]),
        recordings=tuple((folder / file).resolve() for file in session.recordings),
    )
    for result in unpacker.shared.values():
        if isinstance(result, Identification | Diagnosis):
            result.document()  # checks what the classes' annotations leave open
    saved, version = (str(document.get(key, "")) for key in ("saved", "flexviz"))
    return OpenedSession(folder, measurements, session, changed, saved, version)


def _checked(
    step: SessionStep, measurements: MeasurementSet, document: Document, changed: bool
) -> SessionStep:
    """A step whose settings match the set."""
    analysis = step.analysis
    if analysis.path != measurements.path:
        raise InputError("it belongs to another measurement set")
    names = [group.name for group in measurements.groups]
    if [name for name, _ in analysis.roles] != names:
        raise InputError(f"its groups differ from those of the set ({', '.join(names)})")
    for name, role in analysis.roles:
        analysis.with_role(name, role)
    unknown = [text for text in analysis.effects if text.partition(":")[0] not in EFFECTS]
    own = [str(entry.get("path")) for entry in document.get("effects_from", [])]
    if unknown and own:
        files = " ".join(f"--effects-from {file}" for file in own)
        raise InputError(f"{', '.join(unknown)} came from a file of user-defined effects, expected {files}")
    choose_effects(analysis.effects, measurements.joints, measurements.carried, names)
    return replace(step, analysis=replace(analysis, fitted=None, diagnosed=None)) if changed else step
