"""Small files that stand for much memory are refused before they are read."""

from __future__ import annotations

import io
import json
import resource
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as papq
import pytest
from scipy.io import savemat

from flexviz.base import files, limits, toml
from flexviz.base.errors import InputError
from flexviz.data.logs.formats import ReadOptions, find_logs, matlab, open_log
from flexviz.data.measurements import read_set
from flexviz.outlets.terminal.terminal import write_json
from tests.small_set import write_small_set


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("a." * 20_000 + "a = 1", "line 1: a key of more than 32 parts"),
        ("\n[" + "a." * 20_000 + "a]", "line 2: a key of more than 32 parts"),
        ("x = {" + '"a" . ' * 20_000 + "a = 1}", "a key of more than 32 parts"),
        ("n = " + "9" * 5000, "4300 digits"),
        ("x = " + "[" * 100_000, "nested too deeply"),
        ("#" * 5_000_000, "expected a TOML file of at most"),
    ],
)
def test_toml(text: str, why: str, tmp_path: Path) -> None:
    file = tmp_path / "x.toml"
    file.write_text(text)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError, match=why):
        toml.read(file)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000  # [kB]


def test_dots_elsewhere_are_no_key(tmp_path: Path) -> None:
    file = tmp_path / "x.toml"
    file.write_text('a.b.c = "' + "two words. " * 100 + '..."\nx = [' + "1.5, " * 100 + "]\n# " + "." * 100)
    assert len(toml.read(file)["x"]) == 100


def test_tables_with_too_many_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_small_set(tmp_path)
    monkeypatch.setattr(limits, "LARGEST_NUMBERS", 9_000)
    with pytest.raises(InputError, match=r"a\.csv: 12,012 numbers, expected at most 9,000"):
        read_set(folder)
    papq.write_table(pa.table({"x": [[1.0] * 100] * 100}), folder / "lists.parquet")
    with pytest.raises(InputError, match=r"lists\.parquet: 10,000 numbers"):
        open_log(folder / "lists.parquet", ReadOptions())
    both = pa.table({"x": [[1.0] * 100] * 100, "x2": range(100), "text": ["no number"] * 100})
    papq.write_table(both, folder / "lists.parquet")
    few = ReadOptions(wanted={"x2"})
    assert list(open_log(folder / "lists.parquet", few).columns) == ["x2"]


def test_a_damaged_table_does_not_end_the_process() -> None:
    """Its footer contradicts itself, which pyarrow notices in a place where it cannot raise."""
    with pytest.raises(InputError, match=r"damaged\.parquet: not a readable Parquet table"):
        open_log(Path(__file__).parents[1] / "fixtures" / "damaged.parquet", ReadOptions())


def test_endless_datasets(tmp_path: Path) -> None:
    about = {"codebase_version": "v2.1", "fps": 10, "features": {}, "total_episodes": 10**30}
    (tmp_path / "set" / "meta").mkdir(parents=True)
    (tmp_path / "set" / "meta" / "info.json").write_text(json.dumps(about))
    with pytest.raises(InputError, match="the number of episodes, at most"):
        find_logs([tmp_path / "set"])


def test_compressed_arrays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    header = io.BytesIO()
    about = {"descr": "<f8", "fortran_order": False, "shape": (10**12,)}
    np.lib.format.write_array_header_1_0(header, about)
    with zipfile.ZipFile(tmp_path / "x.npz", "w") as archive:
        archive.writestr("a0.npy", header.getvalue())
    with pytest.raises(InputError, match=r"a0\.npy: its array of shape \(1000000000000,\) does not fit"):
        open_log(tmp_path / "x.npz", ReadOptions())
    savemat(tmp_path / "x.mat", {"x": np.zeros((1000, 2)), "t": np.arange(1000.0)}, do_compression=True)
    assert len(open_log(tmp_path / "x.mat", ReadOptions()).columns) == 3
    monkeypatch.setattr(matlab, "LARGEST_MAT", 20_000)
    with pytest.raises(InputError, match="over 20,000 bytes unpacked"):
        open_log(tmp_path / "x.mat", ReadOptions())


def test_a_full_disk_names_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full)
    with pytest.raises(InputError, match=r"r\.json: cannot be written \(No space left on device\)"):
        write_json(tmp_path / "r.json", {})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("text", ["[" * 100_000, '{"a":' * 500 + "1" + "}" * 500, "9" * 5000, "\x00"])
def test_json(text: str, tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text(text)
    with pytest.raises(InputError, match=r"x\.json"):
        open_log(tmp_path / "x.json", ReadOptions())
