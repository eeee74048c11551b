"""Random robots on random motions whose CAD values are wrong: plans with nothing hidden in them yet."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.diagnosis_study.motions import random_motion, workload
from flexviz.model.simulation import (
    PDController,
    Plan,
    PlannedGroup,
    Reference,
    Sensors,
    motion_scale,
    perturbed,
    random_fourier,
)
from flexviz.robot._pinocchio import pin
from flexviz.robot.model import EffectValue, FlexibleModel
from flexviz.robot.robot import PayloadBody, Robot, load_settings

Array = NDArray[np.float64]
Payloads = dict[str, tuple[PayloadBody, ...]]
Source = tuple[Robot, str, dict[str, str]]  # a robot, where its URDF is, and the URDF if it is made here

ROBOTS = ("2r", "panda", "ur5")
URDF = "robot.urdf"
ARMS = {  # settings, link of the payload, middle of the motion [rad]
    "panda": ("panda", "panda_hand", (0.0, -0.3, 0.0, -1.8, 0.0, 1.8, 0.5)),
    "ur5": ("ur5", "tool0", (0.0, -1.2, 1.4, -0.9, -1.2, 0.0)),
}

# -- robots with few hidden effects --------------------------------------------------------------------------

CYCLE = 0.0005  # [s] of the controller; each torque is held that long
RECORD = 0.001  # [s]
DURATIONS = (10.0, 12.0)  # [s] of every run of a set
HARMONICS = 8  # of one period in the whole run
INCLINED = 0.25  # share of the planar arms whose plane is not vertical
THREE = 0.2  # share of the sets with three groups instead of four


def random_plan(kind: str, rng: np.random.Generator, base: tuple[str, ...], noise: float) -> Plan:
    """A robot of that kind, its motions and payloads; `base` are the effects that its model knows of.

    `noise` scales the sensors' noise.
    """
    (robot, source, files), inertial = _wrong_planar(rng) if kind == "2r" else _wrong_arm(kind, rng)
    n, duration = robot.n, float(rng.choice(DURATIONS))
    if kind == "2r":
        stiffness = np.exp(rng.uniform(np.log(700.0), np.log(4000.0), n))  # [Nm/rad]
        motor = rng.uniform((0.6, 0.45), (2.4, 1.05))  # [kg m²]
        link_viscous, motor_viscous = rng.uniform(0.15, 0.45, n), rng.uniform(0.3, 0.9, n)  # [Nm s/rad]
        sensors = Sensors(2e-5 * noise, 2e-3 * noise)
        kp, kd = _gains(motor, rng)
    else:
        settings = load_settings(ARMS[kind][0])
        stiffness = settings.stiffness * rng.uniform(0.6, 1.5, n)
        motor = settings.motor_inertia * rng.uniform(0.6, 1.4, n)
        link_viscous, motor_viscous = rng.uniform(0.3, 0.9, n), rng.uniform(1.2, 3.6, n)
        sensors = Sensors(1e-5 * noise, 1e-2 * noise)
        kp, kd = settings.kp, settings.kd
    plan = Plan(
        name=kind,
        robot=robot,
        source=source,
        model=FlexibleModel(robot.joints, stiffness, motor, link_viscous, motor_viscous, inertial),
        payloads=_payloads(kind, rng),
        groups=_groups(kind, robot, duration, rng),
        controller=PDController(kp, kd, CYCLE),
        sensors=sensors,
        initial_stiffness=_digits(stiffness * rng.uniform(0.7, 1.35, n)),
        initial_motor_inertia=_digits(motor * rng.uniform(0.65, 1.45, n)),
        effects=base,
        extra=False,
        files=files,
    )
    return _with_base(plan, base, rng)


def _wrong_planar(rng: np.random.Generator) -> tuple[Source, Array]:
    """Two links in a plane, mostly a vertical one, and the true bodies: its URDF has other ones."""
    length = rng.uniform(0.4, 0.6)  # [m]
    tilt = rng.uniform(0.2, 0.9) if rng.random() < INCLINED else 0.0  # [rad] of the plane
    mass = rng.uniform((4.0, 3.0), (8.0, 4.8))
    centre = rng.uniform((0.15, 0.14), (0.28, 0.25))  # [m] along the link
    aside = rng.uniform(-0.02, 0.02, 2)  # [m] across it
    inertia = rng.uniform((0.3, 0.15), (0.7, 0.32))  # [kg m²] about the centre
    bodies = zip(mass, centre, aside, inertia, strict=True)
    true = [pin.Inertia(m, np.array([x, 0.0, z]), i * np.eye(3)) for m, x, z, i in bodies]
    drawn = (
        mass * rng.uniform(0.8, 1.25, 2),
        centre * rng.uniform(0.85, 1.15, 2),
        inertia * rng.uniform(0.7, 1.35, 2),
    )
    return planar_arm(length, tilt, *drawn), np.array([body.toDynamicParameters() for body in true])


def _wrong_arm(kind: str, rng: np.random.Generator) -> tuple[Source, Array]:
    """An arm whose true bodies are those of its URDF made heavier or lighter, moved and reshaped."""
    made, true = arm(kind), []
    for body in map(pin.Inertia.FromDynamicParameters, made[0].cad_parameters):
        mass, shape = rng.uniform((0.8, 0.75), (1.25, 1.3))
        changed = (mass * body.mass, body.lever * rng.uniform(0.85, 1.15), mass * shape * body.inertia)
        true.append(pin.Inertia(*changed).toDynamicParameters())
    return made, np.array(true)


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


def _payloads(kind: str, rng: np.random.Generator) -> Payloads:
    payloads: Payloads = {"p1": ()}
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
    for joint, torque, speed in zip(plan.robot.joints, size.torque, size.speed, strict=True):
        for name in base:
            strength = float(rng.uniform(0.05, 0.2)) * float(torque)
            parameters = {
                "coulomb_friction": {"coulomb": strength},
                "link_coulomb_friction": {"coulomb": strength},
                "torque_offset": {"offset": strength * float(rng.choice([-1.0, 1.0]))},
                "quadratic_friction": {"quadratic": strength / float(speed) ** 2},
            }[name]
            values.append(EffectValue(name, joint, parameters))
    return replace(plan, model=replace(plan.model, effects=tuple(values)))


def _gains(motor: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """A PD of 3–6 Hz for a planar arm that carries its payload, [Nm/rad], [Nm s/rad]."""
    load = motor + np.array([3.0, 0.9])  # [kg m²]
    pulse = 2 * np.pi * rng.uniform(3.0, 6.0)
    return load * pulse**2, 2.0 * rng.uniform(0.7, 1.0) * load * pulse


# -- stiff robots with many: stiffness, motor inertia, friction, sensor resolution and noise about what ------
# -- robots have in practice, two thirds close to it and one third up to a factor of three away --------------

RECORD_STIFF = 0.002  # [s]
CYCLES = (0.0005, 0.001, 0.002)  # [s] of the controller
CAD_ERRORS = (0.08, 0.15)  # of mass, centre of mass and inertia
WIDE = 1 / 3  # share of the robots with stiffness and motor inertia far from the usual
BARE = 0.25  # share of the sets without any payload
FILTERED = 0.5  # share of the sets that record a filtered current
FILTER_HERTZ = (150.0, 500.0)
ENCODER_BITS = {18: 0.08, 19: 0.23, 20: 0.23, 21: 0.23, 22: 0.23}  # at the joint side → probability
NOISELESS = 0.5  # share of the encoders without any noise but their resolution
TORQUE_NOISE = (0.002, 0.012)  # standard deviation over that of the joint's torque
TORQUE_STEP = 0.002  # resolution over the standard deviation of the joint's torque
GROUPS = (("g1", "t1", "p1"), ("g2", "t2", "p2"), ("g3", "t3", "p3"))  # the last one is held out


@dataclass(frozen=True)
class Usual:
    """Typical values of one robot.

    Attributes:
        stiffness: (n,) [Nm/rad].
        motor_inertia: (n,) [kg m²].
        motor_viscous: range [Nm s/rad].
        reach: range of the motion to either side of its middle [rad].
        payload: range of masses [kg].
        link_viscous: range [Nm s/rad].
    """

    stiffness: tuple[float, ...]
    motor_inertia: tuple[float, ...]
    motor_viscous: tuple[float, float]
    reach: tuple[float, float]
    payload: tuple[float, float]
    link_viscous: tuple[float, float] = (0.15, 0.45)


USUAL: dict[str, Usual] = {
    "2r": Usual((13500.0, 14500.0), (0.95, 0.95), (0.4, 0.8), (0.6, 1.3), (0.3, 2.5)),
    "ur5": Usual(
        (145e3, 133e3, 86e3, 31e3, 31e3, 23e3), (3.3, 2.3, 1.9, 0.33, 0.36, 0.28),
        (1.2, 3.2), (0.4, 0.9), (0.3, 2.5),
    ),
    "panda": Usual(
        (98e3, 107e3, 50e3, 55e3, 38e3, 27e3, 20e3), (0.6, 0.78, 0.39, 0.53, 0.27, 0.245, 0.187),
        (1.2, 3.6), (0.35, 0.8), (0.3, 2.0),
    ),
}  # fmt: skip


def stiff_plan(kind: str, duration: float, rng: np.random.Generator) -> Plan:
    """A robot of that kind with its motions of that duration [s], payloads, controller and sensors."""
    usual = USUAL[kind]
    robot, source, files = _right_planar(rng) if kind == "2r" else arm(kind)
    n = robot.n
    inertial = [perturbed(row[None], rng.uniform(*CAD_ERRORS), rng) for row in robot.cad_parameters]
    wide = rng.random() < WIDE
    spread = (np.log(1 / 3), np.log(3.0)) if wide else (np.log(0.75), np.log(1.35))
    stiffness = np.array(usual.stiffness) * np.exp(rng.uniform(*spread, n))
    spread = (np.log(0.5), np.log(2.0)) if wide else (np.log(0.65), np.log(1.4))
    motor = np.array(usual.motor_inertia) * np.exp(rng.uniform(*spread, n))
    viscous = rng.uniform(*usual.link_viscous, n), rng.uniform(*usual.motor_viscous, n)
    payloads = _stiff_payloads(kind, usual.payload, rng)
    middle = np.zeros(n) if kind == "2r" else np.array(ARMS[kind][2])

    def motion() -> Reference:
        centre, reach = middle + rng.uniform(-0.15, 0.15, n), rng.uniform(*usual.reach, n)
        return random_motion(robot, rng, centre=centre, reach=reach, duration=duration)

    plan = Plan(
        name=kind,
        robot=robot,
        source=source,
        model=FlexibleModel(robot.joints, stiffness, motor, *viscous, np.concatenate(inertial)),
        payloads=payloads,
        groups=stiff_groups(motion, duration),
        controller=_controller(robot, motor, middle, rng),
        sensors=Sensors(),
        initial_stiffness=_digits(stiffness * np.exp(rng.uniform(-np.log(2.0), np.log(2.0), n))),
        initial_motor_inertia=_digits(motor * np.exp(rng.uniform(-np.log(1.6), np.log(1.6), n))),
        extra=False,
        files=files,
    )
    return replace(plan, sensors=_sensors(workload(plan).torque, rng))


def stiff_groups(
    motion: Callable[[], Reference], duration: float, payload: str | None = None
) -> tuple[PlannedGroup, ...]:
    """Groups with a motion each of that duration [s], and payloads of their own unless one is given."""
    held_out = GROUPS[-1][0]
    return tuple(
        PlannedGroup(name, t, payload or p, motion(), duration, RECORD_STIFF, validation=name == held_out)
        for name, t, p in GROUPS
    )


def _right_planar(rng: np.random.Generator) -> Source:
    """A vertical planar arm; masses, lengths and inertias are random."""
    length = rng.uniform(0.4, 0.6)  # [m]
    mass = rng.uniform((4.5, 3.0), (8.0, 5.0))
    centre = rng.uniform((0.18, 0.13), (0.28, 0.24))  # [m] along the link
    return planar_arm(length, 0.0, mass, centre, rng.uniform((0.25, 0.15), (0.6, 0.35)))


def _stiff_payloads(kind: str, masses: tuple[float, float], rng: np.random.Generator) -> Payloads:
    """A payload for each group, the first often none; in some sets there is no payload at all."""
    bare = rng.random() < BARE
    out: Payloads = {}
    for name, empty in (("p1", 0.5), ("p2", 0.0), ("p3", 0.1)):
        mass, absent = float(f"{rng.uniform(*masses):.3g}"), rng.random() < empty
        if kind == "2r":
            link, com = "link2", (rng.uniform(0.2, 0.5), 0.0, rng.uniform(-0.05, 0.05))
        else:
            aside = rng.uniform(-0.04, 0.04), rng.uniform(-0.04, 0.04)
            link, com = ARMS[kind][1], (*aside, rng.uniform(0.03, 0.12))
        com = tuple(float(f"{x:.3g}") for x in com)
        size = float(f"{0.0025 * mass:.3g}")  # [kg m²]
        body = PayloadBody(link, mass, com, [size, size, size, 0.0, 0.0, 0.0])
        out[name] = () if bare or absent else (body,)
    return out


def _controller(robot: Robot, motor: Array, centre: Array, rng: np.random.Generator) -> PDController:
    """A PD of 4–8 Hz for the arm in the middle of its motion; slow cycles get the softer ones."""
    data = robot.model.createData()
    mass_matrix = pin.crba(robot.model, data, robot.to_pin(centre))
    load = robot.from_pin(np.diag(mass_matrix).copy()) + motor
    cycle = float(rng.choice(CYCLES))
    pulse = 2 * np.pi * rng.uniform(4.0, 5.0 if cycle > 0.001 else 8.0)
    ratio = rng.uniform(0.6, 0.9)
    # the motor alone, behind its spring, must not see more than the cycle allows
    kd = np.minimum(2 * ratio * load * pulse, 0.35 * motor / cycle)
    return PDController(np.minimum(load * pulse**2, kd * pulse), kd, cycle)


def _sensors(torque: Array, rng: np.random.Generator) -> Sensors:
    """Encoder and torque sensor; `torque` (n,) is the standard deviation of each joint's torque [Nm]."""
    step = 2 * np.pi / 2 ** int(rng.choice(list(ENCODER_BITS), p=list(ENCODER_BITS.values())))
    encoder = 0.0 if rng.random() < NOISELESS else rng.uniform(0.1, 0.6)  # [steps]
    noise = np.exp(rng.uniform(*np.log(TORQUE_NOISE)))
    hertz = rng.uniform(*FILTER_HERTZ) if rng.random() < FILTERED else 0.0
    return Sensors(
        theta_noise=np.full(len(torque), step * encoder),
        torque_noise=noise * torque,
        resolution=np.full(len(torque), step),
        torque_resolution=TORQUE_STEP * torque,
        torque_filter=2 * np.pi * hertz,
    )


