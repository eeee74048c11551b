"""Unmodelled torques: laws that the library does not have, which a diagnosis must call unknown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, exp, pi, sin, tanh
from typing import ClassVar

import numpy as np

from flexviz.model.effects import JointState
from flexviz.model.simulation import ExtraLaw, MotionScale, Plan, Pull

WIDTH = 0.005  # [rad/s] of the sign of velocity, as everywhere in the simulator
LARGE = (0.05, 1.0)  # sizes in rms torques of the joint, or the like


@dataclass(frozen=True)
class FrictionBump(ExtraLaw):
    """A rough spot: p exp(−((θ − θ₀)/w)²) sign(θ̇)."""

    peak: float  # [Nm]
    position: float  # [rad]
    width: float  # [rad]

    def pull(self, at: JointState) -> Pull:
        near = exp(-(((at.theta - self.position) / self.width) ** 2))
        return Pull(motor=self.peak * near * tanh(at.theta_velocity / WIDTH))


@dataclass(frozen=True)
class OneWayPatch(ExtraLaw):
    """Something rubs on one side of an angle, and only on the way up: p for θ > θ₀ and θ̇ > 0."""

    torque: float  # [Nm]
    position: float  # [rad]

    def pull(self, at: JointState) -> Pull:
        beyond = 0.5 * (1.0 + tanh((at.theta - self.position) / 0.03))
        return Pull(motor=self.torque * beyond * max(tanh(at.theta_velocity / WIDTH), 0.0))


@dataclass(frozen=True)
class SawtoothCogging(ExtraLaw):
    """Cogging with many harmonics: Σ_k sin(knθ)/k · 2p/π, k ≤ 8."""

    torque: float  # [Nm] half of the jump
    order: float  # teeth a revolution

    def pull(self, at: JointState) -> Pull:
        angle = self.order * at.theta
        return Pull(motor=2 / pi * self.torque * sum(sin(k * angle) / k for k in range(1, 9)))


@dataclass(frozen=True)
class Vibration(ExtraLaw):
    """A machine beside it shakes the link: p sin(2πft + φ), whatever the robot does."""

    torque: float  # [Nm]
    hertz: float
    phase: float  # [rad]

    def pull(self, at: JointState) -> Pull:
        return Pull(link=self.torque * sin(2 * pi * self.hertz * at.time + self.phase))


@dataclass(frozen=True)
class Saturation(ExtraLaw):
    """The motor gives less the more it has to carry: c τ_j (τ_j/τ₀)² is lost."""

    share: float  # [-] lost at τ₀
    torque: float  # τ₀ [Nm]

    def pull(self, at: JointState) -> Pull:
        return Pull(motor=self.share * at.load * (at.load / self.torque) ** 2)


@dataclass(frozen=True)
class GrowingLostMotion(ExtraLaw):
    """A clamp works loose: a backlash that grows from nothing to b during the run."""

    stiffness: float  # K of the joint [Nm/rad]
    half_width: float  # [rad] at the end
    duration: float  # [s]

    def pull(self, at: JointState) -> Pull:
        gap = self.half_width * at.time / self.duration
        return Pull(joint=-self.stiffness * min(max(at.theta - at.q, -gap), gap))


@dataclass(frozen=True)
class WobblingMass(ExtraLaw):
    """Something on the link hangs on a spring of its own: a torsional mass with its own vibration.

    Own states: its angle relative to the link [rad] and its angular velocity [rad/s].
    """

    inertia: float  # [kg m²]
    hertz: float
    damping: float  # [-] ratio
    states: ClassVar[int] = 2

    def pull(self, at: JointState) -> Pull:
        pulse = 2 * pi * self.hertz
        slip, velocity = at.z[0], at.z[1] - at.q_velocity
        acceleration = -(pulse**2) * slip - 2 * self.damping * pulse * velocity
        return Pull(link=self.inertia * acceleration, rates=(velocity, acceleration))


@dataclass(frozen=True)
class UnevenStiffness(ExtraLaw):
    """A spring that is softer at some angles: τ_j = K (1 + a cos(nθ + φ)) (θ − q)."""

    stiffness: float  # K of the joint [Nm/rad]
    share: float  # a [-]
    order: float
    phase: float  # [rad]

    def pull(self, at: JointState) -> Pull:
        change = self.share * cos(self.order * at.theta + self.phase)
        return Pull(joint=self.stiffness * change * (at.theta - at.q))


@dataclass(frozen=True)
class Place:
    """The joint on which something is hidden, and what its random size is drawn from.

    Attributes:
        plan: the robot on its motions.
        i: index of the joint.
        torque: how large the joint's torque is [Nm].
        inside: range of angles in the middle of what the joint passes [rad].
        rng: random numbers of the case.
    """

    plan: Plan
    i: int
    torque: float
    inside: tuple[float, float]
    rng: np.random.Generator

    @property
    def stiffness(self) -> float:
        """Of the joint [Nm/rad]."""
        return float(self.plan.model.stiffness[self.i])

    @property
    def motor_inertia(self) -> float:
        """Of the joint [kg m²]."""
        return float(self.plan.model.motor_inertia[self.i])

    def uniform(self, low: float, high: float) -> float:
        """A number between these."""
        return float(self.rng.uniform(low, high))

    def whole(self, low: int, high: int) -> float:
        """A whole number from `low` to below `high`."""
        return float(self.rng.integers(low, high))

    def log_uniform(self, low: float, high: float) -> float:
        """A number whose logarithm is uniform."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def part(self, low: float, high: float) -> float:
        """That times the joint's torque [Nm]."""
        return self.log_uniform(low, high) * self.torque

    def sign(self) -> float:
        """−1 or 1."""
        return float(self.rng.choice([-1.0, 1.0]))

    def phase(self) -> float:
        """An angle [rad]."""
        return self.uniform(-pi, pi)

    def angle(self) -> float:
        """An angle that the joint passes [rad]."""
        return self.uniform(*self.inside)


