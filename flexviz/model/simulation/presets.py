"""Preset plans: the paper's groups A–F, and demonstrations with a planar arm and a Panda."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flexviz.base.facts import Fact
from flexviz.model.simulation.control import PDController
from flexviz.model.simulation.plan import Plan, PlannedGroup, four_groups
from flexviz.model.simulation.plant import Array
from flexviz.model.simulation.references import Sinusoid, random_fourier
from flexviz.model.simulation.sensors import Sensors
from flexviz.robot._pinocchio import pin
from flexviz.robot.model import FlexibleModel
from flexviz.robot.robot import PayloadBody, Robot
from flexviz.robot.robot_files import RobotSettings, load_settings

# Our reading of the paper's groups (its table is lost): trajectory-payload pairs.
PAPER_GROUPS: dict[str, tuple[str, ...]] = {
    "a": ("t1p1", "t2p2"),
    "b": ("t1p1", "t2p2", "t3p3"),
    "c": ("t1p1", "t2p1", "t3p3"),
    "d": ("t1p1", "t2p1", "t3p1"),
    "e": ("t1p2", "t2p2", "t3p2"),
    "f": ("t1p1",),
}
# One additional validation run with a pair that no fitted group has.
PAPER_VALIDATION = {"a": "t3p2", "b": "t3p2", "c": "t3p2", "d": "t3p2", "e": "t1p3", "f": "t3p2"}
PAPER_TRAJECTORIES = {"t1": (1.0, 0.5 * np.pi), "t2": (0.7, 0.3 * np.pi), "t3": (0.85, 0.4 * np.pi)}

# The paper's true values are lost. These were chosen near its start values; as there, they are regrouped
# about joint 1: Izz1 + l1² m2, mx1 + l1 m2, with l1 = 1 m.
PLANAR_TRUTH = {"izz1": 2.50, "mx1": 1.05, "my1": 0.02, "izz2": 1.42, "mx2": 0.40, "my2": 0.05}
PLANAR_NOTE = Fact("true-values", values={"from": "paper"})
PLANAR_STIFFNESS, PLANAR_MOTOR_INERTIA = np.array([900.0, 1000.0]), np.array([2.56, 1.49])  # rough
PLANAR_MASS = (0.60, 0.75)  # [kg] of the two links; the motion does not show how the values above are split

DURATION = 12.0  # [s] of a group of the demonstrations


def planar_inertial() -> Array:
    """(2, 10) true inertial parameters of the planar arm."""
    t, (m1, m2) = PLANAR_TRUTH, PLANAR_MASS
    izz1, mx1 = t["izz1"] - m2, t["mx1"] - m2  # l1 = 1 m
    return np.array(
        [  #  m  mx         my        mz   Ixx   Ixy     Iyy   Ixz  Iyz  Izz
            [m1, mx1, t["my1"], 0.0, 0.60, -0.01, 1.30, 0.0, 0.0, izz1],
            [m2, t["mx2"], t["my2"], 0.0, 0.50, -0.03, 1.10, 0.0, 0.0, t["izz2"]],
        ]
    )


def paper_payloads() -> dict[str, tuple[PayloadBody, ...]]:
    """Bodies that change the regrouped [Izz1, mx1, my1, Izz2, mx2, my2] by the paper's P1, P2, P3.

    P2 = [2, 2, 0, 1, 1, 0]: a point mass on each link. P3 = [4, 2, 0, 2, 2, 0]: a point mass on link 2 and a
    ring around the axis of joint 1.
    """
    point = [0.0] * 6
    return {
        "p1": (),
        "p2": (
            PayloadBody("link2", 1.0, [1.0, 0.0, 0.0], point),
            PayloadBody("link1", 1.0, [1.0, 0.0, 0.0], point),
        ),
        "p3": (
            PayloadBody("link2", 2.0, [1.0, 0.0, 0.0], point),
            PayloadBody("link1", 1.0, [0.0, 0.0, 0.0], [1.0, 1.0, 2.0, 0.0, 0.0, 0.0]),
        ),
    }


def paper(letter: str) -> Plan:
    """One of the paper's groups A–F: 10 s, recorded every 0.25 ms, noise in the record only."""
    settings = load_settings("planar_2r")
    robot = Robot.load(settings.robot, settings.joints)
    names = (*PAPER_GROUPS[letter], PAPER_VALIDATION[letter])
    groups = tuple(
        PlannedGroup(
            name,
            name[:2],
            name[2:],
            Sinusoid(*PAPER_TRAJECTORIES[name[:2]]),
            duration=10.0,
            validation=name not in PAPER_GROUPS[letter],
        )
        for name in names
    )
    return _plan(
        f"paper-{letter}",
        settings,
        robot,
        planar_inertial(),
        paper_payloads(),
        groups,
        (PLANAR_STIFFNESS, PLANAR_MOTOR_INERTIA),
        PLANAR_NOTE,
    )


