"""Parameters of generated code by their names in the templates: kinematic tree, inertia, effects.

Bodies are in Pinocchio's order, parents first. The pose of body b in its parent:

    rotation     STILL + SINE sin q + COSINE cos q   (3, 3), SINE = COSINE = 0 if prismatic
    translation  PLACE + SLIDE q                     (3,) in the parent's frame [m]; SLIDE = 0 if revolute
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array
from flexviz.base.errors import InputError
from flexviz.model.effects import SIGN_VELOCITY
from flexviz.outlets.exporting.coverage import CODE, PerJoint, PerRow
from flexviz.outlets.exporting.identified import IdentifiedRobot
from flexviz.robot._pinocchio import pin
from flexviz.robot.robot import Robot

INDICES = ("joint", "other")  # columns of rows that hold joint indices


@dataclass(frozen=True, eq=False)
class CodeArray:
    """An array of the code, of integers if it holds indices; `meaning` is its comment."""

    values: np.ndarray
    meaning: str = ""


@dataclass(frozen=True, eq=False)
class CodeRows:
    """Effects with several numbers each, one row per effect."""

    rows: list[tuple[float, ...]]
    columns: tuple[str, ...]
    meaning: str


@dataclass(frozen=True, eq=False)
class CodeTables:
    """Arrays and rows by template NAME, and the template sections that this robot needs.

    `effects` maps those sections that belong to one effect to its name.
    """

    arrays: Mapping[str, CodeArray]
    rows: Mapping[str, CodeRows]
    sections: frozenset[str]
    effects: Mapping[str, str]


def code_tables(identified: IdentifiedRobot) -> CodeTables:
    """The tables of an identified robot, payload included; InputError for a joint of another kind."""
    laws = identified.laws
    arrays = _tree(identified.robot)
    gamma = identified.inertial[arrays["JOINT"].values]  # in the order of the bodies
    inertia = gamma[:, [4, 5, 7, 5, 6, 8, 7, 8, 9]]  # xx xy xz, xy yy yz, xz yz zz
    arrays |= {
        "MASS": CodeArray(gamma[:, 0], "mass [kg]"),
        "MOMENT": CodeArray(gamma[:, 1:4], "mass times centre of mass [kg m]"),
        "INERTIA": CodeArray(inertia.reshape(-1, 3, 3), "about the joint's frame [kg m^2]"),
        "GRAVITY": CodeArray(np.array(laws.gravity), "[m/s^2] in the base's frame"),
        "SIGN_VELOCITY": CodeArray(np.array(SIGN_VELOCITY), "[rad/s] sign(v) is tanh(v / SIGN_VELOCITY)"),
        "STIFFNESS": CodeArray(laws["stiffness"], "K [Nm/rad]"),
        "MOTOR_INERTIA": CodeArray(laws["motor_inertia"], "B [kg m^2]"),
        "MOTOR_VISCOUS": CodeArray(laws["motor_viscous"], "f_mv [Nm s/rad]"),
        "LINK_VISCOUS": CodeArray(laws["link_viscous"], "f_lv [Nm s/rad]"),
    }
    rows: dict[str, CodeRows] = {}
    effects: dict[str, str] = {}
    signed = False
    for effect, code in CODE.items():
        if isinstance(code, PerJoint) and (code.always or laws[code.table].any()):
            arrays |= {a.table.upper(): CodeArray(laws[a.table], a.meaning) for a in code.arrays}
            effects |= {} if code.always else {code.table: effect}
            signed |= code.signed
        elif isinstance(code, PerRow) and laws.rows[code.table]:
            columns = (*code.joints, *code.columns.values())
            rows[code.table.upper()] = CodeRows(laws.rows[code.table], columns, code.meaning)
            effects[code.table] = effect
            signed |= code.signed
    sections = {name.lower() for name in (*arrays, *rows)}
    sections |= {"sign"} if signed else set()
    sections |= {"lists"} if rows.keys() - {"ERROR", "COMPENSATOR"} else set()
    sections |= {"undamped"} if "damping" not in sections else set()
    sections |= {"linear"} if "cubic" not in sections else set()
    if not sections & {"sign", "link_coulomb", "coupled"}:
        del arrays["SIGN_VELOCITY"]
    return CodeTables(arrays, rows, frozenset(sections), effects)


def _tree(robot: Robot) -> dict[str, CodeArray]:
    """The kinematic tree."""
    n = robot.n
    still, sine, cosine = np.zeros((3, n, 3, 3))
    place, slide, turn, push = np.zeros((4, n, 3))
    for b in range(n):
        linear, angular = axis(robot, b)
        placement = robot.model.jointPlacements[1 + b]
        rotation = np.array(placement.rotation)
        place[b], turn[b], push[b] = placement.translation, angular, linear
        if angular.any():
            along = np.outer(angular, angular)
            still[b], cosine[b] = rotation @ along, rotation @ (np.eye(3) - along)
            sine[b] = rotation @ pin.skew(angular)
        else:
            still[b], slide[b] = rotation, rotation @ linear
    parents = np.array([int(robot.model.parents[1 + b]) - 1 for b in range(n)])
    return {
        "JOINT": CodeArray(np.argsort(robot.order), "joint that moves each body, parents first"),
        "PARENT": CodeArray(parents, "parent body; -1: the base"),
        "STILL": CodeArray(still, "rotation into the parent's axes: STILL + SINE sin q + COSINE cos q"),
        "SINE": CodeArray(sine),
        "COSINE": CodeArray(cosine),
        "PLACE": CodeArray(place, "origin in the parent's frame: PLACE + SLIDE q [m]"),
        "SLIDE": CodeArray(slide),
        "TURN": CodeArray(turn, "axis of rotation in the body's frame"),
        "PUSH": CodeArray(push, "axis of translation in the body's frame"),
    }


def axis(robot: Robot, b: int) -> tuple[Array, Array]:
    """Axes (3,) of translation and rotation of Pinocchio's joint b; one of them is zero."""
    joint = robot.model.joints[1 + b]
    data = joint.createData()
    joint.calc(data, np.zeros(1))
    s = np.array(data.S, dtype=float).reshape(6)
    linear, angular = s[:3], s[3:]
    if bool(linear.any()) == bool(angular.any()):
        name = robot.model.names[1 + b]
        raise InputError(f'joint "{name}" cannot be exported, expected a revolute or prismatic joint')
    return linear, angular
