"""A MuJoCo model with elastic joints.

Every joint of the robot becomes two: the link's with position q, named as in the URDF, and the motor's with
position θ, a massless rotor with the motor inertia B as armature. A fixed tendon of length θ − q between them
is the elastic joint. As in the identified equation, the rotor only adds B θ̈ to its own row, and gravity does
not act on it. The actuators act on the motors.

`coverage.MJCF` lists the effects. Hardening and quadratic friction need MuJoCo 3.7, a delay 3.5.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import replace
from math import ceil
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import ArrayLike

from flexviz.base.errors import InputError
from flexviz.model.simulation import fastest, make_plant
from flexviz.outlets.exporting.bodies import placement
from flexviz.outlets.exporting.code_tables import axis
from flexviz.outlets.exporting.followers import Followers, followers_of
from flexviz.outlets.exporting.identified import FormatFiles, IdentifiedRobot
from flexviz.outlets.exporting.shapes import Shapes
from flexviz.outlets.exporting.xml_text import comment_text, number_text
from flexviz.robot._pinocchio import pin
from flexviz.robot.robot import Robot

LARGEST_STEP = 0.001  # [s]
SMALLEST_STEP = 1e-6  # [s]
ROTOR_MASS, ROTOR_INERTIA = 1e-9, "1e-12"  # [kg], [kg m²]: MuJoCo requires mass in everything that moves
FRICTION = "0.004 1"  # solver time constant [s] and damping ratio, which approximate Coulomb friction
ENDLESS_RANGE = 100.0  # [rad] hinges with a wider range are unlimited


def mjcf(identified: IdentifiedRobot) -> FormatFiles:
    """The model and its meshes."""
    identified.require_bodies()
    if not identified.has_motors:
        raise InputError(
            "MJCF needs motor inertias to move the motors, which a torque behind the gears does not show; "
            "export --to urdf, json, yaml, c, python"
        )
    robot, laws, name = identified.robot, identified.laws, identified.name
    step, vibration = timestep(identified)
    root = Element("mujoco", model=name)
    add(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false", balanceinertia="false")
    option = add(root, "option", timestep=step, integrator="RK4", gravity=laws.gravity)
    add(option, "flag", contact="disable")
    shapes = Shapes(robot, f"{name}_meshes")
    asset = add(root, "asset")
    motors = motor_names(robot)
    followers = followers_of(robot, identified.inertial)
    children = {name: joint.child for name, joint in robot.description.joint_map.items()}

    def put(i: int, parent: Element, pose: Any) -> Element:
        motor = frame(parent, motors[robot.joints[i]], pose)
        add(motor, "inertial", pos="0 0 0", mass=ROTOR_MASS, diaginertia=" ".join([ROTOR_INERTIA] * 3))
        body = frame(parent, children[robot.joints[i]], pose)
        _joints(identified, i, motor, body, motors[robot.joints[i]])
        return body

    bodies(robot, add(root, "worldbody"), shapes, followers, put)
    asset.extend(shapes.assets)
    if not shapes.assets:
        root.remove(asset)
    couplings(root, followers)
    _tendons(identified, root, motors)
    _actuators(identified, root, motors, step)
    missing = [
        *identified.left_out("mjcf"),
        *followers.welded,
        *(
            f"joint_damping:{robot.joints[i]}: MuJoCo's damping also acts within the play"
            for i in np.flatnonzero(laws["damping"] * laws["half_width"])
        ),
        *(
            f"torque_delay:{robot.joints[i]}: a negative delay cannot be simulated"
            for i in np.flatnonzero(laws["torque_delay"] < 0.0)
        ),
        *shapes.missing,
    ]
    about = [
        *identified.heading,
        "Each joint has two positions: <joint> of the link, <joint>_motor of the motor. The tendon between",
        "them is the elastic joint, armature is the motor inertia, ctrl the motor torque [Nm].",
        "Contacts are off, collision shapes are omitted.",
        f"The time step resolves the fastest vibration, {vibration:.0f} rad/s.",
        *(f"NOT CONTAINED: {text}" for text in missing),
    ]
    root.insert(0, ElementTree.Comment(comment_text(about, "  ")))
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode") + "\n"
    return FormatFiles({f"{name}.xml": text.encode(), **shapes.files}, missing)


def motor_names(robot: Robot) -> dict[str, str]:
    """Joint -> name of its motor, distinct from every joint and link."""
    taken = {*robot.joints, *robot.links}
    names = {}
    for joint in robot.joints:
        name = f"{joint}_motor"
        while name in taken:
            name += "_"
        taken.add(name)
        names[joint] = name
    return names


def timestep(identified: IdentifiedRobot) -> tuple[float, float]:
    """The controller cycle [s], halved until it resolves the fastest vibration, and its frequency."""
    kept = ("stiffness_hardening", "joint_damping", "quadratic_friction")
    model = replace(identified.model, effects=tuple(e for e in identified.model.effects if e.effect in kept))
    plant, _ = make_plant(identified.robot, model, identified.laws.bodies)
    firsts = [group.segments[0] for group in identified.measurements.groups if group.segments]
    rows = [segment.theta[:: max(1, len(segment) // 4)] for segment in firsts]
    rates = fastest(plant, identified.robot.to_pin(np.concatenate(rows)))
    hold = identified.measurements.torque_hold
    step = hold if 0.0 < hold <= LARGEST_STEP else LARGEST_STEP
    while step > rates.longest_step and step > SMALLEST_STEP:
        step /= 2.0
    return step, rates.vibration


def bodies(
    robot: Robot,
    world: Element,
    shapes: Shapes,
    followers: Followers,
    put: Callable[[int, Element, Any], Element],
) -> None:
    """All bodies; `put` adds joint i at a pose in a body, and gives the body that it moves."""
    inside: dict[int, Element] = {-1: world}  # Pinocchio's joint -> its body
    for link in robot.links:
        if robot.joint_of_link(link) is None:
            parent = world if link == "world" else frame(world, link, placement(robot, link))
            parent.extend(shapes.geoms(link))
    joint_of_body = np.argsort(robot.order)
    children = {name: joint.child for name, joint in robot.description.joint_map.items()}
    for b in range(robot.n):
        i = int(joint_of_body[b])
        joint, pose = robot.joints[i], robot.model.jointPlacements[1 + b]
        parent = inside[int(robot.model.parents[1 + b]) - 1]
        body = put(i, parent, pose)
        inertial(body, pin.Inertia.FromDynamicParameters(followers.rest[i]))
        inside[b] = body
        # mimic joint -> its body, and its pose in that of joint i
        hosts: dict[str | None, tuple[Element, Any]] = {None: (body, pin.SE3.Identity())}
        for one in (one for one in followers.coupled if one.carrier == i):
            above, place = hosts[one.above]
            element = frame(above, one.links[0], place.actInv(one.pose))
            place_of_zero = {"ref": one.mimic.offset} if one.mimic.offset else {}
            add(element, "joint", name=one.joint, type=one.kind, axis=one.axis, **place_of_zero)
            inertial(element, one.inertia)
            hosts[one.joint] = element, one.pose
        for link in (link for link in robot.links if robot.joint_of_link(link) == i):
            follower = followers.of(link)
            host, place = hosts[follower.joint if follower else None]
            first = follower.links[0] if follower else children[joint]
            own = host if link == first else frame(host, link, place.actInv(placement(robot, link)))
            own.extend(shapes.geoms(link))


def inertial(body: Element, inertia: Any) -> None:
    full = inertia.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    add(body, "inertial", pos=inertia.lever, mass=inertia.mass, fullinertia=full)


def couplings(root: Element, followers: Followers) -> None:
    """Mimic joints as equality constraints of their joint's link position."""
    if followers.coupled:
        equality = add(root, "equality")
        for one in followers.coupled:
            line = (0.0, one.mimic.multiplier, 0.0, 0.0, 0.0)
            ends = {"joint1": one.joint, "joint2": one.mimic.leader}
            add(equality, "joint", **ends, polycoef=line, solref=FRICTION)


