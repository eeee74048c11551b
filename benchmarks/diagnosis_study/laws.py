"""Effects that the library does not have, as laws for the simulator: what a diagnosis must call unknown."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, exp, pi, sin, tanh
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import JointState
from flexviz.simulation import ExtraLaw, MotionScale, Plan, Pull

Array = NDArray[np.float64]

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


Maker = Callable[[Plan, int, MotionScale, np.random.Generator], ExtraLaw]


def _inside(plan: Plan, i: int, rng: np.random.Generator) -> float:
    """An angle in the middle of what joint i passes [rad]."""
    angles: Array = plan.groups[0].reference.sample(np.linspace(1.0, plan.groups[0].duration, 400))[0][:, i]
    return float(rng.uniform(*np.quantile(angles, (0.3, 0.7))))


def _part(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(*np.log(LARGE))))


def _friction_bump(plan: Plan, i: int, size: MotionScale, rng: np.random.Generator) -> ExtraLaw:
    return FrictionBump(
        _part(rng) * float(size.torque[i]), _inside(plan, i, rng), float(rng.uniform(0.08, 0.2))
    )


def _one_way_patch(plan: Plan, i: int, size: MotionScale, rng: np.random.Generator) -> ExtraLaw:
    return OneWayPatch(_part(rng) * float(size.torque[i]), _inside(plan, i, rng))


def _sawtooth(plan: Plan, i: int, size: MotionScale, rng: np.random.Generator) -> ExtraLaw:
    return SawtoothCogging(_part(rng) * float(size.torque[i]), float(rng.integers(3, 7)))


def _vibration(plan: Plan, i: int, size: MotionScale, rng: np.random.Generator) -> ExtraLaw:
    phase = float(rng.uniform(-pi, pi))
    return Vibration(0.5 * _part(rng) * float(size.torque[i]), float(rng.uniform(1.5, 6.0)), phase)


def _saturation(plan: Plan, i: int, size: MotionScale, rng: np.random.Generator) -> ExtraLaw:
    return Saturation(0.2 * _part(rng), float(size.torque[i]))


def _lost_motion(plan: Plan, i: int, size: MotionScale, rng: np.random.Generator) -> ExtraLaw:
    half_width = _part(rng) * max(float(size.deflection[i]), 2e-4)
    return GrowingLostMotion(float(plan.model.stiffness[i]), half_width, plan.groups[0].duration)


def _wobble(plan: Plan, i: int, size: MotionScale, rng: np.random.Generator) -> ExtraLaw:
    inertia = 0.5 * _part(rng) * float(plan.model.motor_inertia[i])
    return WobblingMass(inertia, float(rng.uniform(1.0, 4.0)), float(rng.uniform(0.02, 0.1)))


def _uneven(plan: Plan, i: int, size: MotionScale, rng: np.random.Generator) -> ExtraLaw:
    phase = float(rng.uniform(-pi, pi))
    return UnevenStiffness(
        float(plan.model.stiffness[i]), 0.6 * _part(rng), float(rng.integers(3, 10)), phase
    )


EXTRA_LAWS: dict[str, Maker] = {
    "friction_bump": _friction_bump,
    "one_way_patch": _one_way_patch,
    "sawtooth_cogging": _sawtooth,
    "vibration": _vibration,
    "saturation": _saturation,
    "growing_lost_motion": _lost_motion,
    "wobbling_mass": _wobble,
    "uneven_stiffness": _uneven,
}
