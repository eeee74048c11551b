"""An unknown law of one joint: a free curve that is estimated beside all other effects during the search.

A friction patch or a cogging torque that no effect describes pulls the parameters of all others. A curve of
the joint's position, of position and direction, or of velocity takes its place. It is left out of the result:
its law is not known.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.motion_fit import MotionFit
from flexviz.effects import EFFECTS, ChosenEffect, free_curve
from flexviz.equation import Layout
from flexviz.parallel import shared

Array = NDArray[np.float64]

TWICE_AS_RICH = 1.5  # times the gain of one curve, for one per direction
ONE_WAY = ("free_curve_friction", "free_curve_position")
EACH_WAY = ("free_curve_direction", "free_curve_velocity")  # with twice as many nodes


def is_curve(effect: ChosenEffect) -> bool:
    """Whether an effect is a free curve."""
    return free_curve(effect.effect) is not None


def best_curve(fit: MotionFit, joint: int) -> tuple[ChosenEffect, float]:
    """The free curve of a joint, on motor or link, that explains most beside a model, and its gain.

    One of a single branch, unless one for each direction of motion explains clearly more.
    """
    simple, rich = (
        [
            ChosenEffect(name.replace("curve", side), joint)
            for side in ("curve", "link_curve")
            for name in names
        ]
        for names in (ONE_WAY, EACH_WAY)
    )
    curves = [*simple, *rich]
    _ = fit.projection  # for all cores
    gains = dict(zip(curves, shared(lambda curve: curve_gain(fit, curve), curves), strict=True))
    plain, detailed = (max(family, key=lambda curve: gains[curve]) for family in (simple, rich))
    best = detailed if gains[detailed] > TWICE_AS_RICH * gains[plain] else plain
    return best, gains[best]


def curve_gain(fit: MotionFit, curve: ChosenEffect) -> float:
    """Decrease of the weighted sum of squares by a curve under its prior, beside the model's parameters."""
    layout = Layout(fit.layout.joints, (*fit.layout.effects, curve))
    where = layout.effect_slice(curve)
    start = fit.context.start(layout)
    terms = EFFECTS[curve.effect].terms(fit.point.context, curve.place, start.x[where])
    free = start.bounds.lower[where] < start.bounds.upper[where]
    columns = np.stack(
        [fit.chain.column(terms.entry, terms.joints, one) for one in terms.slopes[free]], axis=2
    )
    columns *= fit.weights[:, :, None]
    gram, along = fit.projection.normal(columns.reshape(-1, columns.shape[2]))
    prior = start.prior.gradient_and_hessian(start.x)[1][where, where][np.ix_(free, free)]
    return float(along @ np.linalg.solve(gram + prior, along))
