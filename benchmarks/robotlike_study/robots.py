"""Random stiff robots whose CAD values are wrong: a plan with nothing hidden in it yet.

Ranges lie around the stiffness, motor inertia, friction, sensor resolution and noise of robots as they are
met in practice, two thirds of the robots close to them and one third up to a factor of three away.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.diagnosis_study.robots import ARMS, URDF, planar_urdf
from benchmarks.robotlike_study.cases import RobotCase
from benchmarks.robotlike_study.motions import random_motion, workload
from flexviz._pinocchio import pin
from flexviz.model import FlexibleModel
from flexviz.robot import PayloadBody, Robot, load_settings
from flexviz.simulation import PDController, Plan, PlannedGroup, Sensors, perturbed

Array = NDArray[np.float64]

RECORD = 0.002  # [s]
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
        link_viscous, motor_viscous: ranges [Nm s/rad].
        reach: range of the motion to either side of its middle [rad].
        payload: range of masses [kg].
    """

    stiffness: tuple[float, ...]
    motor_inertia: tuple[float, ...]
    link_viscous: tuple[float, float]
    motor_viscous: tuple[float, float]
    reach: tuple[float, float]
    payload: tuple[float, float]


USUAL: dict[str, Usual] = {
    "2r": Usual((13500.0, 14500.0), (0.95, 0.95), (0.15, 0.45), (0.4, 0.8), (0.6, 1.3), (0.3, 2.5)),
    "ur5": Usual(
        (145e3, 133e3, 86e3, 31e3, 31e3, 23e3), (3.3, 2.3, 1.9, 0.33, 0.36, 0.28),
        (0.15, 0.45), (1.2, 3.2), (0.4, 0.9), (0.3, 2.5),
    ),
    "panda": Usual(
        (98e3, 107e3, 50e3, 55e3, 38e3, 27e3, 20e3), (0.6, 0.78, 0.39, 0.53, 0.27, 0.245, 0.187),
        (0.15, 0.45), (1.2, 3.6), (0.35, 0.8), (0.3, 2.0),
    ),
}  # fmt: skip


def random_plan(case: RobotCase, rng: np.random.Generator) -> Plan:
    """The robot of a case with its motions, payloads, controller and sensors."""
    usual = USUAL[case.robot]
    robot, source, files = _planar(rng) if case.robot == "2r" else _arm(case.robot)
    n = robot.n
    inertial = np.concatenate(
        [perturbed(row[None], rng.uniform(*CAD_ERRORS), rng) for row in robot.cad_parameters]
    )
    wide = rng.random() < WIDE
    spread = (np.log(1 / 3), np.log(3.0)) if wide else (np.log(0.75), np.log(1.35))
    stiffness = np.array(usual.stiffness) * np.exp(rng.uniform(*spread, n))
    spread = (np.log(0.5), np.log(2.0)) if wide else (np.log(0.65), np.log(1.4))
    motor = np.array(usual.motor_inertia) * np.exp(rng.uniform(*spread, n))
    model = FlexibleModel(
        robot.joints,
        stiffness,
        motor,
        rng.uniform(*usual.link_viscous, n),
        rng.uniform(*usual.motor_viscous, n),
        inertial,
    )
    payloads = _payloads(case.robot, usual.payload, rng)
    centre = np.zeros(n) if case.robot == "2r" else np.array(ARMS[case.robot][2])
    groups = tuple(
        PlannedGroup(
            name,
            trajectory,
            payload,
            random_motion(
                robot,
                rng,
                centre=centre + rng.uniform(-0.15, 0.15, n),
                reach=rng.uniform(*usual.reach, n),
                duration=case.duration,
            ),
            case.duration,
            RECORD,
            validation=name == GROUPS[-1][0],
        )
        for name, trajectory, payload in GROUPS
    )
    plan = Plan(
        name=case.robot,
        robot=robot,
        source=source,
        model=model,
        payloads=payloads,
        groups=groups,
        controller=_controller(robot, motor, centre, rng),
        sensors=Sensors(),
        initial_stiffness=_rough(stiffness, rng),
        initial_motor_inertia=_rough(motor, rng, 1.6),
        extra=False,
        files=files,
    )
    return replace(plan, sensors=_sensors(workload(plan).torque, rng))


def _planar(rng: np.random.Generator) -> tuple[Robot, str, dict[str, str]]:
    """A vertical planar arm and its URDF; masses, lengths and inertias are random."""
    length = rng.uniform(0.4, 0.6)  # [m]
    mass = rng.uniform((4.5, 3.0), (8.0, 5.0))
    centre = rng.uniform((0.18, 0.13), (0.28, 0.24))  # [m] along the link
    inertia = rng.uniform((0.25, 0.15), (0.6, 0.35))  # [kg m²]
    links = [tuple(map(float, link)) for link in zip(mass, centre, inertia, strict=True)]
    text = planar_urdf(length, 0.0, links)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / URDF).write_text(text, encoding="utf-8")
        return Robot.load(URDF, base=Path(folder)), URDF, {URDF: text}


def _arm(kind: str) -> tuple[Robot, str, dict[str, str]]:
    settings = load_settings(ARMS[kind][0])
    return Robot.load(settings.robot, settings.joints), settings.robot, {}


def _payloads(
    kind: str, masses: tuple[float, float], rng: np.random.Generator
) -> dict[str, tuple[PayloadBody, ...]]:
    """A payload for each group, the first often none; in some sets there is no payload at all."""
    bare = rng.random() < BARE
    out: dict[str, tuple[PayloadBody, ...]] = {}
    for name, empty in (("p1", 0.5), ("p2", 0.0), ("p3", 0.1)):
        mass, absent = float(f"{rng.uniform(*masses):.3g}"), rng.random() < empty
        if kind == "2r":
            link, com = "link2", (rng.uniform(0.2, 0.5), 0.0, rng.uniform(-0.05, 0.05))
        else:
            link, com = (
                ARMS[kind][1],
                (rng.uniform(-0.04, 0.04), rng.uniform(-0.04, 0.04), rng.uniform(0.03, 0.12)),
            )
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


def _rough(values: Array, rng: np.random.Generator, factor: float = 2.0) -> Array:
    """What somebody knows beforehand: within that factor, four digits."""
    guess = values * np.exp(rng.uniform(-np.log(factor), np.log(factor), len(values)))
    return np.array([float(f"{value:.4g}") for value in guess])
