"""Text files as a power cut, a copy or a logger has left them: what is whole is read, the rest is named.

Each file is written from known numbers; what is read of it is compared with them.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from flexviz.base.errors import InputError
from flexviz.data.logs.formats import open_log
from flexviz.data.logs.formats.base import Log, ReadOptions
from flexviz.data.measurements.tables import read_columns

NAMES = ["time", "theta_1", "theta_2", "tau_1", "tau_2"]
TIME = 0.004 * np.arange(3000)
TRUTH = np.column_stack([TIME, np.sin(TIME), np.cos(TIME), 5 * np.sin(3 * TIME), 3 * np.cos(2 * TIME)])
WIDE = ["utf-16", "utf-16-le", "utf-16-be", "utf-32"]


def lines(separator: str = ",", end: str = "", of_header: str = "", form: str = "%.9g") -> list[str]:
    rows = (separator.join(form % value for value in row) + end for row in TRUTH)
    return [separator.join(NAMES) + of_header, *rows]


def text(**form: str) -> bytes:
    return "\n".join([*lines(**form), ""]).encode()


def read(file: Path, content: bytes) -> Log:
    file.write_bytes(content)
    return open_log(file, ReadOptions())


def is_right(log: Log, rows: int = len(TRUTH)) -> bool:
    (table,) = log.tables
    return table.rows == rows and all(
        np.allclose(table.columns[name], TRUTH[:rows, k], rtol=1e-8, atol=1e-8)
        for k, name in enumerate(NAMES)
    )


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
@pytest.mark.parametrize(("of_header", "of_rows"), [(0, 1), (0, 2), (1, 1), (1, 2), (2, 1), (2, 2), (2, 0)])
def test_rows_that_end_with_separators(tmp_path: Path, separator: str, of_header: int, of_rows: int) -> None:
    content = text(separator=separator, end=of_rows * separator, of_header=of_header * separator)
    log = read(tmp_path / "log.csv", content)
    assert is_right(log) and set(log.columns) == set(NAMES) and not log.unusable
    assert len(log.notes) == (separator != " " and of_rows > 0)


@pytest.mark.parametrize("every", [2, 700, 2999])
def test_some_rows_end_with_a_separator(tmp_path: Path, every: int) -> None:
    rows = [row + "," * (k % every == every - 1) for k, row in enumerate(lines())]
    assert is_right(read(tmp_path / "log.csv", "\n".join([*rows, ""]).encode()))


@pytest.mark.parametrize("at", [500, 5000, 70_000, 120_000])
@pytest.mark.parametrize("encoding", ["utf-8", *WIDE])
def test_a_gap_of_zeros(tmp_path: Path, at: int, encoding: str) -> None:
    whole = text().decode().encode(encoding)
    at *= {"utf-8": 1, "utf-32": 4}.get(encoding, 2)
    content = whole[:at] + bytes(4096) + whole[at + 4096 :]
    row = len(whole[:at].decode(encoding, "ignore").split("\n")) - 1
    with pytest.raises(InputError, match="zeros, as after a power cut, expected text: delete it") as raised:
        read(tmp_path / "log.csv", content)
    assert raised.value.place == f"row {row} (line {row + 1})"
    keep = [k for k in range(len(TRUTH) + 1) if k != row]
    (tmp_path / "log.csv").write_bytes(content)
    left = content.decode(encoding).split("\n")
    log = read(tmp_path / "log.csv", "\n".join([*left[:row], *left[row + 1 :]]).encode(encoding))
    assert log.tables[0].rows < len(keep) and np.isin(log.tables[0].columns["time"], np.round(TIME, 9)).all()


@pytest.mark.parametrize("cut", [2, 5, 9, 12, 30, 40])
@pytest.mark.parametrize("zeros", [0, 1, 4096, 100_000])
@pytest.mark.parametrize("form", ["%.9g", "%.6f", "%.17g"])
def test_a_cut_last_row_is_left_out(tmp_path: Path, cut: int, zeros: int, form: str) -> None:
    if form == "%.6f" and cut > 30:
        pytest.skip("the row has fewer characters")
    log = read(tmp_path / "log.csv", text(form=form)[: -1 - cut] + bytes(zeros))
    kept = log.tables[0].rows
    assert (kept == len(TRUTH) - 1 and "cut off" in log.notes[0]) or "line before" in log.notes[0]
    assert all(np.allclose(log.tables[0].columns[n], TRUTH[:kept, k], atol=1e-6) for k, n in enumerate(NAMES))


@pytest.mark.parametrize("form", ["%.9g", "%.6f", "%.17g", "%.3e"])
def test_a_last_row_without_an_end_of_line_is_whole(tmp_path: Path, form: str) -> None:
    log = read(tmp_path / "log.csv", text(form=form)[:-1])
    assert log.tables[0].rows == len(TRUTH) and not log.notes


@pytest.mark.parametrize("encoding", WIDE)
@pytest.mark.parametrize("change", ["whole", "half a character", "half a zero", "zeros", "one byte more"])
def test_odd_encodings(tmp_path: Path, encoding: str, change: str) -> None:
    whole = text(separator="\t").decode().encode(encoding)
    size = len(" ".encode(encoding)) // (2 if encoding in ("utf-16", "utf-32") else 1)
    if change == "one byte more":
        with pytest.raises(InputError, match=r"row \d+ \(line \d+\).*found bytes that are no text"):
            read(tmp_path / "log.csv", whole[: size * 50_000] + b"x" + whole[size * 50_000 :])
        return
    changed = {
        "whole": whole,
        "half a character": whole[: -size - 1],
        "half a zero": whole + b"\0",
        "zeros": whole + bytes(4096),
    }
    log = read(tmp_path / "log.csv", changed[change])
    assert is_right(log, len(TRUTH) - (change == "half a character")) and bool(log.notes) == (
        change != "whole"
    )


WRONG = {
    "short": (
        lambda row: row[:20],
        "found 3 values for 5 columns, expected one per column",
    ),
    "long": (lambda row: row + ",7", "found 6 values for 5 columns"),
    "two in one": (lambda row: row[:20] + row, "found 7 values for 5 columns"),
    "the header": (lambda row: ",".join(NAMES), "found the header again, expected one run per file"),
    "no text": (lambda row: row[:20] + "\udcff" + row[21:], "found bytes that are no text"),
}


@pytest.mark.parametrize("name", WRONG)
@pytest.mark.parametrize("row", [1500, 2900])
def test_the_first_damaged_row_is_named(tmp_path: Path, name: str, row: int) -> None:
    damage, expected = WRONG[name]
    rows = lines()
    rows[row], rows[row + 20] = damage(rows[row]), damage(rows[row])
    with pytest.raises(InputError, match=expected) as raised:
        read(tmp_path / "log.csv", "\n".join([*rows, ""]).encode("utf-8", "surrogateescape"))
    assert raised.value.place == f"row {row} (line {row + 1})" and "(and 1 more like it)" in str(raised.value)


def test_text_in_a_column_of_numbers_is_named(tmp_path: Path) -> None:
    rows = lines()
    rows[1500] = rows[1500][:-4] + "ERR"
    log = read(tmp_path / "log.csv", "\n".join([*rows, ""]).encode())
    assert set(log.unusable) == {"tau_2"}
    assert log.unusable["tau_2"] == 'row 1500 (line 1501) holds "2.5186ERR", expected a number'


def test_a_set_names_its_first_damaged_row(tmp_path: Path) -> None:
    rows = lines()
    rows[1500] = rows[1500][:20]
    (tmp_path / "a.csv").write_text("\n".join([*rows, ""]))
    with pytest.raises(
        InputError, match=r"row 1500 \(line 1501\): found 3 values for 5 columns.*complete or"
    ):
        read_columns(tmp_path / "a.csv", NAMES)


@pytest.mark.parametrize("zeros", [0, 4096])
def test_lines_of_json(tmp_path: Path, zeros: int) -> None:
    records = [json.dumps(dict(zip(NAMES, row, strict=True))) for row in TRUTH.tolist()]
    whole = "\n".join([*records, ""]).encode()
    assert is_right(read(tmp_path / "log.jsonl", whole))
    log = read(tmp_path / "log.jsonl", whole[:-30] + bytes(zeros))
    assert is_right(log, len(TRUTH) - 1) and len(log.notes) == 1
    with pytest.raises(InputError, match=r"row 11 \(line 11\).*expected one JSON record per line"):
        read(tmp_path / "log.jsonl", "\n".join([*records[:10], records[10][:20], *records[11:]]).encode())


@pytest.mark.parametrize("zeros", [0, 4096])
def test_frames(tmp_path: Path, zeros: int) -> None:
    frames = [
        f'<Rob Type="KUKA"><AIPos A1="{a:.6f}" A2="{b:.6f}"/><IPOC>{k * 4}</IPOC></Rob>\n'
        for k, (_, a, b, *_) in enumerate(TRUTH)
    ]
    log = read(tmp_path / "log.xml", "".join(frames)[:-30].encode() + bytes(zeros))
    assert log.tables[0].rows == len(TRUTH) - 1 and len(log.notes) == 1
    assert np.allclose(log.tables[0].columns["AIPos.A2"], TRUTH[:-1, 2], atol=1e-6)
    with pytest.raises(InputError, match="found 2 beginnings of a frame") as raised:
        read(tmp_path / "log.xml", "".join([*frames[:10], frames[10][:30], *frames[11:]]).encode())
    assert raised.value.place == "frame 11"
