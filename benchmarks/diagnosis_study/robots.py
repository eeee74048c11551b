"""Random robots on random motions: a plan with a wrong CAD model, and nothing hidden in it yet."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flexviz.model import EffectValue, FlexibleModel
from flexviz.robot import PayloadBody, Robot, load_settings
from flexviz.simulation import PDController, Plan, PlannedGroup, Sensors, motion_scale, random_fourier

Array = NDArray[np.float64]

ROBOTS = ("2r", "panda", "ur5")
CYCLE = 0.0005  # [s] of the controller; each torque is held that long
RECORD = 0.001  # [s]
DURATIONS = (10.0, 12.0)  # [s] of every run of a set
HARMONICS = 8  # of one period in the whole run
URDF = "robot.urdf"

ARMS = {  # settings, link of the payload, middle of the motion [rad]
    "panda": ("panda", "panda_hand", (0.0, -0.3, 0.0, -1.8, 0.0, 1.8, 0.5)),
    "ur5": ("ur5", "tool0", (0.0, -1.2, 1.4, -0.9, -1.2, 0.0)),
}
INCLINED = 0.25  # share of the planar arms whose plane is not vertical
THREE = 0.2  # share of the sets with three groups instead of four


def random_plan(kind: str, rng: np.random.Generator, base: tuple[str, ...], noise: float) -> Plan:
    """A robot of that kind, its motions and payloads; `base` are the effects that its model knows of.

    `noise` scales the sensors' noise.
    """
    robot, source, files, inertial = _planar(rng) if kind == "2r" else _arm(kind, rng)
    n, duration = robot.n, float(rng.choice(DURATIONS))
    if kind == "2r":
        stiffness = np.exp(rng.uniform(np.log(700.0), np.log(4000.0), n))  # [Nm/rad]
        motor = rng.uniform((0.6, 0.45), (2.4, 1.05))  # [kg m²]
        link_viscous, motor_viscous = rng.uniform(0.15, 0.45, n), rng.uniform(0.3, 0.9, n)  # [Nm s/rad]
        theta_noise, torque_noise = 2e-5 * noise, 2e-3 * noise
        kp, kd = _gains(motor, rng)
    else:
        settings = load_settings(ARMS[kind][0])
        stiffness = settings.stiffness * rng.uniform(0.6, 1.5, n)
        motor = settings.motor_inertia * rng.uniform(0.6, 1.4, n)
        link_viscous, motor_viscous = rng.uniform(0.3, 0.9, n), rng.uniform(1.2, 3.6, n)
        theta_noise, torque_noise = 1e-5 * noise, 1e-2 * noise
        kp, kd = settings.kp, settings.kd
    payloads = _payloads(kind, rng)
    plan = Plan(
        name=kind,
        robot=robot,
        source=source,
        model=FlexibleModel(robot.joints, stiffness, motor, link_viscous, motor_viscous, inertial),
        payloads=payloads,
        groups=_groups(kind, robot, duration, rng),
        controller=PDController(kp, kd, CYCLE),
        sensors=Sensors(theta_noise, torque_noise),
        initial_stiffness=_rough(stiffness, 0.7, 1.35, rng),
        initial_motor_inertia=_rough(motor, 0.65, 1.45, rng),
        effects=base,
        extra=False,
        files=files,
    )
    return _with_base(plan, base, rng)


def _planar(rng: np.random.Generator) -> tuple[Robot, str, dict[str, str], Array]:
    """Two links in a plane, mostly a vertical one; the true bodies, and a URDF with other ones."""
    length = rng.uniform(0.4, 0.6)  # [m]
    tilt = rng.uniform(0.2, 0.9) if rng.random() < INCLINED else 0.0  # [rad] of the plane
    mass = rng.uniform((4.0, 3.0), (8.0, 4.8))
    centre = rng.uniform((0.15, 0.14), (0.28, 0.25))  # [m] along the link
    aside = rng.uniform(-0.02, 0.02, 2)  # [m] across it
    inertia = rng.uniform((0.3, 0.15), (0.7, 0.32))  # [kg m²] about the centre
    true = np.array(
        [_row(m, (x, 0.0, z), i) for m, x, z, i in zip(mass, centre, aside, inertia, strict=True)]
    )
    links = zip(
        mass * rng.uniform(0.8, 1.25, 2),
        centre * rng.uniform(0.85, 1.15, 2),
        inertia * rng.uniform(0.7, 1.35, 2),
        strict=True,
    )
    text = planar_urdf(length, tilt, [tuple(map(float, link)) for link in links])
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / URDF).write_text(text, encoding="utf-8")
        robot = Robot.load(URDF, base=Path(folder))
    return robot, URDF, {URDF: text}, true


def _arm(kind: str, rng: np.random.Generator) -> tuple[Robot, str, dict[str, str], Array]:
    """An arm whose true bodies are those of its URDF made heavier or lighter, moved and reshaped."""
    settings = load_settings(ARMS[kind][0])
    robot = Robot.load(settings.robot, settings.joints)
    true = robot.cad_parameters.copy()
    for row in true:
        mass_factor, shape_factor = rng.uniform((0.8, 0.75), (1.25, 1.3))
        mass, centre = row[0], row[1:4] / row[0]
        xx, xy, yy, xz, yz, zz = row[4:]
        about_joint = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        own = (about_joint - mass * _squared(centre)) * shape_factor
        mass, centre = mass * mass_factor, centre * rng.uniform(0.85, 1.15)
        full = own * mass_factor + mass * _squared(centre)
        row[0], row[1:4] = mass, mass * centre
        row[4:] = full[0, 0], full[0, 1], full[1, 1], full[0, 2], full[1, 2], full[2, 2]
    return robot, settings.robot, {}, true


def _groups(kind: str, robot: Robot, duration: float, rng: np.random.Generator) -> tuple[PlannedGroup, ...]:
    """Each fit group has its own motion and payload; the held-out one combines them differently."""
    count = 2 if rng.random() < THREE else 3
    pairs = [(k, k) for k in range(1, count + 1)] + [(1, count)]
    reach = (0.7, 1.3) if kind == "2r" else (0.35, 0.75)
    middle = np.zeros(robot.n) if kind == "2r" else np.array(ARMS[kind][2])
    motions = {
        k: random_fourier(
            robot,
            int(rng.integers(2**31)),
            centre=middle + rng.uniform(-0.2, 0.2, robot.n),
            reach=rng.uniform(*reach, robot.n),
            duration=duration,
            harmonics=HARMONICS,
            frequency=2 * np.pi / duration,
        )
        for k in range(1, count + 1)
    }
    return tuple(
        PlannedGroup(f"g{i}", f"t{t}", f"p{p}", motions[t], duration, RECORD, validation=i == len(pairs))
        for i, (t, p) in enumerate(pairs, 1)
    )


def _payloads(kind: str, rng: np.random.Generator) -> dict[str, tuple[PayloadBody, ...]]:
    payloads: dict[str, tuple[PayloadBody, ...]] = {"p1": ()}
    for name in ("p2", "p3"):
        if kind == "2r":
            link, mass = "link2", rng.uniform(1.1, 3.6)
            centre = (rng.uniform(0.2, 0.5), 0.0, rng.uniform(-0.09, 0.09))
        else:
            link, mass = ARMS[kind][1], rng.uniform(0.7, 1.9)
            centre = (rng.uniform(-0.03, 0.03), 0.0, rng.uniform(0.05, 0.12))
        payloads[name] = (PayloadBody(link, mass, centre, [*([0.002 * mass] * 3), 0.0, 0.0, 0.0]),)
    return payloads


def _with_base(plan: Plan, base: tuple[str, ...], rng: np.random.Generator) -> Plan:
    """Effects that the set's model has from the start, on every joint, each with its own size."""
    size = motion_scale(plan)
    values = []
    for i, joint in enumerate(plan.robot.joints):
        torque, speed = float(size.torque[i]), float(size.speed[i])
        for name in base:
            strength = float(rng.uniform(0.05, 0.2)) * torque
            parameters = {
                "coulomb_friction": {"coulomb": strength},
                "link_coulomb_friction": {"coulomb": strength},
                "torque_offset": {"offset": strength * float(rng.choice([-1.0, 1.0]))},
                "quadratic_friction": {"quadratic": strength / speed**2},
            }[name]
            values.append(EffectValue(name, joint, parameters))
    return replace(plan, model=replace(plan.model, effects=tuple(values)))


