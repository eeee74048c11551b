"""The numbers of generated code: a robot's tables and laws by the names that the templates use."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import SIGN_VELOCITY
from flexviz.exporting.coverage import EXPORTS, PerJoint, PerRow
from flexviz.exporting.kinematics import tree
from flexviz.exporting.subject import Subject

Array = NDArray[np.float64]

INTEGERS = ("joint", "other")


@dataclass(frozen=True, eq=False)
class Numbers:
    """Everything that the templates name.

    Attributes
    ----------
    arrays: NAME -> (values, meaning); integers where they are indices.
    rows: NAME -> (rows, names of a row's numbers, meaning).
    sections: the parts of the templates that this robot needs.
    """

    arrays: Mapping[str, tuple[Any, str]]
    rows: Mapping[str, tuple[list[tuple[float, ...]], tuple[str, ...], str]]
    sections: frozenset[str]


def numbers(subject: Subject) -> Numbers:
    """The numbers of what is exported, the payload among the inertial parameters."""
    robot, laws = subject.robot, subject.laws
    tables = tree(robot)
    gamma = subject.inertial[list(tables.joint)]  # in the order of the bodies
    arrays: dict[str, tuple[Any, str]] = {
        "JOINT": (np.array(tables.joint), "joint that moves each body, parents first"),
        "PARENT": (np.array(tables.parent), "body that it hangs on; -1: the base"),
        "STILL": (tables.still, "rotation into the parent's axes: STILL + SINE sin q + COSINE cos q"),
        "SINE": (tables.sine, ""),
        "COSINE": (tables.cosine, ""),
        "PLACE": (tables.place, "origin in the parent's frame: PLACE + SLIDE q [m]"),
        "SLIDE": (tables.slide, ""),
        "TURN": (tables.turn, "axis that the joint turns about, in the body's frame"),
        "PUSH": (tables.push, "axis that it slides along"),
        "MASS": (gamma[:, 0], "mass [kg]"),
        "MOMENT": (gamma[:, 1:4], "mass times centre of mass [kg m]"),
        "INERTIA": (inertia_matrices(gamma), "about the joint's frame [kg m^2]"),
        "GRAVITY": (np.array(laws.gravity), "[m/s^2] in the base's frame"),
        "SIGN_VELOCITY": (SIGN_VELOCITY, "[rad/s] sign(v) is tanh(v / SIGN_VELOCITY)"),
        "STIFFNESS": (laws["stiffness"], "K [Nm/rad]"),
        "MOTOR_INERTIA": (laws["motor_inertia"], "B [kg m^2]"),
        "MOTOR_VISCOUS": (laws["motor_viscous"], "f_mv [Nm s/rad]"),
        "LINK_VISCOUS": (laws["link_viscous"], "f_lv [Nm s/rad]"),
        "TORQUE_DELAY": (laws["delay"], "how much later than commanded each torque acts [s]"),
    }
    codes = [export.code for export in EXPORTS.values()]
    sections: set[str] = set()
    rows: dict[str, Any] = {}
    for code in codes:
        if isinstance(code, PerJoint) and code.table != "delay" and laws[code.table].any():
            sections.add(code.table)
            arrays[code.table.upper()] = (laws[code.table], code.meaning)
        elif isinstance(code, PerRow) and laws.rows[code.table]:
            sections.add(code.table)
            columns = (*code.joints, *code.columns.values())
            rows[code.table.upper()] = (laws.rows[code.table], columns, code.meaning)
    if "spring" in sections:
        arrays["SPRING_TORQUE"] = (laws["spring_torque"], "its torque at q = 0, turned round [Nm]")
    sections |= {"sign"} if sections & {"motor_coulomb", "load", "stribeck", "presliding"} else set()
    sections |= {"lists"} if set(rows) - {"ERROR"} else set()
    sections |= {"undamped"} if "damping" not in sections else set()
    sections |= {"linear"} if "cubic" not in sections else set()
    if not sections & {"sign", "link_coulomb"}:
        del arrays["SIGN_VELOCITY"]
    return Numbers(arrays, rows, frozenset(sections))


def inertia_matrices(gamma: Array) -> Array:
    """(n, 3, 3) inertia about the joint's frame of parameters (n, 10) [kg m²]."""
    xx, xy, yy, xz, yz, zz = gamma[:, 4:].T
    return np.stack((xx, xy, xz, xy, yy, yz, xz, yz, zz), axis=1).reshape(-1, 3, 3)
