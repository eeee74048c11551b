"""Models with what most robots have, from which a fit sees which samples count and what a joint lacks."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from flexviz.analysis.motion.fit import MotionContext
from flexviz.analysis.motion.thresholds import MOTION
from flexviz.base.arrays import Array
from flexviz.model.effects import EFFECTS, ChosenEffect, JointScale, neighbour
from flexviz.model.equation import Layout


@dataclass(frozen=True, eq=False)
class Known:
    """A model with its parameters, shape (P,)."""

    layout: Layout
    x: Array


class Fitted(Protocol):
    """A model with its parameters."""

    @property
    def layout(self) -> Layout: ...

    @property
    def x(self) -> Array: ...


def usual_model(context: MotionContext, own: Layout) -> Known:
    """Every usual effect on every joint, at small sizes."""
    names = [name for name, law in EFFECTS.items() if law.usual]
    bare = context.start(own)
    return _with_small(context, Known(own, bare.x), [ChosenEffect(n, j) for n in names for j in range(own.n)])


def plain_model(
    context: MotionContext, fit: Fitted, joint: int, banned: Collection[ChosenEffect] = ()
) -> Known | None:
    """A model with all that a plain joint has: dry and load-dependent friction, offset, spring.

    At small sizes, without some that are banned; None if it lacks at most one of these.
    """
    names = [name for name, law in EFFECTS.items() if law.usual and law.beside is None]
    plain = [e for e in (ChosenEffect(name, joint) for name in names) if e not in banned]
    larger = _with_small(context, fit, plain)
    return larger if len(larger.layout.effects) > len(fit.layout.effects) + 1 else None


def _with_small(context: MotionContext, known: Fitted, effects: Sequence[ChosenEffect]) -> Known:
    """A model with further effects at small sizes, but for those that others replace."""
    own, have = known.layout, set(known.layout.effects)
    replaced = {(EFFECTS[e.effect].replaces, e.joint) for e in have}
    more = [
        e
        for e in filter(own.can_have, effects)
        if e not in have
        and (e.effect, e.joint) not in replaced
        and (own.motors or EFFECTS[e.effect].behind_gear)
    ]
    layout = own.with_effects((*own.effects, *more))
    start, x = context.start(layout).x, layout.vector(own.model(known.x))
    for effect in more:
        law, where = EFFECTS[effect.effect], layout.effect_slice(effect)
        values = np.array(law.typical(scale(context, effect.joint or 0, layout, start)))
        values[list(law.size_at)] *= MOTION.tolerance
        x[where] = values
    return Known(layout, x)


def scale(context: MotionContext, joint: int, layout: Layout, x: Array) -> JointScale:
    """Magnitudes of a joint's motion in the fit groups, with a model's parameters x, shape (P,)."""
    signals = context.signals
    torque, speed = (float(np.sqrt(np.mean(v[:, joint] ** 2))) for v in (signals.tau[0], signals.theta[1]))
    compliance, (inertia, on_motor) = x[layout.compliance], layout.motor_side(x)
    softness, viscous = float(compliance[joint]), x[layout.link_viscous] + on_motor
    return JointScale(
        torque=torque, speed=speed, deflection=torque * softness, stiffness=1 / softness,
        motor_inertia=float(inertia[joint]), neighbour_inertia=float(inertia[neighbour(joint, layout.n)]),
        position=float(np.mean(signals.theta[0, :, joint])), duration=float(np.ptp(signals.time)),
        viscous=float(viscous[joint]),
    )  # fmt: skip
