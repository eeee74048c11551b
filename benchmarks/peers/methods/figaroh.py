"""FIGAROH 1.x: rigid identification, weighted least squares, with friction, motor inertia and offsets."""

from __future__ import annotations

import logging
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from benchmarks.peers.derivatives import differences, inner, rigid_band, smooth, torque_at_samples
from benchmarks.peers.problem import OFFSET, Array, Group, Problem, answer
from benchmarks.peers.rigid import RigidModel

BaseIdentification: Any = import_module("figaroh.identification.base_identification").BaseIdentification
load_robot: Any = import_module("figaroh.tools.load_robot").load_robot

HERTZ = 20.0  # of the filter on angles and torques
EVERY = 0.02  # [s]


class Arm(BaseIdentification):
    """FIGAROH wants a subclass that provides the data; here filtered group by group, payload subtracted."""

    def __init__(self, robot: Any, config: str, problem: Problem) -> None:
        self.problem = problem
        super().__init__(robot, config)
        for name in ("act_idxq", "act_idxv"):  # as its own examples do
            self.identif_config[name] = list(range(problem.n))

    def load_trajectory_data(self, data_source: str | None = None) -> dict[str, Array]:
        """All groups, one after the other."""
        parts = [signals(RigidModel(self.problem), group) for group in self.problem.fitted]
        joined = [np.concatenate(part) for part in zip(*parts, strict=True)]
        names = "timestamps", "positions", "velocities", "accelerations", "torques"
        return dict(zip(names, joined, strict=True))

    def filter_kinematics_data(self, filter_config: Any = None) -> None:
        """Done before: the package's filter would run over the joins between groups."""
        self.processed_data = dict(self.raw_data)


def signals(model: RigidModel, group: Group) -> tuple[Array, ...]:
    """Time, q, q̇, q̈ and torque without the payload's."""
    step, kept = group.step, inner(group, EVERY)
    q, v, a = (x[kept] for x in differences(smooth(group.theta, HERTZ, step), 2, step))
    tau = smooth(torque_at_samples(group, model.problem.hold), HERTZ, step)[kept]
    return group.time[kept], q, v, a, tau - model.payload_torque(group, model.regressor(q, v, a))


def configuration(problem: Problem) -> dict[str, Any]:
    """The package's unified configuration."""
    components = {"friction": True, "actuator_inertia": True, "joint_offset": OFFSET in problem.effects}
    zeros = [0.0] * problem.n
    mechanics = {
        "friction_coefficients": {"viscous": zeros, "static": zeros},
        "actuator_inertias": zeros,
        "joint_offsets": zeros,
        "reduction_ratios": [1.0] * problem.n,
    }
    identification = {
        "enabled": True,
        "problem": {"use_joint_torques": True, "wls": True, "model_components": components},
        "signal_processing": {"sampling_frequency": 1 / EVERY, "cutoff_frequency": HERTZ},
    }
    properties = {"joints": {"active_joints": list(problem.joints)}, "mechanics": mechanics}
    return {
        "robot": {"name": "arm", "properties": properties},
        "tasks": {"identification": identification},
    }


def estimate(problem: Problem) -> dict[str, Any]:
    """Base parameters by weighted least squares; what is not in the base is left at zero."""
    logging.disable(logging.WARNING)
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "arm.yaml"
        config.write_text(yaml.safe_dump(configuration(problem)), encoding="utf-8")
        robot = load_robot(str(problem.urdf), load_by_urdf=True)
        arm = Arm(robot, str(config), problem)
    arm.initialize()
    factor = round(0.4 / EVERY / rigid_band(problem))  # its anti-aliasing filter is the parallel filter
    arm.solve(decimation_factor=factor, plotting=False, wls=True)
    columns = np.delete(np.arange(arm.dynamic_regressor.shape[1]), arm._idx_eliminated)
    x = np.zeros(arm.dynamic_regressor.shape[1])
    x[columns[list(arm._base_indices)]] = arm.phi_base
    n = problem.n
    inertial, viscous, static, motor, *offset = np.split(x, [10 * n, 11 * n, 12 * n, 13 * n])
    return answer(
        problem,
        stiffness=None,
        motor_inertia=motor,
        viscous=(np.zeros(n), viscous),
        inertial=inertial.reshape(n, 10),
        coulomb=static,
        offset=offset[0] if OFFSET in problem.effects else None,
        evaluations=1,
    )