def place(plan: Plan, i: int, size: MotionScale, rng: np.random.Generator) -> Place:
    """The place of a law in a plan without one."""
    angles = plan.groups[0].reference.sample(np.linspace(1.0, plan.groups[0].duration, 400))[0][:, i]
    low, high = np.quantile(angles, (0.3, 0.7))
    return Place(plan, i, float(size.torque[i]), (low, high), rng)


# drawn in the order in which the arguments stand
EXTRA_LAWS: dict[str, Callable[[Place], ExtraLaw]] = {
    "friction_bump": lambda at: FrictionBump(at.part(*LARGE), at.angle(), at.uniform(0.08, 0.2)),
    "one_way_patch": lambda at: OneWayPatch(at.part(*LARGE), at.angle()),
    "sawtooth_cogging": lambda at: SawtoothCogging(at.part(*LARGE), at.whole(3, 7)),
    "vibration": lambda at: Vibration(
        phase=at.phase(), torque=0.5 * at.part(*LARGE), hertz=at.uniform(1.5, 6.0)
    ),
    "saturation": lambda at: Saturation(0.2 * at.log_uniform(*LARGE), at.torque),
    "growing_lost_motion": lambda at: GrowingLostMotion(
        at.stiffness,
        at.log_uniform(*LARGE) * max(at.torque / at.stiffness, 2e-4),
        at.plan.groups[0].duration,
    ),
    "wobbling_mass": lambda at: WobblingMass(
        0.5 * at.log_uniform(*LARGE) * at.motor_inertia, at.uniform(1.0, 4.0), at.uniform(0.02, 0.1)
    ),
    "uneven_stiffness": lambda at: UnevenStiffness(
        phase=at.phase(), stiffness=at.stiffness, share=0.6 * at.log_uniform(*LARGE), order=at.whole(3, 10)
    ),
}
"""Laws of the study of few effects."""

OFTEN: dict[str, tuple[float, Callable[[Place], ExtraLaw]]] = {
    "friction_bump": (0.45, lambda at: FrictionBump(at.part(0.12, 0.7), at.angle(), at.uniform(0.1, 0.25))),
    "one_way_patch": (0.2, lambda at: OneWayPatch(at.part(0.12, 0.7), at.angle())),
    "sawtooth_cogging": (0.2, lambda at: SawtoothCogging(at.part(0.08, 0.3), at.whole(3, 9))),
    "saturation": (0.05, lambda at: Saturation(at.log_uniform(0.01, 0.05), at.torque)),
    "vibration": (0.1, lambda at: Vibration(at.part(0.05, 0.3), at.uniform(1.5, 6.0), at.phase())),
}
"""Law of the robots with many effects → its probability and its random parameters."""
