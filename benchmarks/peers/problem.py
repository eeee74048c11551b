"""A measurement set as every method reads it: a URDF, a JSON file and one NumPy file per group.

Needs NumPy only: a method may run in an interpreter of its own that has no flexviz.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
COULOMB = "coulomb_friction"
OFFSET = "torque_offset"
FILE = "problem.json"


@dataclass(frozen=True, eq=False)
class Group:
    """One trajectory run with one known payload; n joints, N samples.

    Attributes:
        name, validation: validation groups are never fitted.
        payload: (n, 10) what the payload adds to the inertial parameters.
        time: (N,) [s].
        theta, tau: (N, n) motor angle [rad] and torque [Nm].
        reference: (N, n) commanded angle [rad], or None.
    """

    name: str
    validation: bool
    payload: Array
    time: Array
    theta: Array
    tau: Array
    reference: Array | None

    @property
    def step(self) -> float:
        """[s]"""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))


@dataclass(frozen=True, eq=False)
class Problem:
    """One set.

    Attributes:
        folder: of the measurement set that flexviz reads.
        urdf: the robot with its n moving joints, nothing to draw.
        joints, links: names of the joints and of the links that they move.
        hold: a torque is sampled at the start of a hold of this length [s].
        stiffness, motor_inertia: (n,) rough start values [Nm/rad], [kg m²].
        kp, kd: (n,) the controller's gains, or None.
        effects: friction terms that every method is told of, on every joint.
        inertial: (n, 10) the URDF's inertial parameters, in the order of `INERTIAL_NAMES`.
        groups: all of them.
    """

    folder: Path
    urdf: Path
    joints: tuple[str, ...]
    links: tuple[str, ...]
    hold: float
    stiffness: Array
    motor_inertia: Array
    kp: Array | None
    kd: Array | None
    effects: tuple[str, ...]
    inertial: Array
    groups: tuple[Group, ...]

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def fitted(self) -> tuple[Group, ...]:
        """The groups that are not held out."""
        return tuple(group for group in self.groups if not group.validation)


def read(folder: Path) -> Problem:
    """What `prepare.write` has written."""
    given: dict[str, Any] = json.loads((folder / FILE).read_text(encoding="utf-8"))

    def array(name: str) -> Any:
        return None if given[name] is None else np.array(given[name])

    groups = []
    for entry in given["groups"]:
        with np.load(folder / f"{entry['name']}.npz", allow_pickle=False) as table:
            reference = table.get("reference", None)
            signals = table["time"], table["theta"], table["tau"], reference
        payload = np.array(entry["payload"])
        groups.append(Group(entry["name"], entry["validation"], payload, *signals))
    return Problem(
        folder=Path(given["folder"]),
        urdf=folder / "robot.urdf",
        joints=tuple(given["joints"]),
        links=tuple(given["links"]),
        hold=given["hold"],
        stiffness=array("stiffness"),
        motor_inertia=array("motor_inertia"),
        kp=array("kp"),
        kd=array("kd"),
        effects=tuple(given["effects"]),
        inertial=array("inertial"),
        groups=tuple(groups),
    )


def answer(
    problem: Problem,
    *,
    stiffness: Array | None,
    motor_inertia: Array,
    viscous: tuple[Array, Array],
    inertial: Array,
    coulomb: Array | None = None,
    offset: Array | None = None,
    evaluations: int,
    converged: bool = True,
) -> dict[str, Any]:
    """What a method returns. `stiffness` None: rigid, with B where it does not show apart from the links.

    `viscous` is (link, motor); the side of a rigid method's friction has no meaning. `evaluations` counts
    passes of the model over all fitted data, one per column of a finite-difference Jacobian.
    """
    effects = [
        {"effect": name, "joint": joint, "parameters": {key: float(value[i])}}
        for name, key, value in ((COULOMB, "coulomb", coulomb), (OFFSET, "offset", offset))
        if value is not None
        for i, joint in enumerate(problem.joints)
    ]
    return {
        "stiffness": None if stiffness is None else np.asarray(stiffness).tolist(),
        "motor_inertia": np.asarray(motor_inertia).tolist(),
        "link_viscous_friction": np.asarray(viscous[0]).tolist(),
        "motor_viscous_friction": np.asarray(viscous[1]).tolist(),
        "inertial": np.asarray(inertial).tolist(),
        "effects": effects,
        "evaluations": int(evaluations),
        "converged": bool(converged),
    }
