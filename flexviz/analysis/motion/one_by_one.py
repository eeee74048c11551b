"""The start of a model of many effects: one effect after another, each from what it explains."""

from __future__ import annotations

from collections.abc import Callable

from flexviz.analysis.estimation import best_intervals, score
from flexviz.analysis.motion.fit import MotionContext, MotionFit
from flexviz.base.arrays import Array
from flexviz.model.effects import EFFECTS, ChosenEffect
from flexviz.model.equation import Layout


def one_by_one(context: MotionContext, layout: Layout, check: Callable[[], None]) -> MotionFit:
    """A model fitted from the one without effects, the effect that explains most being added first.

    Started all at once, effects that explain the same part of a torque share it, and many a fit ends there.
    """
    bare = layout.with_effects()
    fit = context.fit(bare, context.start(bare).x, check=check)
    left = list(layout.effects)
    while left:
        effect, values = _next(fit, left)
        left.remove(effect)
        larger = layout.with_effects([e for e in layout.effects if e not in left])
        x = larger.vector(fit.layout.model(fit.x))
        x[larger.effect_slice(effect)] = context.start(larger).x[larger.effect_slice(effect)]
        if values is not None:
            x[larger.effect_slice(effect)] = values
        fit = context.fit(larger, x, check=check)
    return fit


def _next(fit: MotionFit, left: list[ChosenEffect]) -> tuple[ChosenEffect, Array | None]:
    """The effect that explains most, and its values there; None for those of a start."""
    here = {(e.effect, e.joint) for e in fit.layout.effects}
    open_ = [
        e for e in left if EFFECTS[e.effect].beside is None or (EFFECTS[e.effect].beside, e.joint) in here
    ]
    wanted = [e for e in open_ if e.group is None or e.joint is None]
    found = score(fit.point, fit.chain, wanted, fit.weigh, fit.projection)
    if found:
        best = max(found, key=lambda one: one.gain)
        return best.effect, best.values
    for effect in open_:
        if effect.joint is not None and effect.group is not None:
            best_of = best_intervals(fit.point, effect.joint, fit.weigh, fit.projection, group=effect.group)
            if best_of:
                return effect, best_of[0].values
    return (open_ or left)[0], None
