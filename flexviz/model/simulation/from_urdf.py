"""A plan for a robot known by its URDF only, with parameters proportional to its inertia."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.model.simulation.control import PDController
from flexviz.model.simulation.plan import Plan, four_groups
from flexviz.model.simulation.plant import Array
from flexviz.model.simulation.presets import rough
from flexviz.model.simulation.references import Fourier, random_fourier
from flexviz.model.simulation.resimulating import inertia_along, position_gains, proportional
from flexviz.model.simulation.sensors import Sensors
from flexviz.robot.model import FlexibleModel
from flexviz.robot.robot import PayloadBody, Robot
from flexviz.robot.robot_files import mesh_names, resolve_mesh

DURATION = 12.0  # [s] of each group
LARGEST_REACH = 1.0  # [rad] or [m] of a joint to either side of its middle
WIDEST_RANGE = 20.0  # [rad] or [m]; wider joint limits count as none
CYCLE = 0.00025  # [s] of the controller
THETA_NOISE = 2e-5  # [rad] standard deviation of the encoders' noise
PAYLOAD_SHARES = (0.05, 0.1)  # of the arm's mass
SEEDS = (31, 32, 33, 34)  # of the trajectories


def plan_from_urdf(urdf: str | Path) -> Plan:
    """Four groups with three payloads on smooth random motions within the URDF's limits.

    Stiffness, motor inertia, friction and controller are plausible values proportional to the inertia, not
    those of a real robot. The URDF and the meshes in its folder become files of the set.

    Raises:
        InputError: the URDF cannot be read or has no inertia, or the limits of a joint are too narrow.
    """
    path = Path(urdf)
    robot = Robot.load(path)
    middle, reach = room(robot)
    motions = [
        random_fourier(robot, seed, centre=middle, reach=reach, duration=DURATION, harmonics=6)
        for seed in SEEDS
    ]
    inertia = inertia_along(robot, [sampled(motion) for motion in motions])
    mass = float(robot.cad_parameters[:, 0].sum())
    if mass <= 0 or not np.all(np.isfinite(inertia)) or inertia.max() <= 0:
        raise InputError("the URDF gives no inertia: <inertial> in every moving link is needed", file=path)
    stiffness, motor_inertia, friction = proportional(inertia)
    kp, kd = position_gains(inertia, motor_inertia)
    torque = np.abs(stiffness) * 1e-3  # [Nm] of a deflection of a thousandth
    rng = np.random.default_rng(2024)
    return Plan(
        name=path.stem,
        robot=robot,
        source=path.name,
        model=FlexibleModel(robot.joints, stiffness, motor_inertia, friction, friction, robot.cad_parameters),
        payloads=payloads(robot, mass),
        groups=four_groups(motions, DURATION, validation_payload="p2"),
        controller=PDController(kp, kd, CYCLE),
        sensors=Sensors(np.full(robot.n, THETA_NOISE), 0.02 * torque),
        initial_stiffness=rough(stiffness, 0.3, rng),
        initial_motor_inertia=rough(motor_inertia, 0.3, rng),
        note=Fact("true-values", values={"from": "urdf"}),
        single=True,
        files={path.name: path.read_text(encoding="utf-8"), **meshes(robot, path)},
    )


def room(robot: Robot) -> tuple[Array, Array]:
    """Middle of each joint's motion and its reach to either side, (n,) each [rad]."""
    low, high = np.asarray(robot.lower_limit), np.asarray(robot.upper_limit)
    free = ~np.isfinite(high - low) | (high - low > WIDEST_RANGE)
    middle = np.where(free, 0.0, 0.5 * (low + high))
    reach = np.where(free, LARGEST_REACH, np.minimum(0.4 * (high - low), LARGEST_REACH))
    for joint, far in zip(robot.joints, reach, strict=True):
        if far < 0.05:
            raise InputError(
                f'joint "{joint}" can move less than 0.05 rad to either side, expected wider limits',
                file=robot.urdf_path,
            )
    return middle, reach


def sampled(motion: Fourier) -> Array:
    """(20, n) positions along a motion [rad]."""
    return motion.sample(np.linspace(0.0, DURATION, 20))[0]


def payloads(robot: Robot, mass: float) -> dict[str, tuple[PayloadBody, ...]]:
    """No payload, and two balls on the last link with `PAYLOAD_SHARES` of the arm's `mass` [kg]."""
    last = max(range(robot.n), key=lambda joint: int(robot.order[joint]))
    link = next(name for name in robot.links if robot.joint_of_link(name) == last)
    found: dict[str, tuple[PayloadBody, ...]] = {"p1": ()}
    for number, share in enumerate(PAYLOAD_SHARES, start=2):
        weight = float(f"{share * mass:.2g}")
        size = 0.4 * weight * 0.05**2  # of a ball with a radius of 5 cm
        body = PayloadBody(link, weight, [0.05 * number, 0.0, 0.05], [size, size, size, 0.0, 0.0, 0.0])
        found[f"p{number}"] = (body,)
    return found


def meshes(robot: Robot, path: Path) -> dict[str, Path]:
    """The meshes in the URDF's folder, by their path in it; others are referenced where they are."""
    found: dict[str, Path] = {}
    for name in mesh_names(robot.urdf):
        try:
            mesh = resolve_mesh(name, path).resolve()
            found[mesh.relative_to(path.parent.resolve()).as_posix()] = mesh
        except (InputError, ValueError):
            continue
    return found
