"""The measurement sets of a batch: those in a folder, or those of a list."""

from __future__ import annotations

import csv
import datetime as dt
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from flexviz.base.errors import FlexvizError, InputError
from flexviz.base.limits import check_size
from flexviz.data.measurements import FILE_NAME, overview

LARGEST_LIST = 64 * 2**20  # [bytes]
COLUMNS = ("set", "robot", "date")  # of a list; the first is needed
FROM_SET, FROM_LIST, FROM_FILE = "set", "list", "file"  # where a date comes from


@dataclass(frozen=True)
class BatchSet:
    """One set of a batch.

    Attributes:
        name: its path relative to the batch's folder or list.
        path: its folder.
        robot: the robot it was recorded on: sets of one robot are compared over their dates.
        date: ISO 8601, without a time zone in the zone of the set; "" if the set cannot be opened.
        date_from: "set" (its key `date`), "list", or "file": the last change of its tables.
        sha256: of its files; "" if they cannot be read.
        description, description_sha256: the robot's description: sets with equal ones are compared.
        error: why it cannot be opened, or "".
    """

    name: str
    path: Path
    robot: str
    date: str = ""
    date_from: str = ""
    sha256: str = ""
    description: str = ""
    description_sha256: str = ""
    error: str = ""


def find_sets(source: Path) -> list[BatchSet]:
    """The sets in a folder and its folders, or those that a list names.

    A list is a text file with a folder on each line, or a CSV file with the columns set and, if known, robot
    and date; paths are relative to it. Sets in the same folder belong to one robot, unless the list says
    otherwise.

    Raises:
        InputError: for a source without any set, or a list that cannot be read.
    """
    if source.is_dir():
        files = sorted(source.rglob(FILE_NAME), key=lambda file: _natural(file.parent))
        hidden = [f for f in files if any(part.startswith(".") for part in f.relative_to(source).parts)]
        rows = [(f.parent, "", "") for f in files if f not in set(hidden)]
        base = source
    elif source.is_file():
        rows, base = list(read_list(source)), source.parent
    else:
        raise InputError(
            "does not exist, expected a folder of measurement sets or a list of them", file=source
        )
    if not rows:
        raise InputError(f"contains no measurement set (a folder with {FILE_NAME})", file=source)
    if not any(folder.exists() for folder, *_ in rows):
        message = f'none of its lines names a folder, the first is "{rows[0][0].name[:60]}"'
        raise InputError(f"{message}; expected folders of measurement sets", file=source)
    return [open_one(base, *row) for row in rows]


def _natural(path: Path) -> list[tuple[int, str]]:
    """For sorting: run2 before run10."""
    parts = re.split(r"(\d+)", str(path))
    return [(int(p), "") if p.isdigit() and len(p) < 18 else (-1, p) for p in parts]


def read_list(file: Path) -> Iterator[tuple[Path, str, str]]:
    """Folder, robot and date of each set in a list."""
    try:
        check_size(file, LARGEST_LIST, "a list of sets")
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read ({getattr(error, 'strerror', None) or error})", file=file) from None
    if file.suffix.lower() != ".csv":
        for line in lines:
            if (name := line.strip()) and not name.startswith("#"):
                yield file.parent / name, "", ""
        return
    table = csv.DictReader(lines)
    names = [name.strip() for name in table.fieldnames or ()]
    if "set" not in names or set(names) - set(COLUMNS):
        message = f"columns {', '.join(names) or 'none'}, expected set and, if known, robot and date"
        raise InputError(message, file=file, place="row 1")
    table.fieldnames = names
    for number, row in enumerate(table, 2):
        cells = {name: (row.get(name) or "").strip() for name in COLUMNS}
        if not cells["set"]:
            continue
        if cells["date"]:
            try:
                dt.datetime.fromisoformat(cells["date"])
            except ValueError:
                message = f'found "{cells["date"]}", expected a date: 2026-03-01 or 2026-03-01T14:30:00'
                raise InputError(message, file=file, place=f"row {number}, column date") from None
        yield file.parent / cells["set"], cells["robot"], cells["date"]


def open_one(base: Path, folder: Path, robot: str, date: str) -> BatchSet:
    """A set with the hash of its files; with an error if it cannot be opened."""
    try:
        name = folder.relative_to(base).as_posix()
    except ValueError:
        name = str(folder)
    name = name if name != "." else folder.resolve().name
    whose = robot or Path(name).parent.as_posix()
    whose = base.resolve().name if whose == "." else whose
    try:
        found = overview(folder)
    except FlexvizError as error:
        return BatchSet(name, folder.absolute(), whose, error=str(error))
    except OSError as error:
        return BatchSet(name, folder.absolute(), whose, error=f"{folder}: {error.strerror or error}")
    origin = FROM_LIST if date else FROM_FILE if found.date is None else FROM_SET
    if origin == FROM_SET and found.date is not None:
        date = found.date.isoformat()
    elif origin == FROM_FILE:
        date = dt.datetime.fromtimestamp(found.changed).isoformat(timespec="seconds")
    described = found.description
    hashes = found.files.sha256, found.robot, described.sha256
    return BatchSet(name, found.path, whose, date, origin, *hashes)
