"""Free motion of joints from their goals alone.

    (M_jj + B) θ̈ = u − h_j − f_v θ̇ − f,    u = kp · dead(goal(t − d) − θ) within ± limit

h_j is what the masses do to the joint along the measured motion of the others, and its change with the
joint's own angle. Dry friction holds a joint at rest up to its size. Steps of second order: half a step of
the angle, one of the velocity with viscous friction by the trapezoidal rule, half a step of the angle.
"""

from __future__ import annotations

import numpy as np

from flexviz.base.arrays import Array
from flexviz.model.servo.driven_motion import DrivenMotion
from flexviz.model.servo.parameters import ABSENT, INDEX

LONGEST = 0.005  # [s] of a step
AT_ONCE = 16_000  # joints of stretches of variants, whose states stay in the processor's cache
TURN = 0.3  # [rad] of the servo's own vibration in a step


def free_motion(motion: DrivenMotion, values: Array, turn: float = TURN) -> Array:
    """θ (V, T, n, C) [rad] of joints with parameters `values` (P, V, n), from the measured first state.

    `turn`: [rad] of the servo's own vibration in a step of the integration.
    """
    V, (T, n, C) = values.shape[1], motion.goal.shape
    out = np.empty((V, T, n, C))
    count = max(1, AT_ONCE // (n * C))
    for at in range(0, V, count):
        here = slice(at, at + count)
        _integrate(motion, values[:, here], out[here], turn)
    return out


def _integrate(motion: DrivenMotion, values: Array, out: Array, turn: float) -> None:
    """The same of few variants."""
    p = {name: values[k][:, :, None] for name, k in INDEX.items()}
    used = {name for name, k in INDEX.items() if np.any(values[k] != ABSENT[k])}
    V, T, n, C = out.shape
    full = np.zeros((V, n, C))
    dt, sub = _steps(motion, p, turn)
    gain, offset = p["gain"] * motion.scale + full, p["gain"] * p["torque_offset.offset"]
    limit, dead = p["torque_limit.limit"] + full, p["dead_band.half_width"] + full
    least = -limit
    limited, banded = "torque_limit.limit" in used, "dead_band.half_width" in used
    stribeck, inverse = p["stribeck_friction.stribeck"], 1.0 / p["stribeck_friction.velocity"]
    curved = np.flatnonzero(stribeck.any(axis=(1, 2)))
    quadratic, drag = p["quadratic_friction.quadratic"], "quadratic_friction.quadratic" in used
    motor, back = p["driving_friction.motor_driving"], p["driving_friction.load_driving"]
    driving = np.flatnonzero((motor + back).any(axis=(1, 2)))
    stribeck, inverse, motor, back = stribeck[curved], inverse[curved], motor[driving], back[driving]
    varies = bool(len(curved) or len(driving))
    coulomb, loaded = p["coulomb_friction.coulomb"], "load_dependent_friction.coefficient" in used
    load, spring = p["load_dependent_friction.coefficient"], p["cable_spring.stiffness"]
    viscous = p["motor_viscous_friction"]
    mass = p["motor_inertia"] + 0.5 * dt * viscous
    goals = _Goals(motion, p, used)
    share = 1.0 - np.exp(-dt / np.maximum(p["goal_lag.time_constant"], 1e-9)) + full
    reach = p["goal_speed_limit.speed"] * dt + full
    slowest = -reach
    q = np.broadcast_to(motion.theta[0], (V, n, C)).copy()
    w = np.broadcast_to(motion.speed, (V, n, C)).copy()
    e, f, held, slope, middle, goal, ramp = (np.empty_like(q) for _ in range(7))
    away = 0.5 * (motion.rest[1:] + motion.rest[:-1]) - motion.slope[:-1] * 0.5 * (
        motion.theta[1:] + motion.theta[:-1]
    )
    load_torque = 0.5 * (motion.load[1:] + motion.load[:-1])
    size = np.abs(load_torque)
    for i in range(T):
        out[:, i] = q
        if i + 1 == T:
            break
        now = goals.at(i)
        push = dt / (motion.own[i] + mass)
        keeps = 1.0 - viscous * push
        np.add(motion.slope[i], spring, out=slope)
        np.add(away[i], offset, out=middle)
        if i == 0 or not goals.follows:
            np.copyto(goal, now)
        dry = (coulomb + load * size[i] if loaded else coulomb) * push
        rough, rubs = push[curved] * stribeck, push[driving] * size[i]
        np.multiply(w, 0.5 * dt, out=e)
        q += e  # forces are those of the middle of a step
        for _ in range(sub):
            if goals.follows:
                np.subtract(now, goal, out=e)
                e *= share
                np.minimum(e, reach, out=e)
                np.maximum(e, slowest, out=e)
                e *= 0.5
                goal += e  # in the middle of the step
                np.copyto(ramp, e)
            np.subtract(goal, q, out=e)
            if banded:
                e -= np.clip(e, -dead, dead)
            np.multiply(gain, e, out=f)
            if limited:
                np.minimum(f, limit, out=f)
                np.maximum(f, least, out=f)
            f -= middle
            np.multiply(slope, q, out=e)
            f -= e
            f *= push
            w *= keeps
            w += f
            if drag:
                w /= 1.0 + push * quadratic * np.abs(w)
            total = dry
            if varies:
                total = dry.copy()
                total[curved] += rough * np.exp(-np.square(w[curved] * inverse))
                total[driving] += rubs * np.where(w[driving] * load_torque[i] > 0, motor, back)
            np.minimum(w, total, out=held)
            np.negative(total, out=e)
            np.maximum(held, e, out=held)
            w -= held
            np.multiply(w, dt, out=e)
            q += e
            if goals.follows:
                goal += ramp
        np.multiply(w, 0.5 * dt, out=e)
        q -= e


def _steps(motion: DrivenMotion, p: dict[str, Array], turn: float) -> tuple[Array | float, int]:
    """Length of a step [s], a number or (C,), and how many there are between samples."""
    stiff = p["gain"] * motion.scale / (p["motor_inertia"] + motion.own.min(axis=(0, 2))[:, None])
    longest = min(LONGEST, turn / float(np.sqrt(np.median(stiff))))
    step = motion.step if np.ptp(motion.step) > 1e-9 else float(motion.step[0])
    sub = int(np.ceil(np.max(step) / longest - 1e-9))
    return step / sub, sub


class _Goals:
    """The goals as the servos see them, sample by sample."""

    def __init__(self, motion: DrivenMotion, p: dict[str, Array], used: set[str]) -> None:
        self.goal = motion.goal
        self.late = "goal_delay.delay" in used
        self.follows = not used.isdisjoint(("goal_lag.time_constant", "goal_speed_limit.speed"))
        _, n, C = motion.goal.shape
        self.rows, self.columns = np.arange(n)[:, None], np.arange(C)
        delay = p["goal_delay.delay"] / motion.step  # (V, n, C) samples
        self.whole = np.floor(delay).astype(int)
        self.part = delay - self.whole

    def at(self, i: int) -> Array:
        """(V, n, C) or (n, C) [rad]."""
        now = self.goal[i]
        if self.late:
            at, before = np.maximum(i - self.whole, 0), np.maximum(i - self.whole - 1, 0)
            now = self.goal[at, self.rows, self.columns]
            now += self.part * (self.goal[before, self.rows, self.columns] - now)
        return now