def _gains(motor: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """A PD of 3–6 Hz for a planar arm that carries its payload, [Nm/rad], [Nm s/rad]."""
    load = motor + np.array([3.0, 0.9])  # [kg m²]
    pulse = 2 * np.pi * rng.uniform(3.0, 6.0)
    return load * pulse**2, 2.0 * rng.uniform(0.7, 1.0) * load * pulse


def _rough(values: Array, low: float, high: float, rng: np.random.Generator) -> Array:
    """What somebody knows beforehand: within these factors, four digits."""
    return np.array([float(f"{v:.4g}") for v in values * rng.uniform(low, high, len(values))])


def _row(mass: float, centre: tuple[float, float, float], inertia: float) -> Array:
    """(10,) parameters about the joint of a body whose own inertia is the same about every axis."""
    c = np.array(centre)
    full = inertia * np.eye(3) + mass * _squared(c)
    moments = full[0, 0], full[0, 1], full[1, 1], full[0, 2], full[1, 2], full[2, 2]
    return np.array([mass, *(mass * c), *moments])


def _squared(centre: Array) -> Array:
    """|c|² 1 − c cᵀ."""
    return centre @ centre * np.eye(3) - np.outer(centre, centre)


def planar_urdf(length: float, tilt: float, links: list[tuple[float, ...]]) -> str:
    """A planar arm of links (mass [kg], centre [m], inertia [kg m²]); its plane leans by `tilt` [rad]."""
    rows = ['<?xml version="1.0"?>', '<robot name="planar_2r">', '  <link name="base"/>']
    origins = (f'<origin rpy="{tilt:.9g} 0 0"/>', f'<origin xyz="{length:.9g} 0 0"/>')
    for k, (origin, (mass, centre, i)) in enumerate(zip(origins, links, strict=True), 1):
        parent = "base" if k == 1 else "link1"
        rows += [
            f'  <joint name="joint{k}" type="revolute"><parent link="{parent}"/><child link="link{k}"/>',
            f'    {origin}<axis xyz="0 -1 0"/>',
            '    <limit lower="-3.1" upper="3.1" effort="500" velocity="10"/></joint>',
            f'  <link name="link{k}"><inertial><origin xyz="{centre:.9g} 0 0"/><mass value="{mass:.9g}"/>'
            f'<inertia ixx="{i:.9g}" iyy="{i:.9g}" izz="{i:.9g}" ixy="0" ixz="0" iyz="0"/></inertial></link>',
        ]
    return "\n".join([*rows, "</robot>", ""])
