"""Read a measurement set: `measurements.toml`, the robot, and one table per group."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from flexviz.base import toml
from flexviz.base.errors import InputError
from flexviz.data.measurements.data import present_fingerprint
from flexviz.data.measurements.group_reading import read_payloads, read_robot
from flexviz.data.measurements.measurement_set import MeasurementSet, Warnings, checked_set
from flexviz.data.measurements.schema import MeasurementFile, locate, parse
from flexviz.data.measurements.static_reading import static_tests
from flexviz.data.measurements.tables import FileTable
from flexviz.robot.robot import is_library_robot

TRUTH = "truth.json"  # present in simulated sets; never opened here


def read_set(path: str | Path, *, logged: bool = True) -> MeasurementSet:
    """Read and check the measurement set in the folder `path` (or whose `measurements.toml` it is).

    "demo" is the bundled example set, unless there is such a folder. Anything wrong is one InputError that
    names file and place; oddities are kept in `MeasurementSet.warnings`, and logged unless not `logged`.
    """
    file = locate(path)
    content = parse(toml.read(file), file)
    folder = file.resolve().parent
    if not is_library_robot(content.robot):
        inside(folder, content.robot, file, "robot")
    robot = read_robot(content.robot, content.joints, folder, file, content.gravity)
    payloads = read_payloads(content, robot, file)
    warn = Warnings(logged)
    warn(*(replace(note, file=content.robot) for note in robot.notes))
    paths = tables_of(content, folder, file)
    files = present_fingerprint(folder, robot, paths)
    holds = static_tests(content, paths, robot, payloads, warn)
    read = checked_set(content, robot, payloads, [FileTable(path) for path in paths], file, warn)
    if changed := present_fingerprint(folder, robot, paths).changes_since(files):
        raise InputError(f"{', '.join(changed)} changed while the set was read", file=file)
    simulated = (folder / TRUTH).exists()
    return replace(read, path=folder, name=folder.name, simulated=simulated, files_read=files, holds=holds)


def set_of(measurements: MeasurementSet | str | Path) -> MeasurementSet:
    """The set, read if its folder is given."""
    return measurements if isinstance(measurements, MeasurementSet) else read_set(measurements)


def inside(folder: Path, name: str, file: Path, place: str) -> Path:
    """The file `name` in `folder`; InputError when it lies outside (also by a link) or does not exist."""
    try:
        path = (folder / name).resolve()
        if Path(name).is_absolute() or not path.is_relative_to(folder):
            message = f'"{name}" lies outside the set\'s folder, expected a path inside it'
            raise InputError(message, file=file, place=place)
        if not path.is_file():
            raise InputError(f'"{name}" does not exist in the set\'s folder', file=file, place=place)
    except (OSError, ValueError, RuntimeError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or error
        raise InputError(f'"{name}" is not a usable path ({reason})', file=file, place=place) from None
    return path


def tables_of(content: MeasurementFile, folder: Path, file: Path) -> list[Path]:
    """The table of every group; InputError for one outside the folder, or of two groups."""
    users: dict[Path, str] = {}  # table -> the group that uses it
    for i, group in enumerate(content.groups):
        path = inside(folder, group.file, file, f'group {i + 1} "{group.name}", file')
        if (first := users.setdefault(path, group.name)) != group.name:
            message = f'groups "{first}" and "{group.name}" use the same file'
            raise InputError(f"{message}: expected a recording of its own for each", file=path)
    return list(users)
