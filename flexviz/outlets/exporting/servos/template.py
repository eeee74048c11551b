"""Servos that follow goals in MuJoCo: the template of the Python file next to an exported model.

What stands above "code:" is an example, replaced by the robot's own. flexviz itself does not use this module.
"""

from __future__ import annotations

from typing import Any

import numpy as np

mujoco: Any = None  # in the exported file, the package

JOINTS = ("joint1",)
DELAY = np.array([0.02])
TIME_CONSTANT = np.array([0.03])
SPEED = np.array([1.5])
HALF_WIDTH = np.array([0.005])
COULOMB = np.array([0.1])
MOTOR_DRIVING = np.array([0.1])
LOAD_DRIVING = np.array([0.1])

# code:


class Servos:
    """The servos of a simulation; goals (n,) [rad] are in the order of JOINTS.

    The joints' positions in `data` are those at the beginning, and `goals` what they follow then.
    """

    def __init__(self, model: Any, data: Any, goals: Any) -> None:
        self.model, self.data = model, data
        joints = [model.joint(name) for name in JOINTS]
        self.position = np.array([joint.qposadr[0] for joint in joints])
        self.velocity = np.array([joint.dofadr[0] for joint in joints])
        self.actuators = [model.actuator(name).id for name in JOINTS]
        self.ctrl = model.actuator_ctrladr[self.actuators]
        goals = np.array(goals, dtype=float)
        for actuator, goal in zip(self.actuators, goals, strict=True):
            if model.actuator_actadr[actuator] >= 0:
                data.act[model.actuator_actadr[actuator]] = goal
            if model.actuator_delay[actuator] > 0.0:
                samples = np.full(model.actuator_history[actuator][0], goal)
                mujoco.mj_initCtrlHistory(model, data, actuator, None, samples)
        self.late = DELAY / model.opt.timestep  # [steps]
        self.sent = np.tile(goals, (int(self.late.max()) + 2, 1))  # the last goals, the latest first
        self.followed = goals
        self.force = np.zeros(model.nv)

    def step(self, goals: Any) -> None:
        """One step of the simulation, instead of `mujoco.mj_step`."""
        self.data.ctrl[self.ctrl] = self.targets(np.asarray(goals, dtype=float))
        loaded = (MOTOR_DRIVING != 0.0) | (LOAD_DRIVING != 0.0)
        if loaded.any():
            self.model.dof_frictionloss[self.velocity[loaded]] = self.friction()[loaded]
        mujoco.mj_step(self.model, self.data)

    def targets(self, goals: Any) -> Any:
        """What the actuators follow, (n,) [rad]: delay, low-pass or speed limit, and dead band."""
        step, joints = self.model.opt.timestep, np.arange(len(JOINTS))
        self.sent = np.vstack((goals, self.sent[:-1]))
        whole = self.late.astype(int)
        now, before = self.sent[whole, joints], self.sent[whole + 1, joints]
        late = now + (self.late - whole) * (before - now)
        share = np.where(TIME_CONSTANT > 0.0, 1.0 - np.exp(-step / np.maximum(TIME_CONSTANT, 1e-9)), 1.0)
        reach = SPEED * step
        self.followed = self.followed + np.clip(share * (late - self.followed), -reach, reach)
        away = self.followed - self.data.qpos[self.position]
        return self.followed - np.clip(away, -HALF_WIDTH, HALF_WIDTH)

    def friction(self) -> Any:
        """Dry friction (n,) [Nm]: it grows with the torque that a joint transmits to the links."""
        mujoco.mj_rne(self.model, self.data, 1, self.force)
        load = self.force[self.velocity]
        forth = load * self.data.qvel[self.velocity] > 0.0
        return COULOMB + np.where(forth, MOTOR_DRIVING, LOAD_DRIVING) * np.abs(load)
