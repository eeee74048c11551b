"""Write a measurement set: all of it or nothing."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from flexviz.base import toml
from flexviz.base.errors import InputError
from flexviz.base.files import named_errors, whole_folder
from flexviz.base.names import names_of
from flexviz.base.schemas import first_repeated
from flexviz.data.measurements.data import OPTIONAL_SIGNALS
from flexviz.data.measurements.group_table import GroupTable
from flexviz.data.measurements.measurement_set import MeasurementSet
from flexviz.data.measurements.schema import FILE_NAME, parse
from flexviz.data.measurements.set_contents import contents_of
from flexviz.data.measurements.set_document import SetProperties, numbers, set_document
from flexviz.robot.robot import PayloadBody

if TYPE_CHECKING:
    import pyarrow as pa

SUFFIXES = {"parquet": ".parquet", "csv": ".csv"}


def write_set(
    folder: str | Path,
    measurements: MeasurementSet | None = None,
    *,
    robot: str | None = None,
    joints: str | Sequence[str] | None = None,
    groups: Sequence[GroupTable] | None = None,
    payloads: Mapping[str, Sequence[PayloadBody]] | None = None,
    files: Mapping[str, str | bytes | Path] | None = None,
    table_format: str = "parquet",
    single: bool = False,
    overwrite: bool = False,
    **properties: Unpack[SetProperties],
) -> Path:
    """Write a measurement set that `read_set` gives back exactly, and return its folder.

    Everything is written to a temporary folder, which then takes the place of `folder`: all or nothing.

    Args:
        measurements: a set in memory, also one of arrays: robot, joints, groups, payloads and properties are
            its own. Signals of an uneven clock are written as they were resampled, static tests are copied.
        robot: as in the format; a URDF's path is relative to `folder`, and the URDF is one of `files`.
        files: further files of the set: name -> text, bytes, or the path of a file to copy.
        table_format, single: "parquet" or "csv"; store the signals (never the time) as float32.
        overwrite: replace an existing set, never any other folder or file.
        properties: as in the format: see `SetProperties`.

    Raises:
        InputError: for what could not be read back, a folder in use, a static test whose table has changed,
            or a set together with parts of one.
    """
    folder = Path(os.path.abspath(folder))  # without ".."
    check_free(folder, overwrite)
    own = {"robot": robot, "joints": joints, "groups": groups, "payloads": payloads, **properties}
    given = [name for name, value in own.items() if value is not None]
    if measurements is not None:
        if given:
            raise InputError(f"found a set and {', '.join(given)}, expected those of the set alone")
        parts = contents_of(measurements)
        robot, joints, groups, payloads = (
            parts.robot,
            measurements.joints,
            parts.groups,
            measurements.payloads,
        )
        properties, files = parts.properties, {**parts.files, **(files or {})}
    if robot is None or joints is None or groups is None or payloads is None:
        raise InputError("expected a measurement set, or robot, joints, groups and payloads")
    if table_format not in SUFFIXES:
        raise InputError(f'table format "{table_format}" is not known, expected csv or parquet')
    entries = [group_entry(group, table_format) for group in groups]
    document = set_document(robot, names_of(joints), payloads, entries, **properties)
    parse(document, folder / FILE_NAME)  # what could not be read back is not written
    with named_errors(folder), whole_folder(folder) as new:
        fill_folder(new, document, groups, files or {}, single)
    return folder


def group_entry(group: GroupTable, table_format: str) -> dict[str, Any]:
    """A group, as in the format."""
    return (
        {"name": group.name, "trajectory": group.trajectory, "payload": group.payload}
        | {"file": group.file or group.name + SUFFIXES[table_format]}
        | ({"validation": True} if group.validation else {})
        | ({} if group.kind == "motion" else {"kind": group.kind, "clamped": group.clamped})
        | numbers(temperature=group.temperature)
        | ({} if group.kp_scale == 1.0 else {"kp_scale": float(group.kp_scale)})
    )


def fill_folder(
    new: Path,
    document: dict[str, Any],
    groups: Sequence[GroupTable],
    files: Mapping[str, str | bytes | Path],
    single: bool,
) -> None:
    """Write `measurements.toml`, the tables and further files into the folder `new`."""
    names = [*files, *(entry["file"] for entry in document["groups"])]
    if twice := first_repeated(os.path.normpath(name) for name in names):
        raise InputError(f'two files of the set are called "{twice}"')
    for name, content in files.items():
        path = within(new, name)
        if isinstance(content, Path):
            shutil.copyfile(content, path)
        else:
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
    for group, entry in zip(groups, document["groups"], strict=True):
        path = within(new, entry["file"])
        if group.recorded is not None:
            shutil.copyfile(group.recorded, path)
        else:
            write_table(path, table_of(group, document["joints"], single))
    (new / FILE_NAME).write_text(toml.dumps(document), encoding="utf-8")


def check_free(folder: Path, overwrite: bool = False) -> None:
    """InputError unless `folder` is new, empty, or a measurement set that may be replaced."""
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return
    if not folder.is_dir():
        raise InputError("this is a file, expected a new folder", file=folder)
    if not (folder / FILE_NAME).is_file():
        raise InputError("the folder is not empty, expected a new or empty folder", file=folder)
    if not overwrite:
        raise InputError("a measurement set is already there, expected a new or empty folder", file=folder)


def table_of(group: GroupTable, joints: Sequence[str], single: bool) -> pa.Table:
    """The group's columns, in the format's names."""
    import pyarrow as pa

    kind = pa.float32() if single else pa.float64()
    columns: dict[str, pa.Array] = {"time": pa.array(np.asarray(group.time, dtype=float))}
    for name in ("theta", "tau", *OPTIONAL_SIGNALS):
        signal = getattr(group, name)
        if signal is None:
            continue
        signal = np.asarray(signal, dtype=float)
        expected = (len(group.time), len(joints))
        if signal.shape != expected:
            raise InputError(f'group "{group.name}": {name} has shape {signal.shape}, expected {expected}')
        for j, joint in enumerate(joints):
            if not np.isnan(signal[:, j]).all():
                columns[f"{name}_{joint}"] = pa.array(np.ascontiguousarray(signal[:, j])).cast(kind)
    return pa.table(columns)


def write_table(path: Path, table: pa.Table) -> None:
    """Write a table so that every number is read back exactly."""
    import pyarrow as pa
    import pyarrow.csv as pacsv
    import pyarrow.parquet as papq

    if path.suffix.lower() == ".csv":
        exact = pa.table({name: table[name].cast(pa.float64()) for name in table.column_names})
        pacsv.write_csv(exact, path, pacsv.WriteOptions(quoting_style="none"))
    else:
        papq.write_table(table, path, compression="zstd", use_dictionary=False)


def within(folder: Path, name: str) -> Path:
    """The path of a new file of the set, whose folder exists then; InputError when it would lie outside."""
    path = Path(os.path.normpath(folder / name))
    if Path(name).is_absolute() or folder not in path.parents:
        raise InputError(f'"{name}" lies outside the set\'s folder, expected a path inside it')
    path.parent.mkdir(parents=True, exist_ok=True)
    return path
