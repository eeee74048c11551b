"""A robot whose joints follow goals, for simulators: MuJoCo, Isaac Lab, BAM.

The goal is the input of every joint. What a format cannot say is listed in it, and returned.
"""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from math import ceil
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from flexviz.base.statistics import NORMAL_95
from flexviz.model.effects import EFFECTS
from flexviz.outlets.exporting.code_tables import axis
from flexviz.outlets.exporting.identified import FormatFiles, IdentifiedRobot
from flexviz.outlets.exporting.mjcf import _add, _dry_friction, _frame, _inertial
from flexviz.outlets.exporting.xml_text import comment_text
from flexviz.robot._pinocchio import pin

STEP = 0.001  # [s]
MJCF = (  # effects that MuJoCo's joints and position actuators have
    "position_control", "coulomb_friction", "quadratic_friction", "torque_offset", "cable_spring",
    "torque_limit", "goal_delay", "goal_lag",
)  # fmt: skip
ISAAC = ("position_control", "coulomb_friction", "torque_limit", "goal_delay")
BAM = ("coulomb_friction", "load_dependent_friction", "driving_friction", "stribeck_friction")
BEFORE = {  # what can be done to the goals before they are sent
    "goal_speed_limit": "send goals that approach theirs at this speed at most",
    "goal_lag": "send goals through a low-pass of this time constant",
    "goal_delay": "send goals later by this time",
    "dead_band": "send the joint's own position where the goal is nearer than this",
}


class Joint:
    """The identified values of one joint."""

    def __init__(self, identified: IdentifiedRobot, i: int) -> None:
        self.name, model = identified.joints[i], identified.model
        self.armature, self.viscous = model.motor_inertia[i], model.motor_viscous_friction[i]
        self.effects = {e.effect: e.parameters for e in model.effects if e.joint in (None, self.name)}
        self.document = identified.document

    def value(self, effect: str, parameter: str) -> float:
        """Of an effect that it has; else 0."""
        return float(self.effects.get(effect, {}).get(parameter, 0.0))

    def half_width(self, name: str) -> float | None:
        """Of the 95 % interval of a parameter; None where it is not known."""
        std = self.document[name, self.name].std
        return None if not np.isfinite(std) else float(NORMAL_95 * std)


def left_out(joints: list[Joint], known: tuple[str, ...]) -> list[str]:
    """Lines on what a format cannot say of each joint."""
    lines = []
    for joint in joints:
        for effect, parameters in joint.effects.items():
            if effect in known:
                continue
            units = EFFECTS[effect].units
            values = ", ".join(f"{name} {value:.4g} {units[name]}" for name, value in parameters.items())
            remedy = f"; {BEFORE[effect]}" if effect in BEFORE else ""
            lines.append(f"{effect}:{joint.name} ({values}){remedy}")
    return lines


def joints_of(identified: IdentifiedRobot) -> list[Joint]:
    """All joints."""
    return [Joint(identified, i) for i in range(len(identified.joints))]


