"""Text tables as loggers, spreadsheets and crashed file systems leave them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexviz.base.errors import InputError
from flexviz.data.logs.formats import open_log
from flexviz.data.logs.formats.base import Log, ReadOptions

NAMES = ["time", "theta_1", "tau_1"]
SEPARATORS = pytest.mark.parametrize("separator", [",", ";", "\t"])
COUNT = 5000  # rows: more than the part from which the layout is found


def written(
    file: Path, content: str | bytes, encoding: str = "utf-8", wanted: list[str] | None = None
) -> Log:
    file.write_bytes(content if isinstance(content, bytes) else content.encode(encoding))
    return open_log(file, ReadOptions(wanted=wanted))


def cells(count: int = COUNT) -> list[list[str]]:
    time = 0.01 * np.arange(count)
    return [[f"{t:.2f}", f"{np.sin(t):.6f}", f"{3 * np.cos(t):.4f}"] for t in time]


def text(separator: str, before: list[str], rows: list[list[str]]) -> str:
    return "\n".join(separator.join(row) for row in (before, *rows)) + "\n"


def is_right(log: Log, count: int = COUNT) -> bool:
    columns, (table,) = log.columns, log.tables
    at = 0.01 * np.arange(count)
    right = set(NAMES) <= set(columns) and table.rows == count
    return right and np.allclose(table.columns["theta_1"], np.sin(at), atol=1e-6)


@SEPARATORS
@pytest.mark.parametrize("of_header", [False, True])
def test_rows_that_end_with_a_separator(tmp_path: Path, separator: str, of_header: bool) -> None:
    header = [*NAMES, ""] if of_header else NAMES
    log = written(tmp_path / "log.csv", text(separator, header, [[*row, ""] for row in cells()]))
    assert is_right(log) and set(log.columns) == set(NAMES)
    assert log.notes == ("each row ends with a separator: the empty field after it is left out",)
    some = written(
        tmp_path / "log.csv", text(separator, header, [[*row, ""] for row in cells()]), wanted=["tau_1"]
    )
    assert set(some.columns) == {"tau_1"} and set(some.unread) == {"time", "theta_1"}


@SEPARATORS
def test_a_header_that_ends_with_a_separator(tmp_path: Path, separator: str) -> None:
    log = written(tmp_path / "log.csv", text(separator, [*NAMES, ""], cells()))
    assert is_right(log) and not log.notes


@SEPARATORS
@pytest.mark.parametrize("names", ["numbers", "words"])
def test_row_names_without_a_name(tmp_path: Path, separator: str, names: str) -> None:
    rows = [[f"r{k}" if names == "words" else str(k), *row] for k, row in enumerate(cells())]
    log = written(tmp_path / "log.csv", text(separator, NAMES, rows))
    assert is_right(log) and not log.notes
    if names == "numbers":  # the last column is filled in some rows only
        for row in rows[:-7]:
            row[-1] = ""
        assert is_right(written(tmp_path / "log.csv", text(separator, NAMES, rows)))
        some = written(tmp_path / "log.csv", text(separator, NAMES, rows), wanted=["theta_1"])
        assert set(some.columns) == {"theta_1"}


@SEPARATORS
def test_a_last_field_that_is_filled_in_some_rows_has_no_name(tmp_path: Path, separator: str) -> None:
    rows = [[*row, ""] for row in cells()]
    rows[4000][-1] = "31"
    with pytest.raises(InputError, match=r"3 names for 4 columns.* row 4001 \(line 4002\)") as raised:
        written(tmp_path / "log.csv", text(separator, NAMES, rows))
    assert raised.value.place == "header"
    log = written(tmp_path / "log.csv", text(separator, [*NAMES, ""], rows))
    assert is_right(log) and np.nansum(log.columns["column4"].columns["column4"]) == 31


@SEPARATORS
@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig", "utf-8", "cp1252"])
def test_encodings(tmp_path: Path, separator: str, encoding: str) -> None:
    log = written(tmp_path / "log.csv", text(separator, [*NAMES[:2], "tau_1"], cells()), encoding)
    assert is_right(log) and not log.notes


def test_utf_16_with_spaces_or_a_line_that_is_cut_off(tmp_path: Path) -> None:
    assert is_right(written(tmp_path / "log.txt", text(" ", NAMES, cells()), "utf-16"))
    cut = written(tmp_path / "log.csv", text(",", NAMES, cells()) + "50.00,0.4", "utf-16")
    assert is_right(cut) and cut.notes == ("the last line is cut off (2 values for 3 columns) and left out",)


@pytest.mark.parametrize("zeros", [1, 4096, 300_000])
@pytest.mark.parametrize("count", [100, COUNT])
def test_zeros_after_a_power_cut(tmp_path: Path, zeros: int, count: int) -> None:
    whole = text(",", NAMES, cells(count))
    log = written(tmp_path / "log.csv", whole.encode() + bytes(zeros))
    assert is_right(log, count) and f"the file ends with {zeros} zeros" in log.notes[0]
    log = written(tmp_path / "log.csv", whole.encode() + b"50.00,0.4" + bytes(zeros))
    assert is_right(log, count) and "and the line before them (2 values for 3" in log.notes[0]


def test_zeros_between_rows_are_named(tmp_path: Path) -> None:
    whole = text(",", NAMES, cells(60)).encode()
    with pytest.raises(InputError, match="zero") as raised:
        written(tmp_path / "log.csv", whole + bytes(100) + b"\n" + whole.split(b"\n", 1)[1])
    assert raised.value.place == "row 61 (line 62)"
    with pytest.raises(InputError, match="no rows of numbers"):
        written(tmp_path / "log.csv", bytes(5000))
