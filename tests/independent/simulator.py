"""Time stepping, the controller and what is recorded.

Timing, as a measurement set defines it:
- The controller reads θ and θ̇ (without noise) at t = k h and holds u_k = kp (θ_d − θ) + kd (θ̇_d − θ̇) over
  [k h, (k+1) h). Without a hold (h = 0) the torque follows the motion continuously.
- A row at time t holds θ(t) and the recorded torque at t. Rows fall on starts of holds: the torque of a row
  is the one whose hold begins there, so h is the set's `torque_hold`.
- The torque that acts is (1+g) times the recorded one, d later. A switch inside a step counts with its share
  of the step: the impulse is exact.
- White noise is added to the rows only; the controller does not see it.

Everything is integrated by the classical Runge–Kutta method with a fixed step that divides h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from independent.arms import Arm, Array, Body
from independent.laws import CREEP, Effect, Laws
from independent.mujoco_robot import Links

RECORD = 0.001  # [s]
WARM_UP = 0.8  # [s] before the first row: what the start stirs up has died away


@dataclass(frozen=True, eq=False)
class Motion:
    """Sums of sines: θ_d = centre + Σ amplitude sin(ω t + phase).

    Attributes:
        centre: shape (m,) [rad].
        amplitude, omega, phase: shape (m, terms) [rad, rad/s, rad].
    """

    centre: Array
    amplitude: Array
    omega: Array
    phase: Array

    def position(self, t: float | Array) -> Array:
        """Shape (m,), or (N, m) for times of shape (N,) [rad]."""
        angle = np.multiply.outer(t, self.omega) + self.phase
        return self.centre + np.sum(self.amplitude * np.sin(angle), axis=-1)

    def velocity(self, t: float | Array) -> Array:
        """[rad/s]."""
        angle = np.multiply.outer(t, self.omega) + self.phase
        return np.sum(self.amplitude * self.omega * np.cos(angle), axis=-1)

    def acceleration(self, t: float | Array) -> Array:
        """[rad/s²]."""
        angle = np.multiply.outer(t, self.omega) + self.phase
        return -np.sum(self.amplitude * self.omega**2 * np.sin(angle), axis=-1)


@dataclass(frozen=True, eq=False)
class Setup:
    """Everything that is true in one set of runs.

    Attributes:
        arm: the links as they are.
        stiffness, motor_inertia, link_viscous, motor_viscous: shape (n,).
        effects: all that act, the model's own (Coulomb) too.
        payload_names, payloads: for each run its payload's name and bodies, as the set states them.
        motion: for each run what the controller follows; shapes (runs · n, …).
        kp, kd: shape (n,) [Nm/rad, Nm s/rad].
        hold: of the torque [s]; 0 follows continuously.
        duration: of each run [s].
        noise: standard deviations of θ [rad] and τ [Nm].
        mounted: turns of the base about x, then about the world's y [rad].
        rigid: joints whose motor is locked to the link: q = θ, and the rotor turns with the link.
    """

    arm: Arm
    stiffness: Array
    motor_inertia: Array
    link_viscous: Array
    motor_viscous: Array
    effects: tuple[Effect, ...]
    payload_names: tuple[str, ...]
    payloads: tuple[tuple[Body, ...], ...]
    motion: Motion
    kp: Array
    kd: Array
    hold: float
    duration: float
    noise: tuple[float, float]
    mounted: tuple[float, float] = (0.0, 0.0)
    rigid: tuple[int, ...] = ()

    @property
    def runs(self) -> int:
        return len(self.payloads)

    @property
    def n(self) -> int:
        return len(self.stiffness)

    @cached_property
    def links(self) -> Links:
        """The link side with the payloads and the base as they are, not as stated."""
        errors = {
            e.payload: e.values["relative_mass_error"] for e in self.effects if e.name == "payload_error"
        }
        real = [
            [body.scaled(1 + errors.get(name, 0.0)) for body in bodies]
            for name, bodies in zip(self.payload_names, self.payloads, strict=True)
        ]
        tilt = next((e.values for e in self.effects if e.name == "base_tilt"), {})
        tilted = tilt.get("tilt_x", 0.0), tilt.get("tilt_y", 0.0)
        rotors = np.zeros(self.n)
        rotors[list(self.rigid)] = self.motor_inertia[list(self.rigid)]
        return Links(self.arm, real, tilted, self.mounted, rotors)

    @property
    def locked(self) -> NDArray[np.bool_]:
        """Which joints of all runs are rigid, shape (runs · n,)."""
        return np.tile(np.isin(np.arange(self.n), self.rigid), self.runs)

    def laws(self) -> Laws:
        return Laws(
            self.runs,
            self.stiffness,
            self.motor_inertia,
            self.link_viscous,
            self.motor_viscous,
            self.effects,
        )

    def step(self) -> float:
        """A step [s] that the quickest part bears: friction at creeping speed, a spring on a light side."""
        motor = np.tile(self.motor_inertia, self.runs)
        link = self.links.lightest(self.motion.centre)
        laws = self.laws()
        rub = laws.coulomb.copy()
        for name, key in (("stribeck_friction", "stribeck"), ("sticky_patch", "peak")):
            for at, p in laws.each(name):
                rub[at] += p[key]
        for name in ("load_dependent_friction", "driving_friction"):
            for at, p in laws.each(name):
                still = np.abs(self.links.torque(self.motion.centre, 0 * motor, 0 * motor))
                rub[at] += 2 * max(p.values()) * still[at]
        damping = [laws.each("joint_damping")[0][1]["damping"]] if laws.each("joint_damping") else [0.0]
        rates = [rub / CREEP / motor, laws.link_coulomb / CREEP / link, max(damping) * (1 / motor + 1 / link)]
        spring = np.sqrt(laws.stiffness * (1 / motor + 1 / link)) * ~self.locked
        rates += [spring, np.tile(self.kd, self.runs) / motor]
        longest = 1.6 / float(np.max([np.max(r) for r in rates]))
        whole = self.hold or RECORD
        return whole / max(int(np.ceil(whole / min(longest, 0.0005) - 1e-9)), 1)


@dataclass(frozen=True, eq=False)
class Record:
    """What happened; the set holds time, theta and tau only.

    Attributes:
        time: shape (N,) [s].
        theta, tau: with noise, as recorded, shape (runs, N, n).
        q, joint_torque, reference: true link angle, τ_j and θ_d, shape (runs, N, n).
    """

    time: Array
    theta: Array
    tau: Array
    q: Array
    joint_torque: Array
    reference: Array

    def noisy(self, noise: tuple[float, float], rng: np.random.Generator) -> Record:
        """With white noise on angles [rad] and torques [Nm]."""
        shape = self.theta.shape
        return replace(
            self,
            theta=self.theta + noise[0] * rng.standard_normal(shape),
            tau=self.tau + noise[1] * rng.standard_normal(shape),
        )


class Clockwork:
    """The coupled equations of motors and links; a state has the rows q, θ, q̇, θ̇, z."""

    def __init__(self, setup: Setup) -> None:
        self.setup, self.laws, self.links = setup, setup.laws(), setup.links
        self.kp, self.kd = np.tile(setup.kp, setup.runs), np.tile(setup.kd, setup.runs)
        self.locked = setup.locked if setup.rigid else None

    def start(self, t: float) -> Array:
        """On the motion, with springs that carry the arm's weight."""
        motion = self.setup.motion
        theta, velocity = motion.position(t), motion.velocity(t)
        weight = self.links.torque(theta, 0 * theta, 0 * theta)
        bend = weight / self.laws.stiffness * ~self.setup.locked
        return np.array([theta - bend, theta, velocity, velocity, 0 * theta])

    def command(self, position: Array, velocity: Array, y: Array) -> Array:
        """The controller's torque [Nm]."""
        return self.kp * (position - y[1]) + self.kd * (velocity - y[3])

    def rates(self, t: float, y: Array, torque: Array, push: Array | None) -> Array:
        """The state's derivative under the motors' torque and a push on the links [Nm]."""
        q, theta, q_velocity, v, z = y
        laws = self.laws
        joint = laws.spring(theta, v, q, q_velocity)
        out = np.empty_like(y)
        out[:2] = y[2:4]
        out[3] = laws.motor_acceleration(torque - joint - laws.motor(t, theta, v, joint, z))
        out[4] = laws.bristle_rate(v, z) if laws.bristles else 0.0
        if self.locked is not None:  # the motor's torque, less its friction, acts on the link itself
            joint = np.where(self.locked, torque - laws.motor(t, theta, v, joint, z), joint)
        joint -= laws.link(q, q_velocity)
        if push is not None:
            joint += push
        out[2] = self.links.acceleration(q, q_velocity, joint)
        if self.locked is not None:
            out[3] = np.where(self.locked, out[2], out[3])
        return out

    def held(self, t: float, y: Array, h: float, torque: Array) -> Array:
        """One step under a constant torque."""
        push = self.laws.pushed(t, t + h)
        a = self.rates(t, y, torque, push)
        b = self.rates(t + h / 2, y + h / 2 * a, torque, push)
        c = self.rates(t + h / 2, y + h / 2 * b, torque, push)
        d = self.rates(t + h, y + h * c, torque, push)
        return y + h / 6 * (a + 2 * (b + c) + d)

    def following(self, t: float, y: Array, h: float, gain: float | Array) -> Array:
        """One step under a torque that follows the motion."""
        push = self.laws.pushed(t, t + h)
        motion = self.setup.motion

        def rates(t: float, y: Array) -> Array:
            torque = gain * self.command(motion.position(t), motion.velocity(t), y)
            return self.rates(t, y, torque, push)

        a = rates(t, y)
        b = rates(t + h / 2, y + h / 2 * a)
        c = rates(t + h / 2, y + h / 2 * b)
        d = rates(t + h, y + h * c)
        return y + h / 6 * (a + 2 * (b + c) + d)