def _joints(identified: IdentifiedRobot, i: int, motor: Element, body: Element, motor_name: str) -> None:
    robot, laws, joint = identified.robot, identified.laws, identified.joints[i]
    shared = kind_and_axis(robot, i)
    viscous, quadratic = laws["motor_viscous"][i], laws["quadratic"][i]
    moving = {"armature": laws["motor_inertia"][i], "damping": [viscous, quadratic] if quadratic else viscous}
    add(motor, "joint", name=motor_name, **shared, **moving, **_dry_friction(laws.sliding_friction(i)))
    more = {"damping": laws["link_viscous"][i], **_dry_friction(laws["link_coulomb"][i])}
    if laws["spring"][i]:
        more |= {"stiffness": laws["spring"][i], "springref": laws["spring_torque"][i] / laws["spring"][i]}
    add(body, "joint", name=joint, **shared, **more, **reach(robot, i))


def kind_and_axis(robot: Robot, i: int) -> dict[str, Any]:
    """Attributes of joint i in its own body."""
    linear, angular = axis(robot, int(robot.order[i]))
    return {"type": "hinge" if angular.any() else "slide", "axis": angular + linear}


def reach(robot: Robot, i: int) -> dict[str, Any]:
    """The attribute of joint i's limits, if it has any."""
    low, high = robot.lower_limit[i], robot.upper_limit[i]
    limited = low < high and (robot.prismatic[i] or high - low < ENDLESS_RANGE)
    return {"range": (low, high)} if limited else {}


