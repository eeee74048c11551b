"""Measurement sets from public recordings: `python -m benchmarks.public_robots make --work DIR`.

DIR holds clones of the repositories below; what is absent is skipped. Each becomes DIR/sets/NAME, which
`python -m benchmarks.real DIR/sets` diagnoses. The recordings are converted on the user's machine and are not
part of this project; their authors' terms apply.

| set | repository | licence | torque |
|---|---|---|---|
| panda | marcocognetti/FrankaEmikaPandaDynModel | GPL-3.0 | as recorded, behind the gear |
| ur10e | shamilmamedov/dynamic_calibration | none stated | motor current × the drive gains of its `main.m` |
| tiago | thanhndv212/figaroh-examples | Apache-2.0 | current × gear × constant of its `identification.py` |
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from benchmarks.command import command
from benchmarks.peers.prepare import moving_urdf
from flexviz.data.measurements import GroupTable, write_set

Array = NDArray[np.float64]

FITTED = 2 / 3  # of a single recording; the rest is held out


def _group(name: str, time: Array, theta: Array, tau: Array, held_out: bool = False) -> GroupTable:
    return GroupTable(name, name, "none", time, theta, tau, validation=held_out)


def _split(time: Array, theta: Array, tau: Array) -> list[GroupTable]:
    """The first part of one motion to fit, and the rest to hold out."""
    cut = int(FITTED * len(time))
    return [
        _group("first", time[:cut], theta[:cut], tau[:cut]),
        _group("rest", time[cut:], theta[cut:], tau[cut:], held_out=True),
    ]


@dataclass(frozen=True)
class Source:
    """One robot.

    Attributes:
        repository: folder of the clone.
        robot: path of its URDF in the clone, or a name as measurement sets have it.
        joints: that were recorded.
        read: clone → groups.
    """

    repository: str
    robot: str
    joints: tuple[str, ...]
    read: Callable[[Path], list[GroupTable]]


def _panda(clone: Path) -> list[GroupTable]:
    log = clone / "matlab/data/Exciting_Traj/Trajectory_1/rbt_log"
    time, theta, tau = (
        np.loadtxt(log / f"exciting_traj_{what}.txt") for what in ("time", "positions", "torques")
    )
    return _split(time, theta.reshape(-1, 7), tau.reshape(-1, 7))


UR10E_GAINS = np.array((14.87, 13.26, 11.13, 10.62, 11.03, 11.47))  # [Nm/A]
UR10E_FILES = {
    "identification_data/ur-20_02_12-50sec_12harm.csv": False,
    "identification_data/ur-20_02_10-30sec_12harm.csv": False,
    "validation_data/ur-20_01_17-ptp_10_points.csv": True,
}


def _ur10e(clone: Path) -> list[GroupTable]:
    groups = []
    for name, held_out in UR10E_FILES.items():
        table = np.loadtxt(clone / "dataset_ur10e" / name, delimiter=",", ndmin=2)
        # columns: time, six positions, six velocities, six currents, ...
        time, torque = table[:, 0] - table[0, 0], table[:, 13:19] * UR10E_GAINS
        groups.append(_group(Path(name).stem, time, table[:, 1:7], torque, held_out))
    return groups


TIAGO_GEARS = np.array((100.0, 100.0, 100.0, 100.0, 336.0, 336.0, 336.0))
TIAGO_CONSTANTS = np.array((0.136, 0.136, -0.087, -0.087, -0.0613, -0.0613, -0.0613))  # [Nm/A]


def _tiago(clone: Path) -> list[GroupTable]:
    log = clone / "examples/tiago/data/identification/dynamic"
    positions, currents = (
        np.loadtxt(log / f"tiago_{what}.csv", delimiter=",", skiprows=1) for what in ("position", "effort")
    )
    # columns: time, torso lift, seven joints of the arm
    torque = currents[:, 2:9] * TIAGO_GEARS * TIAGO_CONSTANTS
    return _split(positions[:, 0], positions[:, 2:9], torque)


UR_JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
SOURCES = {
    "panda": Source(
        "FrankaEmikaPandaDynModel",
        "example-robot-data:panda",
        tuple(f"panda_joint{i}" for i in range(1, 8)),
        _panda,
    ),
    "ur10e": Source(
        "dynamic_calibration", "URe/urdf/ur10e.urdf", tuple(f"{j}_joint" for j in UR_JOINTS), _ur10e
    ),
    "tiago": Source(
        "figaroh-examples",
        "examples/tiago/urdf/tiago_no_hand.urdf",
        tuple(f"arm_{i}_joint" for i in range(1, 8)),
        _tiago,
    ),
}


def write(name: str, source: Source, work: Path) -> Path:
    """Convert one robot's recordings to a measurement set and return its folder."""
    clone, robot, files = work / source.repository, source.robot, {}
    if robot.endswith(".urdf"):
        urdf = (clone / robot).read_text(encoding="utf-8")
        robot, files = "robot.urdf", {"robot.urdf": moving_urdf(urdf, source.joints)}
    return write_set(
        work / "sets" / name, robot=robot, joints=source.joints, groups=source.read(clone),
        payloads={"none": ()}, files=files, overwrite=True,
    )  # fmt: skip


@command
def main(what: Literal["make"], *, work: Annotated[Path, "folder of the clones"]) -> None:
    for name, source in SOURCES.items():
        if (work / source.repository).is_dir():
            print(write(name, source, work))
        else:
            print(f"{name}: skipped, {work / source.repository} is not there")


if __name__ == "__main__":
    sys.exit(main())