def simulate(setup: Setup, step: float | None = None) -> Record:
    """Every run of a setup, without noise."""
    work = Clockwork(setup)
    h = setup.step() if step is None else step
    every, per_hold = round(RECORD / h), round(setup.hold / h) if setup.hold else 1
    gain, delay, limit = _sensing(setup)
    plain = not delay.any() and not np.isfinite(limit).any()
    assert abs(every * h - RECORD) < 1e-12 and every % per_hold == 0 and (setup.hold or plain)
    warm = round(WARM_UP / RECORD) * every
    rows = round(setup.duration / RECORD)
    ticks = h * per_hold * np.arange(-(warm // per_hold), rows * every // per_hold + 1)
    ahead, ahead_velocity = setup.motion.position(ticks), setup.motion.velocity(ticks)
    state = np.empty((rows, 5, setup.runs * setup.n))
    tau = np.empty((rows, setup.runs * setup.n))
    y = work.start(-warm * h)
    torques: list[Array] = []
    for k in range(-warm, (rows - 1) * every + 1):
        tick, inside = divmod(k + warm, per_hold)
        if inside == 0:
            torques.append(work.command(ahead[tick], ahead_velocity[tick], y))
        if k >= 0 and k % every == 0:
            state[k // every], tau[k // every] = y, torques[-1]
        if not setup.hold:
            y = work.following(k * h, y, h, gain)
        else:
            acting = torques[-1]
            for late in np.unique(delay[delay > 0]):
                then = _acting(torques, (k + warm) * h - float(late), h, setup.hold)
                acting = np.where(delay == late, then, acting)
            y = work.held(k * h, y, h, gain * np.clip(acting, -limit, limit))
    return _record(setup, work, state, tau)


def _sensing(setup: Setup) -> tuple[Array, Array, Array]:
    """Acting over recorded torque, how much later it acts [s], and its limit [Nm], shape (runs · n,) each."""
    gain, delay, limit = np.ones(setup.n), np.zeros(setup.n), np.full(setup.n, np.inf)
    for e in setup.effects:
        if e.name == "torque_gain" and e.joint is not None:
            gain[e.joint] += e.values["gain_error"]
        if e.name == "torque_delay":
            delay[slice(None) if e.joint is None else e.joint] += e.values["delay"]
        if e.name == "torque_limit" and e.joint is not None:
            limit[e.joint] = e.values["limit"]
    return np.tile(gain, setup.runs), np.tile(delay, setup.runs), np.tile(limit, setup.runs)


def _acting(torques: Sequence[Array], begin: float, step: float, hold: float) -> Array:
    """Mean of the held torques over [begin, begin + step], counted from the first hold [s]."""
    first = int(np.floor(begin / hold + 1e-9))
    if first < 0:
        return torques[0]
    late = (begin + step) - (first + 1) * hold  # this much of the step is in the next hold
    share = min(max(late / step, 0.0), 1.0)
    if share < 1e-9:
        return torques[first]
    return (1 - share) * torques[first] + share * torques[first + 1]


def _record(setup: Setup, work: Clockwork, state: Array, tau: Array) -> Record:
    def runs(x: Array) -> Array:
        return np.ascontiguousarray(x.reshape(len(x), setup.runs, setup.n).transpose(1, 0, 2))

    time = RECORD * np.arange(len(tau))
    springs = np.array([work.laws.spring(y[1], y[3], y[0], y[2]) for y in state])
    return Record(
        time,
        runs(state[:, 1]),
        runs(tau),
        runs(state[:, 0]),
        runs(springs),
        runs(setup.motion.position(time)),
    )
