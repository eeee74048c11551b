"""How much memory and time loading takes: 1 h × 1 kHz × 7 joints.

    python benchmarks/load.py [--hours 1] [--joints 7] [--formats parquet,csv]

Prints, for each kind of table, the seconds, the bytes of the arrays (time, θ, τ as float64), how far the
process's memory peaked above what it held before loading, and the ratio of the two. Each load runs in a
process of its own.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as papq

RATE = 1000.0  # [1/s]

URDF_LINK = """
  <link name="link{i}"><inertial><mass value="1"/><origin xyz="0.1 0 0"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="joint{i}" type="revolute"><origin xyz="0.2 0 0"/><axis xyz="0 1 0"/>
    <parent link="{parent}"/><child link="link{i}"/>
    <limit lower="-3" upper="3" effort="1000" velocity="10"/></joint>"""

CHILD = """
import resource, sys, time
import flexviz.measurements.reading, flexviz.robot, pinocchio, pyarrow.csv, pyarrow.parquet
from flexviz import read_set

def peak():
    for line in open("/proc/self/status"):
        if line.startswith("VmHWM"):
            return int(line.split()[1]) * 1024

before, start = peak(), time.perf_counter()
group = read_set(sys.argv[1]).groups[0]
seconds = time.perf_counter() - start
arrays = sum(s.time.nbytes + s.theta.nbytes + s.tau.nbytes for s in group.segments)
print(seconds, arrays, peak() - before, len(group.segments), group.samples)
"""


def write(folder: Path, kind: str, rows: int, joints: int) -> None:
    """A measurement set with one group; `kind` is parquet, parquet32, csv, or jitter (Parquet)."""
    names = ["base", *(f"link{i + 1}" for i in range(joints))]
    links = "".join(URDF_LINK.format(i=i + 1, parent=names[i]) for i in range(joints))
    (folder / "robot.urdf").write_text(f'<robot name="chain"><link name="base"/>{links}\n</robot>\n')
    file = "a.csv" if kind == "csv" else "a.parquet"
    listed = ", ".join(f'"joint{i + 1}"' for i in range(joints))
    (folder / "measurements.toml").write_text(
        f'format = 1\nrobot = "robot.urdf"\njoints = [{listed}]\n[payloads.none]\nbodies = []\n'
        f'[[groups]]\nname = "a"\ntrajectory = "a"\npayload = "none"\nfile = "{file}"\n'
    )
    rng = np.random.default_rng(0)
    time = np.arange(rows) / RATE
    if kind == "jitter":
        time = time + rng.uniform(-1e-4, 1e-4, rows)
    kept = np.float32 if kind == "parquet32" else np.float64
    columns: dict[str, np.ndarray] = {"time": time}
    for i in range(joints):
        columns[f"theta_joint{i + 1}"] = np.round(0.5 * np.sin(time * (1 + 0.1 * i)), 7).astype(kept)
        columns[f"tau_joint{i + 1}"] = np.round(20 * np.cos(time * (1 + 0.1 * i)), 4).astype(kept)
    table = pa.table(columns)
    if kind == "csv":
        pacsv.write_csv(table, folder / file)
    else:
        papq.write_table(table, folder / file, compression="zstd", use_dictionary=False)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--joints", type=int, default=7)
    parser.add_argument("--formats", default="parquet,parquet32,jitter,csv")
    options = parser.parse_args()
    rows = int(options.hours * 3600 * RATE)
    print(f"{options.hours:g} h × {RATE:g} Hz × {options.joints} joints: {rows} rows")
    for kind in options.formats.split(","):
        with tempfile.TemporaryDirectory() as folder:
            write(Path(folder), kind, rows, options.joints)
            result = subprocess.run(
                [sys.executable, "-c", CHILD, folder], capture_output=True, text=True, check=True
            )
        seconds, arrays, extra, segments, samples = (float(word) for word in result.stdout.split())
        print(
            f"{kind:10s} {seconds:6.2f} s   arrays {arrays / 1e6:7.1f} MB   peak {extra / 1e6:7.1f} MB"
            f"   peak/arrays {extra / arrays:.2f}   ({segments:g} segment, {samples:g} samples)"
        )


if __name__ == "__main__":
    main()
