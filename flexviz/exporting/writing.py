"""Several formats into one folder: all of it, or nothing."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from flexviz.errors import InputError, choose_from
from flexviz.exporting.code import c_code, python_code
from flexviz.exporting.mjcf import mjcf
from flexviz.exporting.parameters import json_parameters, yaml_parameters
from flexviz.exporting.subject import Subject, subject_of
from flexviz.exporting.urdf import urdf
from flexviz.measurements import check_free

if TYPE_CHECKING:
    from flexviz.diagnosis import Diagnosis
    from flexviz.exporting.documents import Document
    from flexviz.identification import Identification
    from flexviz.measurements import MeasurementSet

# format -> (files, what of the model they do not hold)
Writer = Callable[[Subject], tuple[dict[str, bytes], list[str]]]
FORMATS: dict[str, Writer] = {
    "urdf": urdf,
    "mjcf": mjcf,
    "yaml": yaml_parameters,
    "json": json_parameters,
    "c": c_code,
    "python": python_code,
}


@dataclass(frozen=True)
class Exported:
    """What was written.

    Attributes
    ----------
    folder: where.
    files: format -> its files, the main one first.
    left_out: format -> what of the model it does not hold, a line each.
    """

    folder: Path
    files: dict[str, tuple[Path, ...]]
    left_out: dict[str, tuple[str, ...]]


def check_formats(formats: Sequence[str]) -> tuple[str, ...]:
    """The formats in their own order, each once; none stands for all.

    Raises:
        InputError: one does not exist.
    """
    for name in formats:
        if name not in FORMATS:
            raise InputError(f'format "{name}" does not exist; {choose_from(name, FORMATS)}')
    return tuple(name for name in FORMATS if not formats or name in formats)


def check_folder(folder: str | Path) -> Path:
    """The folder to write to, absolute; InputError where nothing can be written there."""
    folder = Path(folder).absolute()
    above = next(parent for parent in folder.parents if parent.exists())
    if not above.is_dir():
        raise InputError("this is a file, a folder would be right", file=above)
    check_free(folder)
    return folder


def write(subject: Subject, folder: str | Path, formats: Sequence[str] = ()) -> Exported:
    """Write `formats` (all of them where none is named) into a new or empty folder.

    Everything is written beside `folder`, which then appears with all in it.

    Raises:
        InputError: a format does not exist, the folder is not empty, or the model cannot be written so.
    """
    chosen = check_formats(formats)
    folder = check_folder(folder)
    made = {name: FORMATS[name](subject) for name in chosen}
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{folder.name}.", dir=folder.parent) as temporary:
            new = Path(temporary) / "new"
            new.mkdir()
            for files, _ in made.values():
                for name, content in files.items():
                    path = new / name
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(content)
            if folder.exists():
                folder.rmdir()
            os.replace(new, folder)
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror or error})", file=folder) from None
    return Exported(
        folder,
        {name: tuple(folder / file for file in files) for name, (files, _) in made.items()},
        {name: tuple(missing) for name, (_, missing) in made.items()},
    )


def export(
    measurements: MeasurementSet,
    result: Identification | Diagnosis | Document,
    folder: str | Path,
    formats: Sequence[str] = (),
    *,
    payload: str | None = None,
) -> Exported:
    """Write what was found on a set to a new or empty folder.

    Args:
        measurements: the set.
        result: its identification, its diagnosis (the final model), or what `read_result` has read.
        folder: it appears with everything in it, or not at all.
        formats: some of `FORMATS`; all of them where none is named.
        payload: name of one of the set's payloads that the robot is to carry.

    Raises:
        InputError: a format or the payload does not exist, the folder is not empty, the result does not fit
            the set, or the model cannot be written in a format.
    """
    return write(subject_of(measurements, result, payload=payload), folder, formats)
