"""The file session.json: its format, migrations from older formats, and where the measurement set is."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from flexviz.base.errors import InputError
from flexviz.base.limits import read_json
from flexviz.data.measurements import FILE_NAME, FileHash, Fingerprint, MeasurementSet, fingerprint

SESSION_FILE = "session.json"
FORMAT = 5
OLD_ARRAYS = "session.npz"  # of format 1
HERE = "."

RENAMED = {
    "Stair": "ModelStep",
    "Place": "ResidualLocation",
    "FreeForm": "FreeCurve",
    "Guard": "BandwidthCheck",
    "Step": "SessionStep",
    "Note": "SessionNote",
}  # classes as format 2 wrote them
RENAMED_FIELDS = {"stairs": "model_steps", "free_form": "free_curve"}
NOTE_BEGINNINGS = {
    "no model reaches the measurement noise": "model-error",
    "the error of": "pulses",
    "what stays unexplained": "unexplained",
    "a free curve": "free-curve",
}  # format 2 stored only the sentences

Document = dict[str, Any]


def read_document(folder: Path) -> Document:
    """Read the session.json of a folder, migrated to the current format."""
    return migrated(read_json(folder / SESSION_FILE), folder)


def migrated(document: Any, folder: Path) -> Document:
    """The document in the current format; InputError for other content or a later format."""
    if not isinstance(document, dict):
        raise InputError("not a JSON object")
    found = document.get("format")
    if not isinstance(found, int) or isinstance(found, bool) or found < 1:
        raise InputError(f'"format" is {found!r}, expected a whole number from 1 to {FORMAT}')
    if found > FORMAT:
        raise InputError(
            f"written in format {found} by flexviz {document.get('flexviz', 'of a later version')}; "
            f"this one reads up to format {FORMAT}"
        )
    while (found := document["format"]) < FORMAT:
        try:
            document = MIGRATIONS[found](document, folder)
        except InputError:
            raise
        except (AttributeError, LookupError, TypeError, ValueError) as error:  # entries of another kind
            message = f"not what format {found} holds ({type(error).__name__}: {error})"
            raise InputError(message) from None
    return document


def from_1(document: Document, folder: Path) -> Document:
    """Migrate format 1: in a copy of the set, all arrays in one file, no hashes, notes or times."""
    try:
        with zipfile.ZipFile(folder / OLD_ARRAYS) as archive:
            count = len(archive.namelist())
    except (OSError, zipfile.BadZipFile) as error:
        raise InputError(f"{OLD_ARRAYS} cannot be read ({error})") from None
    return document | {
        "format": 2,
        "set": {"name": folder.resolve().name, "path": ".", "absolute": ""},
        "arrays": [{"file": OLD_ARRAYS, "count": count}],
        "notes": [],
        "recordings": [],
    }


def renamed(value: Any) -> Any:
    """Packed values with the current names of classes and fields."""
    if isinstance(value, list):
        return [renamed(item) for item in value]
    if not isinstance(value, dict):
        return value
    new = {RENAMED_FIELDS.get(key, key): renamed(item) for key, item in value.items()}
    kind = new.get("=")
    if isinstance(kind, str):
        new["="] = RENAMED.get(kind, kind)
    if kind == "Diagnosis":
        new["notes"] = [typed_note(note) if isinstance(note, str) else note for note in new.get("notes", [])]
    return new


def typed_note(text: str) -> Document:
    """A note of a diagnosis; its kind is inferred from the beginning of the text."""
    found = (kind for start, kind in NOTE_BEGINNINGS.items() if text.startswith(start))
    bandwidth = "bandwidth" if "bandwidth" in text else "other"
    return {"=": "Note", "kind": next(found, bandwidth), "text": text}


POSITIONAL = {
    "DiagnosisStep": ("groups", ("name", "rms", "validation")),
    "Finding": ("parameters", ("value", "std", "unit")),
    "Diagnosis": ("decoys", ("accepted", "tried")),
}  # class of format 4 -> a field of it that was lists, and what they hold


def untagged(value: Any) -> Any:
    """What format 4 wrote with the names of its classes, as the adapters of these classes read it."""
    if isinstance(value, list):
        return [untagged(item) for item in value]
    if not isinstance(value, dict):
        return value
    if value.keys() == {"/"}:
        return value["/"]
    if value.keys() == {"{"}:
        return {str(key): untagged(item) for key, item in value["{"]}
    new = {key: untagged(item) for key, item in value.items() if key != "="}
    field, names = POSITIONAL.get(str(value.get("=")), ("", ()))
    if old := new.get(field):
        new[field] = _named(old, names)
    return new


def _named(value: Any, names: tuple[str, ...]) -> Any:
    """The innermost lists of values as tables with these names."""
    if isinstance(value, dict):
        return {key: _named(item, names) for key, item in value.items()}
    if value and all(isinstance(item, list | dict) for item in value):
        return [_named(item, names) for item in value]
    return dict(zip(names, value, strict=True))


FIT = ("effects", "observer", "bandwidth", "gains", "refine")  # fields of a state up to format 4
FITTED = ("path", "observer", "bandwidth", "roles", "effects", "refine", "gains")  # in their order
DIAGNOSED = ("path", "roles", "effects", "observer", "bandwidth", "gains", "refine")


def with_fits(document: Document) -> Document:
    """The settings of an identification as one record, in every state."""
    for step in (document["present"], *document.get("past", []), *document.get("future", [])):
        state = step["analysis"]
        own = {name: state.pop(name) for name in FIT if name in state}
        for key, names in (("fitted", FITTED), ("diagnosed", DIAGNOSED)):
            if state.get(key) is not None:
                # a verdict of format 2 states data and model only: whatever else the state has
                state[key] = _settings(own | dict(zip(names, state[key], strict=False)))
        state["fit"] = _settings(own)["fit"]
    return document


def _settings(values: Document) -> Document:
    fit = {"refine": False} | {name: values.pop(name) for name in FIT if name in values}
    return values | {"fit": fit}


MIGRATIONS: dict[int, Callable[[Document, Path], Document]] = {
    1: from_1,
    2: lambda document, _: renamed(document) | {"format": 3},  # other class names, notes as plain sentences
    3: lambda document, _: document | {"format": 4},  # no gains set by hand, which have a default
    4: lambda document, _: with_fits(untagged(document)) | {"format": 5},
}


@dataclass(frozen=True)
class SetReference:
    """A measurement set by location and hash."""

    name: str
    path: str  # relative to the session folder; "." if the session carries its set
    absolute: str  # the same, absolute; empty if carried
    fingerprint: Fingerprint | None  # None in sessions of format 1

    @staticmethod
    def of(measurements: MeasurementSet, folder: Path, carried: bool) -> SetReference:
        """The reference from a session `folder` to a set; `carried`: the set is in that folder."""
        path = measurements.path.resolve()
        if carried:
            return SetReference(measurements.name, HERE, "", fingerprint(measurements))
        relative = Path(os.path.relpath(path, folder.resolve())).as_posix()
        return SetReference(measurements.name, relative, str(path), fingerprint(measurements))

    def locate(self, folder: Path) -> Path:
        """The folder of the set, given that of the session; InputError if it is missing."""
        places = [folder]  # a set beside session.json takes precedence
        if self.path != HERE:
            places += [folder / self.path, *([Path(self.absolute)] if self.absolute else [])]
        for place in places:
            if (place / FILE_NAME).is_file():
                return place
        looked = " and ".join(dict.fromkeys(str(place.resolve()) for place in places[-2:]))
        raise InputError(
            f'the measurement set "{self.name}" is missing: there is no {FILE_NAME} in {looked}; put it '
            "back, or give its location with flexviz session SESSION --set FOLDER"
        )

    def require_files(self, place: Path) -> None:
        """InputError naming the first file of the set that no longer exists."""
        for file in self.fingerprint.files if self.fingerprint else ():
            if ":" not in file.name and not (place / file.name).is_file():
                raise InputError(
                    f"the data file {file.name} of the measurement set {place} is missing; it had "
                    f"{file.bytes} bytes, SHA-256 {file.sha256}"
                )

    def changes(self, measurements: MeasurementSet) -> tuple[str, ...]:
        """Names of the files of the set that have changed."""
        return fingerprint(measurements).changes_since(self.fingerprint) if self.fingerprint else ()

    def to_json(self) -> dict[str, Any]:
        """The entry in session.json."""
        document = {"name": self.name, "path": self.path, "absolute": self.absolute}
        if self.fingerprint is None:
            return document
        files = [asdict(file) for file in self.fingerprint.files]
        return document | {"sha256": self.fingerprint.sha256, "files": files}

    @staticmethod
    def from_json(document: Any) -> SetReference:
        """The reference that `to_json` wrote; InputError for anything else."""
        try:
            rows = document.get("files")
            name, path = document["name"], document["path"]
            absolute = document.get("absolute", "")
            files = tuple(FileHash(f["name"], f["sha256"], f["bytes"]) for f in rows or ())
        except (AttributeError, KeyError, TypeError, ValueError):
            raise InputError("its reference to a measurement set cannot be read") from None
        texts = [name, path, absolute, *(text for f in files for text in (f.name, f.sha256))]
        if not all(isinstance(text, str) and "\0" not in text for text in texts):
            raise InputError("its reference to a measurement set contains something other than names")
        return SetReference(name, path, absolute, None if rows is None else Fingerprint(files))


def read_reference(folder: Path) -> SetReference:
    """The set reference of the session in a folder; InputError if it cannot be read."""
    try:
        return SetReference.from_json(read_document(folder)["set"])
    except (OSError, ValueError, KeyError) as error:
        why = f": {error}" if isinstance(error, InputError) else f" ({type(error).__name__}: {error})"
        raise InputError(f"not a usable session{why}", file=folder / SESSION_FILE) from None
