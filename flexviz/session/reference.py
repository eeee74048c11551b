"""Reference from a session to its measurement set: location and fingerprint."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flexviz.errors import InputError
from flexviz.measurements import FILE_NAME, FileHash, Fingerprint, MeasurementSet, fingerprint
from flexviz.session.document import SESSION_FILE, read_document

HERE = "."


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
        files = [{"name": f.name, "sha256": f.sha256, "bytes": f.bytes} for f in self.fingerprint.files]
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
    except InputError as error:
        raise InputError(f"not a usable session: {error}", file=folder / SESSION_FILE) from None
    except (OSError, ValueError, KeyError) as error:
        raise InputError(
            f"not a usable session ({type(error).__name__}: {error})", file=folder / SESSION_FILE
        ) from None
