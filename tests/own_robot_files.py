"""A stranger's files, made by the independent simulator: a URDF, and a CSV per run in ms, degrees and mA."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from independent.arms import Body, urdf_text
from independent.cases import draw

GEARS, CONSTANTS = (100.0, 80.0), (0.11, 0.09)  # of the motors, [Nm/A]
RUNS = {"bare.csv": 0, "loaded.csv": 1}  # file -> run of the case


@dataclass(frozen=True)
class Stranger:
    """The files, and what is true of them."""

    urdf: Path
    logs: tuple[Path, ...]
    payload: Body  # of loaded.csv, on the last link
    amplitude: float  # [Nm] of the ripple on joint2


def write_files(folder: Path) -> Stranger:
    """Write the files of an arm with torque ripple on joint2; the names of the currents state no unit."""
    case = draw(3, "torque_ripple", "2r", joint=1, noise=1.0, duration=6.0)
    urdf = folder / "my arm.urdf"
    urdf.write_text(urdf_text(case.drawn))
    for name, run in RUNS.items():
        columns = {"time_ms": 1e3 * case.record.time}
        for j, (gear, constant) in enumerate(zip(GEARS, CONSTANTS, strict=True)):
            columns[f"pos_{j + 1}_deg"] = np.degrees(case.record.theta[run, :, j])
            columns[f"current_{j + 1}"] = 1e3 * case.record.tau[run, :, j] / gear / constant
        rows = np.stack(list(columns.values()), axis=1)
        np.savetxt(folder / name, rows, "%.9g", ",", header=",".join(columns), comments="")
    (body,) = case.setup.payloads[1]
    amplitude = float(case.truth["effects"][0]["parameters"]["amplitude"])
    return Stranger(urdf, tuple(folder / name for name in RUNS), body, amplitude)
