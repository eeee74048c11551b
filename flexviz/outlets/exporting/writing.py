"""Write all formats into one folder, atomically."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from flexviz.base.errors import InputError, choose_from
from flexviz.base.files import named_errors, whole_folder
from flexviz.base.names import names_of
from flexviz.data.measurements import check_free, set_of
from flexviz.model.servo import follows_goals
from flexviz.outlets.exporting.code import c_code, python_code
from flexviz.outlets.exporting.identified import FormatFiles, IdentifiedRobot, identified_robot
from flexviz.outlets.exporting.mjcf import mjcf
from flexviz.outlets.exporting.parameters import json_parameters, yaml_parameters
from flexviz.outlets.exporting.servos import SERVO_FORMATS
from flexviz.outlets.exporting.tables import tables
from flexviz.outlets.exporting.urdf import urdf

if TYPE_CHECKING:
    from flexviz.analysis.diagnosis import Diagnosis
    from flexviz.analysis.identification import Identification
    from flexviz.content.results import ResultDocument
    from flexviz.data.measurements import MeasurementSet

FORMATS: dict[str, Callable[[IdentifiedRobot], FormatFiles]] = {
    "urdf": urdf,
    "mjcf": mjcf,
    "yaml": yaml_parameters,
    "json": json_parameters,
    "c": c_code,
    "python": python_code,
    "table": tables,
}


@dataclass(frozen=True)
class Exported:
    """The files of an export.

    Attributes:
        files: format -> its files, the main one first.
        left_out: format -> parts of the model that it does not contain, one line each.
    """

    folder: Path
    files: dict[str, tuple[Path, ...]]
    left_out: dict[str, tuple[str, ...]]


def check_formats(formats: Sequence[str], known: Sequence[str] | None = None) -> tuple[str, ...]:
    """The formats without duplicates, in the order of the `known` ones; all of these if none is named.

    Without `known` ones, whether they exist at all.

    Raises:
        InputError: a format does not exist.
    """
    every = (*FORMATS, *(name for name in SERVO_FORMATS if name not in FORMATS))
    if known is None and not formats:
        return ()  # the model decides
    known = every if known is None else known
    for name in formats:
        if name not in known:
            raise InputError(f'format "{name}" does not exist; {choose_from(name, known)}')
    return tuple(name for name in known if not formats or name in formats)


def formats_of(identified: IdentifiedRobot) -> dict[str, Callable[[IdentifiedRobot], FormatFiles]]:
    """The formats that can hold a model: those of servos that follow goals, or those of torques."""
    return SERVO_FORMATS if follows_goals(identified.model) else FORMATS


def formats_for(measurements: MeasurementSet) -> tuple[str, ...]:
    """Names of the formats that can hold a model of this set."""
    return tuple(FORMATS if measurements.drive is None else SERVO_FORMATS)


def check_folder(folder: str | Path) -> Path:
    """The absolute folder; raises InputError if it cannot be written."""
    folder = Path(folder).absolute()
    above = next(parent for parent in folder.parents if parent.exists())
    if not above.is_dir():
        raise InputError("this is a file, expected a folder", file=above)
    check_free(folder)
    return folder


def write(identified: IdentifiedRobot, folder: str | Path, formats: Sequence[str] = ()) -> Exported:
    """Write `formats` (all if none is named) into a new or empty folder, atomically.

    Raises:
        InputError: a format does not exist, the folder is not empty, or a format cannot hold the model.
    """
    made_by = formats_of(identified)
    chosen = check_formats(formats, tuple(made_by))
    folder = check_folder(folder)
    if not formats and not identified.has_motors:
        chosen = tuple(name for name in chosen if name != "mjcf")  # which refuses such models
    made = {name: made_by[name](identified) for name in chosen}
    with named_errors(folder), whole_folder(folder) as new:
        for name, content in ((n, c) for files in made.values() for n, c in files.contents.items()):
            (new / name).parent.mkdir(parents=True, exist_ok=True)
            (new / name).write_bytes(content)
    return Exported(
        folder,
        {name: tuple(folder / file for file in files.contents) for name, files in made.items()},
        {name: tuple(files.left_out) for name, files in made.items()},
    )


def export(
    measurements: MeasurementSet | str | Path,
    result: Identification | Diagnosis | ResultDocument,
    folder: str | Path,
    formats: str | Sequence[str] = (),
    *,
    payload: str | None = None,
) -> Exported:
    """Write a result to a new or empty folder.

    Args:
        measurements: the measurement set, or its folder.
        result: its identification, its diagnosis (the final model), or a result read by `read_result`.
        folder: is written completely or not at all.
        formats: one or some of `FORMATS`; all if none is named.
        payload: name of the payload that the robot carries.

    Raises:
        InputError: a format or the payload does not exist, the folder is not empty, the result is of
            another set, or a format cannot hold the model.
    """
    robot = identified_robot(set_of(measurements), result, payload=payload)
    return write(robot, folder, names_of(formats))