def planar_2r() -> Plan:
    """The planar arm on smooth random motions with three payloads, recorded at 1 kHz."""
    settings = load_settings("planar_2r")
    robot = Robot.load(settings.robot, settings.joints)
    sphere = [0.004, 0.004, 0.004, 0.0, 0.0, 0.0]
    payloads = {
        "p1": (),
        "p2": (PayloadBody("link2", 0.8, [0.8, 0.0, 0.0], sphere),),
        "p3": (PayloadBody("link2", 1.6, [0.6, 0.05, 0.0], sphere),),
    }
    motions = [
        random_fourier(
            robot,
            seed,
            centre=[0.4, -0.6],
            reach=[1.1, 1.4],
            duration=DURATION,
            frequency=2 * np.pi / DURATION,
            harmonics=6,
        )
        for seed in (11, 14, 26, 22)
    ]
    groups = four_groups(motions, DURATION, validation_payload="p2")
    initial = (PLANAR_STIFFNESS, PLANAR_MOTOR_INERTIA)
    plan = _plan("planar-2r", settings, robot, planar_inertial(), payloads, groups, initial, PLANAR_NOTE)
    return replace(plan, single=True)


def panda() -> Plan:
    """A Panda with three payloads; its URDF's inertias are about 15 % away from the true ones."""
    settings = load_settings("panda")
    robot = Robot.load(settings.robot, settings.joints)
    payloads = {
        "p1": (),
        "p2": (PayloadBody("panda_hand", 1.2, [0.02, 0.0, 0.10], [0.003, 0.003, 0.003, 0.0, 0.0, 0.0]),),
        "p3": (PayloadBody("panda_hand", 2.4, [0.05, 0.02, 0.12], [0.008, 0.008, 0.008, 0.0, 0.0, 0.0]),),
    }
    motions = [
        random_fourier(
            robot,
            seed,
            centre=[0.0, -0.3, 0.0, -1.9, 0.0, 1.8, 0.6],
            reach=[0.9, 0.7, 0.9, 0.7, 1.0, 0.9, 1.2],
            duration=DURATION,
            harmonics=6,
        )
        for seed in (21, 22, 23, 24)
    ]
    groups = four_groups(motions, DURATION, validation_payload="p3")
    rng = np.random.default_rng(2024)
    inertial = perturbed(robot.cad_parameters, 0.15, rng)
    initial = (rough(settings.stiffness, 0.3, rng), rough(settings.motor_inertia, 0.3, rng))
    note = Fact("true-values", values={"from": "demonstration"})
    return replace(_plan("panda", settings, robot, inertial, payloads, groups, initial, note), single=True)


def perturbed(inertial: Array, share: float, rng: np.random.Generator) -> Array:
    """Inertial parameters (n, 10) of bodies whose mass, centre and inertia are `share` away from `inertial`.

    Masses and inertias are scaled, centres of mass moved radially, so the bodies stay physically consistent.
    """
    new = []
    for row in np.asarray(inertial, dtype=float):
        mass, centre, inertia = 1.0 + share * rng.choice([-1.0, 1.0], 3)
        body = pin.Inertia.FromDynamicParameters(row)
        body = pin.Inertia(mass * body.mass, centre * body.lever, inertia * body.inertia)
        new.append(body.toDynamicParameters())
    return np.array(new)


def rough(values: Array, share: float, rng: np.random.Generator) -> Array:
    """Values with random errors of up to `share`, to three digits."""
    guess = values * (1.0 + share * rng.uniform(-1.0, 1.0, len(values)))
    return np.array([float(f"{x:.3g}") for x in guess])


PRESETS: dict[str, Callable[[], Plan]] = {
    **{f"paper-{letter}": (lambda letter=letter: paper(letter)) for letter in PAPER_GROUPS},
    "planar-2r": planar_2r,
    "panda": panda,
}


def _plan(
    name: str,
    settings: RobotSettings,
    robot: Robot,
    inertial: Array,
    payloads: dict[str, tuple[PayloadBody, ...]],
    groups: tuple[PlannedGroup, ...],
    initial: tuple[Array, Array],
    note: Fact,
) -> Plan:
    """The plan of a robot with its usual settings; `initial` are rough stiffness and motor inertia."""
    return Plan(
        name=name,
        robot=robot,
        source=settings.robot,
        model=FlexibleModel(
            settings.joints,
            settings.stiffness,
            settings.motor_inertia,
            settings.link_viscous_friction,
            settings.motor_viscous_friction,
            inertial,
        ),
        payloads=payloads,
        groups=groups,
        controller=PDController(settings.kp, settings.kd, settings.cycle),
        sensors=Sensors(settings.theta_noise, settings.torque_noise),
        initial_stiffness=initial[0],
        initial_motor_inertia=initial[1],
        note=note,
    )
