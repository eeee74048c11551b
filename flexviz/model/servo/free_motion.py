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
        _Integration(motion, values[:, here], turn).run(out[here])
    return out


class _Integration:
    """Few variants of all stretches at once: V variants of n joints of C stretches."""

    def __init__(self, motion: DrivenMotion, values: Array, turn: float) -> None:
        self.motion = motion
        _, n, C = motion.goal.shape
        self.p = p = {name: values[k][:, :, None] for name, k in INDEX.items()}
        self.used = {name for name, k in INDEX.items() if np.any(values[k] != ABSENT[k])}
        self.full = full = np.zeros((values.shape[1], n, C))
        self.dt, self.sub = _steps(motion, p, turn)
        self.gain = p["gain"] * motion.scale + full
        self.limit, self.dead = p["torque_limit.limit"] + full, p["dead_band.half_width"] + full
        self.least = -self.limit
        self.limited, self.banded = "torque_limit.limit" in self.used, "dead_band.half_width" in self.used
        self.drag = "quadratic_friction.quadratic" in self.used
        self.mass = p["motor_inertia"] + 0.5 * self.dt * p["motor_viscous_friction"]
        self.goals = _Goals(motion, p, self.used, self.dt, self.sub, full)
        theta = 0.5 * (motion.theta[1:] + motion.theta[:-1])
        self.away = 0.5 * (motion.rest[1:] + motion.rest[:-1]) - motion.slope[:-1] * theta
        self.load = 0.5 * (motion.load[1:] + motion.load[:-1])
        self.dry_friction()
        self.q = np.broadcast_to(motion.theta[0], full.shape).copy()
        self.w = np.broadcast_to(motion.speed, full.shape).copy()
        self.e, self.f, self.held, self.slope, self.middle = (np.empty_like(full) for _ in range(5))

    def dry_friction(self) -> None:
        """Which variants have friction that changes with speed or load."""
        p, full = self.p, self.full
        stribeck, velocity = p["stribeck_friction.stribeck"], p["stribeck_friction.velocity"]
        motor, back = p["driving_friction.motor_driving"], p["driving_friction.load_driving"]
        self.curved = np.flatnonzero(stribeck.any(axis=(1, 2)))
        self.driving = np.flatnonzero((motor + back).any(axis=(1, 2)))
        self.stribeck, self.inverse = stribeck[self.curved], 1.0 / velocity[self.curved]
        self.motor, self.back = motor[self.driving], back[self.driving]
        self.coulomb = p["coulomb_friction.coulomb"] + full
        self.loaded = "load_dependent_friction.coefficient" in self.used

    def run(self, out: Array) -> None:
        """Write θ (V, T, n, C)."""
        half, e, q, w = 0.5 * self.dt, self.e, self.q, self.w
        for i in range(out.shape[1]):
            out[:, i] = q
            if i + 1 == out.shape[1]:
                break
            self.sample(i)
            np.multiply(w, half, out=e)
            q += e  # forces are those of the middle of a step
            for _ in range(self.sub):
                self.step()
            np.multiply(w, half, out=e)
            q -= e

    def sample(self, i: int) -> None:
        """What holds until the next sample."""
        motion, p = self.motion, self.p
        self.goals.next(i)
        self.push = self.dt / (motion.own[i] + self.mass)
        self.keeps = 1.0 - p["motor_viscous_friction"] * self.push
        np.add(motion.slope[i], p["cable_spring.stiffness"], out=self.slope)
        np.add(self.away[i], p["gain"] * p["torque_offset.offset"], out=self.middle)
        size = np.abs(self.load[i])
        more = p["load_dependent_friction.coefficient"] * size if self.loaded else 0.0
        self.dry = (self.coulomb + more) * self.push
        self.rough, self.rubs = self.push[self.curved] * self.stribeck, self.push[self.driving] * size
        self.carried = self.load[i]

    def step(self) -> None:
        """One step of the velocity, and one of the angle."""
        e, f, q, w = self.e, self.f, self.q, self.w
        np.subtract(self.goals.middle(), q, out=e)
        if self.banded:
            e -= np.maximum(np.minimum(e, self.dead), -self.dead)
        np.multiply(self.gain, e, out=f)
        if self.limited:
            np.minimum(f, self.limit, out=f)
            np.maximum(f, self.least, out=f)
        f -= self.middle
        np.multiply(self.slope, q, out=e)
        f -= e
        f *= self.push
        w *= self.keeps
        w += f
        if self.drag:
            w /= 1.0 + self.push * self.p["quadratic_friction.quadratic"] * np.abs(w)
        total = self.friction()
        np.minimum(w, total, out=self.held)
        np.negative(total, out=e)
        np.maximum(self.held, e, out=self.held)
        w -= self.held
        np.multiply(w, self.dt, out=e)
        q += e

    def friction(self) -> Array:
        """By how much dry friction may slow each joint in a step (V, n, C) [rad/s]."""
        if not (len(self.curved) or len(self.driving)):
            return self.dry
        total, w = self.dry.copy(), self.w
        total[self.curved] += self.rough * np.exp(-np.square(w[self.curved] * self.inverse))
        forth = w[self.driving] * self.carried > 0
        total[self.driving] += self.rubs * np.where(forth, self.motor, self.back)
        return total