def servo_mjcf(identified: IdentifiedRobot) -> FormatFiles:
    """A MuJoCo model with a position actuator at each joint; ctrl is the goal."""
    robot, name, joints = identified.robot, identified.name, joints_of(identified)
    root = Element("mujoco", model=name)
    _add(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
    option = _add(root, "option", timestep=STEP, integrator="implicitfast", gravity=np.array(robot.gravity))
    _add(option, "flag", contact="disable")
    inside: dict[int, Element] = {-1: _add(root, "worldbody")}
    children = {key: joint.child for key, joint in robot.description.joint_map.items()}
    of_body = np.argsort(robot.order)
    for b in range(robot.n):
        i = int(of_body[b])
        parent = inside[int(robot.model.parents[1 + b]) - 1]
        body = _frame(parent, children[robot.joints[i]], robot.model.jointPlacements[1 + b])
        _servo_joint(identified, i, joints[i], body)
        _inertial(body, pin.Inertia.FromDynamicParameters(identified.inertial[i]))
        inside[b] = body
    actuator = _add(root, "actuator")
    for joint in joints:
        _actuator(actuator, joint)
    missing = left_out(joints, MJCF)
    about = [
        *identified.heading, "ctrl of each actuator is the goal of its joint. Contacts are off.",
        *(f"NOT CONTAINED: {text}" for text in missing),
    ]  # fmt: skip
    root.insert(0, ElementTree.Comment(comment_text(about, "  ")))
    ElementTree.indent(root)
    return FormatFiles(
        {f"{name}.xml": (ElementTree.tostring(root, encoding="unicode") + "\n").encode()}, missing
    )


def _servo_joint(identified: IdentifiedRobot, i: int, joint: Joint, body: Element) -> None:
    robot = identified.robot
    linear, angular = axis(robot, int(robot.order[i]))
    quadratic = joint.value("quadratic_friction", "quadratic")
    more: dict[str, Any] = _dry_friction(joint.value("coulomb_friction", "coulomb"))
    if spring := joint.value("cable_spring", "stiffness"):
        more |= {"stiffness": spring, "springref": joint.value("cable_spring", "rest_angle")}
    _add(
        body, "joint", name=joint.name, type="hinge" if angular.any() else "slide", axis=angular + linear,
        armature=joint.armature, damping=[joint.viscous, quadratic] if quadratic else joint.viscous, **more,
    )  # fmt: skip


def _actuator(parent: Element, joint: Joint) -> None:
    gain = joint.value("position_control", "gain")
    more: dict[str, Any] = {}
    if limit := joint.value("torque_limit", "limit"):
        more["forcerange"] = (-limit, limit)
    if delay := joint.value("goal_delay", "delay"):
        more |= {"delay": delay, "nsample": str(ceil(delay / STEP - 1e-9) + 1)}
    if lag := joint.value("goal_lag", "time_constant"):
        more |= {"dyntype": "filterexact", "dynprm": lag}
    bias = (-joint.value("torque_offset", "offset"), -gain, 0.0)
    _add(
        parent, "general", name=joint.name, joint=joint.name, gaintype="fixed", gainprm=gain,
        biastype="affine", biasprm=bias, **more,
    )  # fmt: skip


def isaac_lab(identified: IdentifiedRobot) -> FormatFiles:
    """Isaac Lab's actuators as Python, with the half widths of the 95 % intervals for randomisation."""
    joints = joints_of(identified)
    missing = [*left_out(joints, ISAAC)]
    delayed = any("goal_delay" in joint.effects for joint in joints)
    kind = "DelayedPDActuatorCfg" if delayed else "ImplicitActuatorCfg"
    rows: dict[str, dict[str, float]] = {
        "stiffness": {j.name: j.value("position_control", "gain") for j in joints},
        "damping": dict.fromkeys((j.name for j in joints), 0.0),
        "armature": {j.name: float(j.armature) for j in joints},
        "viscous_friction": {j.name: float(j.viscous) for j in joints},
        "friction": {j.name: j.value("coulomb_friction", "coulomb") for j in joints},
    }
    limits = {j.name: limit for j in joints if (limit := j.value("torque_limit", "limit"))}
    rows |= {"effort_limit": limits} if limits else {}
    names = {
        "stiffness": "position_control.gain", "armature": "motor_inertia",
        "viscous_friction": "motor_viscous_friction",
    }  # fmt: skip
    spread = {key: {j.name: j.half_width(name) for j in joints} for key, name in names.items()}
    lines = [f"# {line}" for line in identified.heading]
    lines += [f"# NOT CONTAINED: {text}" for text in missing]
    lines += [
        "# [Nm/rad], [Nm s/rad], [kg m²], [Nm]; friction is dry friction.",
        "",
        "from isaaclab.actuators import " + kind,
        "",
    ]
    lines += [
        "ACTUATORS = {",
        f'    "{identified.name}": {kind}(',
        f"        joint_names_expr={[j.name for j in joints]},",
    ]
    lines += [f"        {key}={_rounded(values)}," for key, values in rows.items()]
    if delayed:
        delay = max(j.value("goal_delay", "delay") for j in joints)
        lines += [f"        min_delay=0, max_delay=round({delay:.6g} / PHYSICS_STEP),  # [steps]"]
        lines.insert(
            lines.index("ACTUATORS = {"), "PHYSICS_STEP = 0.005  # [s] of the simulation that uses this\n"
        )
    lines += [
        "    ),",
        "}",
        "",
        "# half of the 95 % intervals, None where it is not known: for randomisation",
    ]
    lines += [f"HALF_WIDTHS = {spread!r}", ""]
    return FormatFiles({f"{identified.name}_actuators.py": "\n".join(lines).encode()}, missing)


def _rounded(values: dict[str, float]) -> dict[str, float]:
    return {name: float(f"{value:.6g}") for name, value in values.items()}


def bam(identified: IdentifiedRobot) -> FormatFiles:
    """Friction of each joint under the names of BAM's models; kt and R need the motor's data sheet."""
    joints = joints_of(identified)
    missing = [*left_out(joints, (*BAM, "position_control", "torque_limit"))]
    found = {}
    for joint in joints:
        load = joint.value("load_dependent_friction", "coefficient")
        found[joint.name] = {
            "armature": float(joint.armature),
            "friction_base": joint.value("coulomb_friction", "coulomb"),
            "friction_viscous": float(joint.viscous),
            "load_friction_motor": load + joint.value("driving_friction", "motor_driving"),
            "load_friction_external": load + joint.value("driving_friction", "load_driving"),
            "friction_stribeck": joint.value("stribeck_friction", "stribeck"),
            "dtheta_stribeck": joint.value("stribeck_friction", "velocity"),
            "kp": joint.value("position_control", "gain"),
            "max_torque": joint.value("torque_limit", "limit") or None,
        }
    document = {"about": identified.heading, "not_contained": missing, "joints": found}
    text = json.dumps(document, indent=1, ensure_ascii=False) + "\n"
    return FormatFiles({f"{identified.name}_bam.json": text.encode()}, missing)


SERVO_FORMATS: dict[str, Callable[[IdentifiedRobot], FormatFiles]] = {
    "mjcf": servo_mjcf, "isaac": isaac_lab, "bam": bam,
}  # fmt: skip
"""Formats of robots whose joints follow goals."""
