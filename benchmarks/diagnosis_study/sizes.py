"""How large a hidden effect is: in units of what is natural for its joint, from the detection limit up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexviz.model.effects import EFFECTS
from flexviz.model.simulation import MotionScale, Plan, default_parameters, motion_scale
from flexviz.robot.model import EffectValue

AROUND = (0.4, 3.0)  # cases around the detection limit, in detection limits
LONGEST_DELAY = 1.05  # [rad] phase that it may cost the controller at the speed loop's bandwidth k_d / B
NARROWEST = 3.0  # the largest size is at least this many times the smallest
STRAY = 0.2  # share of the ripples whose order is not a whole number


@dataclass(frozen=True)
class Draw:
    """What the random parameters of one effect are drawn from.

    Attributes:
        plan: in which it is hidden.
        speed: rms of its joint [rad/s].
        duration: of a group [s].
        factor: its size in natural units.
        rng: random numbers of the case.
    """

    plan: Plan
    speed: float
    duration: float
    factor: float
    rng: np.random.Generator


Values = dict[str, float]
Vary = Callable[[Values, Draw], None]


@dataclass(frozen=True)
class Size:
    """The range of sizes of an effect.

    Attributes:
        parameter: says how large it is.
        largest: in natural units.
        limits: detection limit in natural units at noise 1, of the planar arm and of the 6–7 joint arms: the
            size at which a fit that knows the truth gains 300, about the median over joints and sets. It
            differs a hundredfold between joints; hardening, damping and gear errors of an arm's stiff joints
            are often never seen. The study's table shows it anew.
        signed: whether it may be negative.
        vary: draws the other parameters, while the size is one natural unit.
        cap: the largest value for a plan.
    """

    parameter: str
    largest: float
    limits: tuple[float, float]
    signed: bool = False
    vary: Vary | None = None
    cap: Callable[[Plan], float] | None = None


def _stribeck(values: Values, draw: Draw) -> None:
    values["velocity"] = max(0.02, float(draw.rng.uniform(0.1, 0.4) * draw.speed))


def _presliding(values: Values, draw: Draw) -> None:
    """The distance before it slides is drawn, and stays whatever the size."""
    angle = float(np.exp(draw.rng.uniform(np.log(0.004), np.log(0.05))))
    values["presliding_stiffness"] = values["coulomb"] / angle
    values["presliding_stiffness"] *= draw.factor


def _drift(values: Values, draw: Draw) -> None:
    values["time_constant"] = float(draw.rng.uniform(0.15, 0.6) * draw.duration)


def _ripple(largest_order: int) -> Vary:
    """Cycles a turn: mostly whole numbers; below 2 it would be taken for gravity."""

    def vary(values: Values, draw: Draw) -> None:
        rng = draw.rng
        order = float(rng.integers(2, largest_order + 1))
        if rng.random() >= 1.0 - STRAY and order > 2:
            order += float(rng.uniform(-0.4, 0.4))
        values["order"], values["phase"] = order, float(rng.uniform(-np.pi, np.pi))

    return vary


def _spring(values: Values, draw: Draw) -> None:
    values["rest_angle"] = float(draw.rng.uniform(-0.8, 0.8))


def _tilt(values: Values, draw: Draw) -> None:
    planar = draw.plan.robot.n == 2  # its plane leans by itself
    values["tilt_x"] = 0.0 if planar else values["tilt_y"] * float(draw.rng.uniform(-1.0, 1.0)) * draw.factor


def _interval(values: Values, draw: Draw) -> None:
    start, length = draw.rng.uniform(1.0, 0.6 * draw.duration), draw.rng.uniform(0.6, 2.0)
    values["start"], values["end"] = float(start), float(start + length)


def _longest_delay(plan: Plan) -> float:
    """A controller that becomes unstable is another story [s]."""
    bandwidth = float(np.max(plan.controller.kd / plan.model.motor_inertia))  # [rad/s]
    return LONGEST_DELAY / bandwidth


SIZES: dict[str, Size] = {
    "coulomb_friction": Size("coulomb", 3.0, (0.00011, 0.0008)),
    "stribeck_friction": Size("stribeck", 3.0, (0.0006, 0.005), vary=_stribeck),
    "quadratic_friction": Size("quadratic", 3.0, (0.00028, 0.002)),
    "load_dependent_friction": Size("coefficient", 3.0, (0.00022, 0.0034)),
    "presliding_hysteresis": Size("coulomb", 3.0, (0.00016, 0.003), vary=_presliding),
    "friction_drift": Size("relative_rise", 3.0, (0.0029, 0.007), vary=_drift),
    "torque_ripple": Size("amplitude", 4.0, (0.00028, 0.003), vary=_ripple(25)),
    "torque_offset": Size("offset", 4.0, (0.00035, 0.004), signed=True),
    "torque_gain": Size("gain_error", 4.0, (0.00048, 0.01), signed=True),
    "torque_delay": Size("delay", 3.0, (0.01, 0.03), cap=_longest_delay),
    "stiffness_hardening": Size("cubic_stiffness", 4.0, (0.0015, 0.3)),
    "backlash": Size("half_width", 5.0, (0.014, 0.1)),
    "joint_damping": Size("damping", 3.0, (0.026, 0.3)),
    "transmission_error": Size("amplitude", 6.0, (0.034, 0.3), vary=_ripple(12)),
    "link_coulomb_friction": Size("coulomb", 3.0, (8e-05, 0.004)),
    "cable_spring": Size("stiffness", 4.0, (0.00024, 0.005), vary=_spring),
    "payload_error": Size("relative_mass_error", 4.0, (0.00032, 0.0017), signed=True),
    "base_tilt": Size("tilt_y", 3.0, (0.0019, 0.0023), signed=True, vary=_tilt),
    "external_contact": Size("torque", 2.0, (6e-05, 0.0012), signed=True, vary=_interval),
    "motor_coupling": Size("inertia", 3.0, (0.00048, 0.005), signed=True),
}
"""The effects of the study; what is drawn for a case depends on their order."""


def draw(
    name: str, joint: str | None, plan: Plan, noise: float, rng: np.random.Generator, around: bool = False
) -> EffectValue:
    """One effect of random size on that joint; `around`: near the detection limit instead of above it."""
    scale, size, effect = motion_scale(plan), SIZES[name], EFFECTS[name]
    limit = size.limits[plan.robot.n > 2] * noise
    low, high = (limit * AROUND[0], limit * AROUND[1]) if around else (limit, size.largest)
    low, high = min(low, size.largest / NARROWEST), min(max(high, low * NARROWEST), size.largest)
    factor = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    sign = float(rng.choice([-1.0, 1.0])) if size.signed else 1.0
    fitted = [g for g in plan.groups if not g.validation]
    group = payload = None
    if effect.scope == "episode":
        group = str(rng.choice([g.name for g in fitted]))
    if effect.scope == "payload":
        payload = str(rng.choice([g.payload for g in fitted if plan.payloads[g.payload]]))
    values = default_parameters(name, joint, plan, scale)
    if size.vary is not None:
        i = plan.robot.joints.index(joint) if joint is not None else 0
        size.vary(values, Draw(plan, float(scale.speed[i]), plan.groups[0].duration, factor, rng))
    values[size.parameter] *= factor * sign
    if size.cap is not None:
        values[size.parameter] = min(values[size.parameter], size.cap(plan))
    return EffectValue(name, joint, values, group, payload)


def natural(name: str, joint: str | None, plan: Plan, scale: MotionScale) -> float:
    """The natural unit of the effect's size on that joint, in the unit of its parameter."""
    return abs(default_parameters(name, joint, plan, scale)[SIZES[name].parameter])