def _dry_friction(torque: float) -> dict[str, Any]:
    return {"frictionloss": torque, "solreffriction": FRICTION} if torque else {}


def _tendons(identified: IdentifiedRobot, root: Element, names: dict[str, str]) -> None:
    laws = identified.laws
    tendon = add(root, "tendon")
    for i, joint in enumerate(identified.joints):
        stiffness, cubic, gap = (laws[name][i] for name in ("stiffness", "cubic", "half_width"))
        spring = {
            "stiffness": [stiffness, 0.0, cubic] if cubic else stiffness,
            "springlength": [-gap, gap] if gap else 0.0,
        }
        damping = {"damping": laws["damping"][i]} if laws["damping"][i] else {}
        fixed = add(tendon, "fixed", name=f"{joint}_elastic", **spring, **damping)
        add(fixed, "joint", joint=names[joint], coef="1")
        add(fixed, "joint", joint=joint, coef="-1")
    for k, (i, other, coulomb, viscous) in enumerate(laws.rows["coupled"]):
        pair = [identified.joints[int(at)] for at in (i, other)]
        friction = {"damping": viscous, **_dry_friction(coulomb)}
        fixed = add(tendon, "fixed", name=f"{'_'.join(pair)}_coupled{k}", **friction)
        for joint in pair:
            add(fixed, "joint", joint=names[joint], coef="1")


def _actuators(identified: IdentifiedRobot, root: Element, names: dict[str, str], step: float) -> None:
    laws = identified.laws
    actuator, sensor = add(root, "actuator"), add(root, "sensor")
    limits = identified.torque_limits
    for i, joint in enumerate(identified.joints):
        delay, more = laws["torque_delay"][i], {}
        if delay > 0.0:
            more = {"delay": delay, "nsample": str(ceil(delay / step - 1e-9) + 1)}
        if laws["offset"][i]:
            more |= {"biastype": "affine", "biasprm": (-laws["offset"][i], 0.0, 0.0)}
        gain = {"gaintype": "fixed", "gainprm": 1.0 + laws["gain_error"][i]}
        if limits.get(joint, 0.0) > 0.0:
            more["forcerange"] = (-limits[joint], limits[joint])
        add(actuator, "general", name=joint, joint=names[joint], **gain, **more)
        for signal, place in (("theta", names[joint]), ("q", joint)):
            add(sensor, "jointpos", name=f"{signal}_{joint}", joint=place)
            add(sensor, "jointvel", name=f"{signal}_velocity_{joint}", joint=place)


def add(parent: Element, tag: str, **attributes: str | ArrayLike) -> Element:
    """A new element; attributes are texts or numbers."""
    texts = {k: v if isinstance(v, str) else number_text(v) for k, v in attributes.items()}
    return ElementTree.SubElement(parent, tag, texts)


def frame(parent: Element, name: str, pose: Any) -> Element:
    """A body in `parent` at a Pinocchio pose."""
    quaternion = pin.Quaternion(pose.rotation).coeffs()  # x y z w
    place = {"pos": pose.translation}
    if abs(quaternion[3]) < 1.0:
        place["quat"] = (quaternion[3], *quaternion[:3])
    return add(parent, "body", name=name, **place)
