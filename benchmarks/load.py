"""How much memory and time loading takes: `python -m benchmarks.load [--hours 1] [--formats parquet,csv]`.

Of a record of 7 joints at 1 kHz, for each kind of table: the seconds, the bytes of the arrays (time, θ, τ as
float64), how far the process's memory peaked above what it held before loading, and the ratio of the two.
Each load runs in a process of its own.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as papq

from benchmarks.command import command
from benchmarks.running import alone, peak_megabytes
from flexviz.data.measurements import read_set

RATE = 1000.0  # [1/s]
JOINTS = [f"panda_joint{i + 1}" for i in range(7)]
KINDS = "parquet,parquet32,jitter,csv"


def write(folder: Path, kind: str, rows: int) -> None:
    """A measurement set with one group; `kind` is parquet, parquet32, csv, or jitter (Parquet)."""
    file = "a.csv" if kind == "csv" else "a.parquet"
    (folder / "measurements.toml").write_text(
        f'format = 1\nrobot = "example-robot-data:panda"\njoints = {JOINTS}\n[payloads.none]\nbodies = []\n'
        f'[[groups]]\nname = "a"\ntrajectory = "a"\npayload = "none"\nfile = "{file}"\n'
    )
    at = np.arange(rows) / RATE
    if kind == "jitter":
        at = at + np.random.default_rng(0).uniform(-1e-4, 1e-4, rows)
    kept = np.float32 if kind == "parquet32" else np.float64
    columns: dict[str, np.ndarray] = {"time": at}
    for i, joint in enumerate(JOINTS):
        columns[f"theta_{joint}"] = np.round(0.5 * np.sin(at * (1 + 0.1 * i)), 7).astype(kept)
        columns[f"tau_{joint}"] = np.round(20 * np.cos(at * (1 + 0.1 * i)), 4).astype(kept)
    if kind == "csv":
        pacsv.write_csv(pa.table(columns), folder / file)
    else:
        papq.write_table(pa.table(columns), folder / file, compression="zstd", use_dictionary=False)


def load(folder: Path) -> str:
    """What loading takes."""
    before, start = peak_megabytes(), time.perf_counter()
    (group,) = read_set(folder).groups
    seconds, extra = time.perf_counter() - start, peak_megabytes() - before
    arrays = sum(s.time.nbytes + s.theta.nbytes + s.tau.nbytes for s in group.segments) / 2**20
    return (
        f"{seconds:6.2f} s   arrays {arrays:7.1f} MB   peak {extra:7.1f} MB   peak/arrays "
        f"{extra / arrays:.2f}   ({len(group.segments)} segment, {group.samples} samples)"
    )


@command
def main(*, hours: float = 1.0, formats: Annotated[str, "kinds of table"] = KINDS) -> None:
    print(f"{hours:g} h × {RATE:g} Hz × {len(JOINTS)} joints")
    for kind in formats.split(","):
        with tempfile.TemporaryDirectory() as folder:
            alone(write, Path(folder), kind, int(hours * 3600 * RATE))
            print(f"{kind:10s} {alone(load, Path(folder))}")


if __name__ == "__main__":
    sys.exit(main())