def _steps(motion: DrivenMotion, p: dict[str, Array], turn: float) -> tuple[Array | float, int]:
    """Length of a step [s], a number or (C,), and how many there are between samples."""
    stiff = p["gain"] * motion.scale / (p["motor_inertia"] + motion.own.min(axis=(0, 2))[:, None])
    longest = min(LONGEST, turn / float(np.sqrt(np.median(stiff))))
    step = motion.step if np.ptp(motion.step) > 1e-9 else float(motion.step[0])
    sub = int(np.ceil(np.max(step) / longest - 1e-9))
    return step / sub, sub


class _Goals:
    """The goals as the servos see them."""

    def __init__(
        self,
        motion: DrivenMotion,
        p: dict[str, Array],
        used: set[str],
        dt: Array | float,
        steps: int,
        full: Array,
    ) -> None:
        lag, speed = p["goal_lag.time_constant"], p["goal_speed_limit.speed"]
        # the variants of which a joint follows its goal through a low-pass, or no faster than a limit
        self.following = f = np.flatnonzero(((lag > 0) | np.isfinite(speed)).any(axis=(1, 2)))
        self.late = "goal_delay.delay" in used
        self.first, n, C = motion.before.shape
        self.goal = motion.goal
        if self.late or len(f):  # the goals before a stretch act in it
            self.goal = np.concatenate((motion.before, motion.goal))
        else:
            self.first = 0
        self.rows, self.columns = np.arange(n)[:, None], np.arange(C)
        delay = p["goal_delay.delay"] / motion.step  # (V, n, C) samples
        self.whole = np.floor(delay).astype(int)
        self.part = delay - self.whole
        self.share = (1.0 - np.exp(-0.5 * dt / np.maximum(lag, 1e-9)) + full)[f]
        self.reach = (speed * (0.5 * dt) + full)[f]
        self.back, self.limited = -self.reach, bool(np.isfinite(self.reach).any())
        self.seen, self.now, self.within = full.copy(), full, False
        self.ahead, self.aim = (np.broadcast_to(self.goal[0], self.share.shape).copy() for _ in range(2))
        self.way = np.empty_like(self.ahead)
        for i in range(-self.first, 0) if len(f) else ():
            self.next(i)
            for _ in range(steps):
                self.middle()

    def next(self, i: int) -> None:
        """Sample i arrives."""
        i += self.first
        now = self.goal[i]
        if self.late:
            at, before = np.maximum(i - self.whole, 0), np.maximum(i - self.whole - 1, 0)
            now = self.goal[at, self.rows, self.columns]
            now += self.part * (self.goal[before, self.rows, self.columns] - now)
        np.copyto(self.seen, now)
        if len(self.following):
            if self.within:
                self.half_a_step()
            np.copyto(self.aim, self.seen[self.following])
            self.within = False

    def middle(self) -> Array:
        """(V, n, C) [rad] in the middle of a step."""
        if len(self.following):
            for _ in range(1 + self.within):
                self.half_a_step()
            self.within = True
            self.seen[self.following] = self.ahead
        return self.seen

    def half_a_step(self) -> None:
        """Follow the goal through the low-pass, no faster than the limit."""
        way = np.subtract(self.aim, self.ahead, out=self.way)
        way *= self.share
        if self.limited:
            np.minimum(way, self.reach, out=way)
            np.maximum(way, self.back, out=way)
        self.ahead += way
