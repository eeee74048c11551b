"""A MuJoCo model with a position actuator at each joint; ctrl is the goal.

    position   kp (ctrl − q), with forcerange, delay and timeconst; with slewmax as `pid`

What MJCF cannot say and Python can, stands in a file next to the model (`stepping`).
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from math import ceil
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from flexviz.outlets.exporting.followers import followers_of
from flexviz.outlets.exporting.identified import FormatFiles, IdentifiedRobot
from flexviz.outlets.exporting.mjcf import (
    FRICTION,
    LARGEST_STEP,
    SMALLEST_STEP,
    add,
    bodies,
    couplings,
    frame,
    kind_and_axis,
    reach,
)
from flexviz.outlets.exporting.servo_values import ServoJoint, servo_joints
from flexviz.outlets.exporting.servos.stepping import goals_in_python, loaded, stepping
from flexviz.outlets.exporting.shapes import Shapes
from flexviz.outlets.exporting.xml_text import comment_text
from flexviz.robot._pinocchio import pin

PHASE = 0.3  # [rad] of the fastest vibration in a step
HARD = "0.99 0.999 0.001 0.5 2"  # impedance of dry friction: MuJoCo's own lets a joint creep under load
YIELD = 1e-4  # [rad] by which LuGre's bristles give way before a joint slides
BRISTLE_DAMPING = 0.1  # [-] ratio of the bristles' vibration


@dataclass(frozen=True, eq=False)
class _Servo:
    """A joint with the model's step [s], its largest vibration [rad/s] and inertia [kg m²]."""

    joint: ServoJoint
    step: float
    inertia: float

    def of_joint(self) -> dict[str, Any]:
        """Attributes of the joint."""
        get = self.joint.get
        quadratic, spring = get("quadratic_friction.quadratic"), get("cable_spring.stiffness")
        viscous = get("motor_viscous_friction")
        stribeck = self.joint.has("stribeck_friction")
        dry = 0.0 if stribeck else get("coulomb_friction.coulomb")
        out: dict[str, Any] = {
            "armature": get("motor_inertia"), "damping": [viscous, quadratic] if quadratic else viscous,
        }  # fmt: skip
        if dry or loaded(self.joint):
            dry = max(dry, 1e-9)  # without any, MuJoCo has no place for what is set in every step
            out |= {"frictionloss": dry, "solreffriction": FRICTION, "solimpfriction": HARD}
        if spring:
            out |= {"stiffness": spring, "springref": 0.0}
        return out

    def actuators(self, parent: Element) -> None:
        """Add its actuator, and a motor without input for what no other element of MuJoCo does."""
        name, get = self.joint.name, self.joint.get
        more: dict[str, Any] = {}
        if limit := get("torque_limit.limit"):
            more["forcerange"] = (-limit, limit)
        names = ("goal_delay.delay", "goal_lag.time_constant", "goal_speed_limit.speed")
        delay, lag, speed = (0.0 if goals_in_python(self.joint) else get(name) for name in names)
        if delay:
            more |= {"delay": delay, "nsample": str(ceil(delay / self.step - 1e-9) + 1), "interp": "linear"}
        if speed:
            more |= {"input": "pos", "slewmax": speed}
        elif lag:
            more["timeconst"] = lag
        kind = "pid" if speed else "position"
        add(parent, kind, name=name, joint=name, kp=get("gain"), **more)
        passive = self.bristles() if self.joint.has("stribeck_friction") else {}
        if offset := get("torque_offset.offset"):
            passive["cogging"] = (-offset, 0.0, np.pi / 2)  # of no poles: a constant
        if passive:
            motor = {"input": "none", "motorconst": (0.0, 0.0), "resistance": 1.0}
            add(parent, "dcmotor", name=f"{name}_passive", joint=name, **motor, **passive)

    def bristles(self) -> dict[str, Any]:
        """Dry friction with a peak at rest, as LuGre friction."""
        dry = self.joint.get("coulomb_friction.coulomb")
        most = dry + self.joint.get("stribeck_friction.stribeck")
        stiffness = min(most / YIELD, (PHASE / self.step) ** 2 * self.inertia)
        damping = 2.0 * BRISTLE_DAMPING * np.sqrt(stiffness * self.inertia)
        return {"lugre": (stiffness, damping, dry, most, self.joint.get("stribeck_friction.velocity"))}


def servo_mjcf(identified: IdentifiedRobot) -> FormatFiles:
    """The model, its meshes, and what it needs in every step."""
    identified.require_bodies()
    robot, name, joints = identified.robot, identified.name, servo_joints(identified)
    inertia = joint_inertia(identified)
    stiff = max(np.sqrt(j.get("gain") / m) for j, m in zip(joints, inertia, strict=True))
    step = LARGEST_STEP
    while step * stiff > PHASE and step > SMALLEST_STEP:
        step /= 2.0
    servos = [_Servo(joint, step, float(m)) for joint, m in zip(joints, inertia, strict=True)]
    root = Element("mujoco", model=name)
    add(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false", balanceinertia="false")
    option = add(root, "option", timestep=step, integrator="implicitfast", gravity=np.array(robot.gravity))
    add(option, "flag", contact="disable")
    shapes, followers = Shapes(robot, f"{name}_meshes"), followers_of(robot, identified.inertial)
    asset = add(root, "asset")
    children = {key: joint.child for key, joint in robot.description.joint_map.items()}

    def put(i: int, parent: Element, pose: Any) -> Element:
        joint = robot.joints[i]
        body = frame(parent, children[joint], pose)
        add(body, "joint", name=joint, **kind_and_axis(robot, i), **servos[i].of_joint(), **reach(robot, i))
        return body

    bodies(robot, add(root, "worldbody"), shapes, followers, put)
    asset.extend(shapes.assets)
    if not shapes.assets:
        root.remove(asset)
    couplings(root, followers)
    actuator = add(root, "actuator")
    for servo in servos:
        servo.actuators(actuator)
    needed = stepping(identified, joints)
    missing = [*identified.left_out("mjcf"), *needed.left_out, *followers.welded, *shapes.missing]
    about = [
        *identified.heading,
        "ctrl of each actuator is the goal of its joint. Contacts are off, collision shapes are omitted.",
        *(
            f"{file} begins the simulation and makes its steps: act and delays start at the first goal."
            for file in needed.files
        ),
        *(f"NOT CONTAINED: {text}" for text in missing),
    ]
    root.insert(0, ElementTree.Comment(comment_text(about, "  ")))
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode") + "\n"
    return FormatFiles({f"{name}.xml": text.encode(), **needed.files, **shapes.files}, missing)


def joint_inertia(identified: IdentifiedRobot) -> np.ndarray:
    """(n,) of motor and links about each joint where it is smallest in the recordings [kg m²]."""
    robot = identified.robot
    model = robot.model_with(identified.inertial, (), robot.gravity)
    data = model.createData()
    firsts = [segment for group in identified.measurements.groups for segment in group.segments]
    poses = np.concatenate([s.theta[:: max(1, len(s) // 4)] for s in firsts])
    found = [
        robot.from_pin(np.diag(pin.crba(model, data, np.ascontiguousarray(robot.to_pin(q))))) for q in poses
    ]
    return np.min(found, axis=0) + identified.model.motor_inertia
