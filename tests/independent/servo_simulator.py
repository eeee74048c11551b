"""Joints that follow goals, by MuJoCo: a truth that shares no code with the estimator.

The firmware's law, delay and friction are written down here once more; MuJoCo integrates the masses. Dry
friction is its `frictionloss`, whose size follows the load where it does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

STEP = 0.0005  # [s] of MuJoCo, and of the servos' own clock
COUNT = 2 * np.pi / 4096  # [rad] of the encoder

PENDULUM = """<robot name="pendulum"><link name="base"/>
<link name="rod"><inertial><origin xyz="0.08 0 0.01"/><mass value="{mass}"/>
<inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="{axis}"/>
<limit lower="-3" upper="3" effort="10" velocity="10"/></joint></robot>"""
"""A rod with a mass at .08 m: about a level axis gravity shows its scale, about an upright one nothing."""


@dataclass(frozen=True)
class Servo:
    """One joint's truth; what is None or 0 is absent."""

    gain: float = 10.0  # [Nm/rad]
    armature: float = 0.02  # [kg m²]
    viscous: float = 0.5  # [Nm s/rad]
    effects: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    def value(self, effect: str, absent: float = 0.0, k: int = 0) -> float:
        return self.effects[effect][k] if effect in self.effects else absent


def simulated(
    urdf: Path,
    joints: Sequence[str],
    servos: Sequence[Servo],
    goals: Callable[[float], np.ndarray],
    seconds: float,
    every: float,
) -> dict[str, np.ndarray]:
    """time (N,), theta_ref and theta (N, n) as a log has them, `every` so many seconds."""  # fmt: skip
    mujoco: Any = import_module("mujoco")  # late: the package is not needed to read this file
    spec = mujoco.MjSpec.from_file(str(urdf))
    spec.option.timestep, spec.option.integrator = STEP, mujoco.mjtIntegrator.mjINT_RK4
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT)
    for other in [joint for joint in spec.joints if joint.name not in joints]:
        spec.delete(other)  # locked, as in a set that does not list it
    for name, servo in zip(joints, servos, strict=True):
        joint = spec.joint(name)
        joint.armature = servo.armature
        joint.frictionloss = 1e-9  # so that the constraint exists
        joint.solimp_friction, joint.solref_friction = [0.99, 0.999, 1e-3, 0.5, 2], [0.004, 1.0]
    model = spec.compile()
    data = mujoco.MjData(model)
    at = np.array([model.joint(name).dofadr[0] for name in joints])
    for k, servo in zip(at, servos, strict=True):
        model.dof_damping[k] = servo.viscous
    per = round(every / STEP)
    gain = np.array([s.gain for s in servos])
    limit = np.array([s.value("torque_limit", np.inf) for s in servos])
    dead = np.array([s.value("dead_band") for s in servos])
    delay = np.array([round(s.value("goal_delay") / STEP) for s in servos])
    lag = np.array([s.value("goal_lag") for s in servos])
    speed = np.array([s.value("goal_speed_limit", np.inf) for s in servos])
    coulomb = np.array([s.value("coulomb_friction") for s in servos])
    load = np.array([s.value("load_dependent_friction") for s in servos])
    forth, back = (np.array([s.value("driving_friction", 0.0, k) for s in servos]) for k in (0, 1))
    stribeck, slow = (
        np.array([s.value("stribeck_friction", a, k) for s in servos]) for k, a in ((0, 0.0), (1, 1.0))
    )
    quadratic = np.array([s.value("quadratic_friction") for s in servos])
    offset = np.array([s.value("torque_offset") for s in servos])
    share = np.where(lag > 0, 1.0 - np.exp(-STEP / np.maximum(lag, 1e-9)), 1.0)
    data.qpos[at] = goals(0.0)
    wanted = goals(0.0).copy()
    sent: list[np.ndarray] = []
    rows = []
    force = np.zeros(model.nv)
    for k in range(round(seconds / STEP)):
        if k % per == 0:
            rows.append((k * STEP, goals(k * STEP), data.qpos[at].copy()))
        sent.append(rows[-1][1])
        goal = np.array([sent[max(k - d, 0)][j] for j, d in enumerate(delay)])
        wanted = wanted + np.clip(share * (goal - wanted), -speed * STEP, speed * STEP)
        away = wanted - data.qpos[at]
        torque = np.clip(gain * (away - np.clip(away, -dead, dead)), -limit, limit)
        mujoco.mj_rne(model, data, 1, force)
        carried, v = force[at], data.qvel[at]
        share_of = load + np.where(carried * v > 0, forth, back)
        model.dof_frictionloss[at] = (
            coulomb + share_of * np.abs(carried) + stribeck * np.exp(-((v / slow) ** 2)) + 1e-9
        )
        data.qfrc_applied[at] = torque - quadratic * v * np.abs(v) - offset
        mujoco.mj_step(model, data)
    time, ref, theta = (np.array(part) for part in zip(*rows, strict=True))
    return {"time": time, "theta_ref": ref, "theta": np.round(theta / COUNT) * COUNT}


def random_goals(seed: int, n: int, reach: float, fastest: float) -> Callable[[float], np.ndarray]:
    """Sums of sines between slow and fast, with rests: what a tester would send."""
    rng = np.random.default_rng(seed)
    hertz = rng.uniform(0.1, fastest, (6, n))
    size = rng.uniform(0.3, 1.0, (6, n)) / (0.5 + hertz)
    size *= reach / size.sum(axis=0)
    phase = rng.uniform(0, 2 * np.pi, (6, n))

    def goals(t: float) -> np.ndarray:
        ramp = min(1.0, t)
        return ramp * np.sum(size * np.sin(2 * np.pi * hertz * t + phase), axis=0)

    return goals
