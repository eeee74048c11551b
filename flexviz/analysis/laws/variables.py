"""What a law is drawn against: along the wide-band motion of a joint, and per what."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.model.effects import Effect, FreeCurveEffect, JointMotion, smooth_sign

REST_SPEED, REST_TIME = 0.005, 0.1  # [rad/s], [s] a joint that is slower for so long stands still
PATH = 5.0  # times the angle of a law, over which it is drawn


@dataclass(frozen=True, eq=False)
class LawSamples:
    """One stretch of a joint's motion on the fine grid; arrays have shape (N,).

    Attributes:
        motion: of the joint.
        tau, tau_rate: recorded torque and its rate [Nm], [Nm/s].
        neighbour_velocity, neighbour_acceleration: of the neighbouring motor [rad/s], [rad/s²].
        payload: torque of the effect's payload as stated [Nm]; zero without one.
        u: the law.
        values: the effect's parameters, shape (P,).
    """

    motion: JointMotion
    tau: Array
    tau_rate: Array
    neighbour_velocity: Array
    neighbour_acceleration: Array
    payload: Array
    u: Array
    values: Array


def one(at: LawSamples) -> Array:
    return np.ones(len(at.u))


def direction(at: LawSamples) -> Array:
    return smooth_sign(at.motion.velocity)


def velocity(at: LawSamples) -> Array:
    return at.motion.velocity


def cycle(at: LawSamples) -> Array:
    """The angle modulo one cycle of the ripple, 2π/n."""
    return np.mod(at.motion.position, 2 * np.pi / at.values[1])


def path_after(position: Array, event: Bools, longest: float) -> Array:
    """Path since the last event, both of shape (N,) [rad]; NaN before the first one and beyond `longest`."""
    path = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(position)))))
    start = np.maximum.accumulate(np.where(event, path, -np.inf))
    return np.where(path - start <= longest, path - start, np.nan)


def since_reversal(at: LawSamples) -> Array:
    v = at.motion.velocity
    reversal = np.concatenate(([True], v[1:] * v[:-1] <= 0))
    return path_after(at.motion.position, reversal, PATH * at.values[1] / max(at.values[0], 1e-9))


def since_rest(at: LawSamples) -> Array:
    slow, count = np.abs(at.motion.velocity) < REST_SPEED, max(round(REST_TIME / at.motion.step), 1)
    rest = np.convolve(slow, np.ones(count))[: len(slow)] >= count - 0.5
    rest[0] = True
    return path_after(at.motion.position, rest, PATH * at.values[1])


def torque_rate(at: LawSamples) -> Array:
    return np.gradient(at.motion.torque, at.motion.step)


@dataclass(frozen=True)
class LawVariable:
    """A horizontal axis, and what the law is divided by for it.

    Attributes:
        name: as in `Effect.plot_against`; `flexviz.content.wording` labels the axis by it.
        unit: of the axis.
        of: the variable, shape (N,).
        per: weight by which the law is divided, shape (N,): the direction of motion, a velocity.
        quantity: what the law then is; default: a torque, or a deflection.
        per_unit: unit of the weight.
    """

    name: str
    unit: str
    of: Callable[[LawSamples], Array]
    per: Callable[[LawSamples], Array] = field(default=one)
    quantity: str = ""
    per_unit: str = ""


AGAINST = "torque against the motion"
VARIABLES = {
    variable.name: variable
    for variable in (
        LawVariable("velocity", "rad/s", velocity),
        LawVariable("position", "rad", lambda at: at.motion.position),
        LawVariable("angle within a cycle", "rad", cycle),
        LawVariable("load", "Nm", lambda at: np.abs(at.motion.torque), direction, AGAINST),
        LawVariable("path since reversal", "rad", since_reversal, direction, AGAINST),
        LawVariable("path since rest", "rad", since_rest, direction, AGAINST),
        LawVariable(
            "warming time", "s", lambda at: at.motion.time, velocity, "additional viscous friction", "rad/s"
        ),
        LawVariable(
            "velocity per degree", "rad/s", velocity, lambda at: one(at) * (20.0 - at.motion.temperature),
            "friction per degree", "°C",
        ),
        LawVariable("recorded torque", "Nm", lambda at: at.tau),
        LawVariable("recorded torque's rate", "Nm/s", lambda at: at.tau_rate),
        LawVariable("torque", "Nm", lambda at: at.motion.torque),
        LawVariable("torque's rate", "Nm/s", torque_rate),
        LawVariable("link velocity", "rad/s", lambda at: at.motion.link_velocity),
        LawVariable("link position", "rad", lambda at: at.motion.link_position),
        LawVariable("payload's torque", "Nm", lambda at: at.payload),
        LawVariable("law", "Nm", lambda at: at.u),
        LawVariable("time", "s", lambda at: at.motion.time),
        LawVariable("neighbour's acceleration", "rad/s²", lambda at: at.neighbour_acceleration),
        LawVariable("sum of velocities", "rad/s", lambda at: at.motion.velocity + at.neighbour_velocity),
    )
}  # fmt: skip

USUAL = {"joint": "torque", "link": "link position", "load": "link position"}  # others: velocity


def variable_of(effect: Effect) -> LawVariable:
    """What the law of an effect is drawn against."""
    if isinstance(effect, FreeCurveEffect):
        return VARIABLES[{"load": "torque"}.get(effect.variable, effect.variable)]
    usual = VARIABLES[USUAL.get(effect.where, "velocity")]
    return VARIABLES.get(effect.plot_against, usual)  # a user's effect may name something else