# -- of both -------------------------------------------------------------------------------------------------


def arm(kind: str) -> Source:
    """A Panda or UR5 as its URDF has it."""
    settings = load_settings(ARMS[kind][0])
    return Robot.load(settings.robot, settings.joints), settings.robot, {}


def planar_arm(length: float, tilt: float, mass: Array, centre: Array, inertia: Array) -> Source:
    """A planar arm of links with mass [kg], centre [m], inertia [kg m²]; its plane leans by `tilt` [rad]."""
    rows = ['<?xml version="1.0"?>', '<robot name="planar_2r">', '  <link name="base"/>']
    origins = (f'<origin rpy="{tilt:.9g} 0 0"/>', f'<origin xyz="{length:.9g} 0 0"/>')
    for k, (origin, m, x, i) in enumerate(zip(origins, mass, centre, inertia, strict=True), 1):
        parent = "base" if k == 1 else "link1"
        rows += [
            f'  <joint name="joint{k}" type="revolute"><parent link="{parent}"/><child link="link{k}"/>',
            f'    {origin}<axis xyz="0 -1 0"/>',
            '    <limit lower="-3.1" upper="3.1" effort="500" velocity="10"/></joint>',
            f'  <link name="link{k}"><inertial><origin xyz="{x:.9g} 0 0"/><mass value="{m:.9g}"/>'
            f'<inertia ixx="{i:.9g}" iyy="{i:.9g}" izz="{i:.9g}" ixy="0" ixz="0" iyz="0"/></inertial></link>',
        ]
    return from_urdf("\n".join([*rows, "</robot>", ""]))


def from_urdf(text: str) -> Source:
    """The robot of a URDF that is made here."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / URDF).write_text(text, encoding="utf-8")
        return Robot.load(URDF, base=Path(folder)), URDF, {URDF: text}


def _digits(values: Array) -> Array:
    """What somebody knows beforehand has four digits."""
    return np.array([float(f"{value:.4g}") for value in values])
