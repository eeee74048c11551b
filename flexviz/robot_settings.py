"""Ready-made flexible-joint settings of robots: stiffness, motor inertia, friction, controller, sensors.

One TOML file per robot in `robots/`; lists have one value per joint, in the order of `joints`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from flexviz import toml
from flexviz.errors import InputError, choose_from
from flexviz.resources import robots_dir

SETTINGS: tuple[str, ...] = ("planar_2r", "panda", "ur5")


@dataclass(frozen=True, eq=False)
class RobotSettings:
    """Typical values of a robot with flexible joints, all at the joint side.

    Attributes:
        robot: argument of `Robot.load`.
        joints: names of the n joints.
        stiffness: (n,) [Nm/rad].
        motor_inertia: (n,) [kg m²].
        link_viscous_friction, motor_viscous_friction: (n,) [Nm s/rad].
        kp, kd: (n,) controller gains [Nm/rad], [Nm s/rad].
        cycle: controller cycle [s].
        theta_noise: (n,) standard deviation of the motor positions' noise [rad].
        torque_noise: (n,) standard deviation of the torques' noise [Nm].
    """

    name: str
    robot: str
    joints: tuple[str, ...]
    stiffness: np.ndarray
    motor_inertia: np.ndarray
    link_viscous_friction: np.ndarray
    motor_viscous_friction: np.ndarray
    kp: np.ndarray
    kd: np.ndarray
    cycle: float
    theta_noise: np.ndarray
    torque_noise: np.ndarray


def load_settings(name: str) -> RobotSettings:
    """The settings called "planar_2r", "panda" or "ur5"."""
    if name not in SETTINGS:
        raise InputError(f'settings "{name}" do not exist; {choose_from(name, SETTINGS)}')
    table = toml.read(robots_dir() / f"{name}.toml")
    joints = tuple(table.pop("joints"))
    values: dict[str, Any] = {key: np.array(x) if isinstance(x, list) else x for key, x in table.items()}
    return RobotSettings(name=name, joints=joints, **values)
