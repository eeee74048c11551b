"""An unknown law of one joint: a free curve that is estimated together with all effects during the search.

A friction patch or a cogging torque that no effect describes pulls the parameters of all others. A curve of
the joint's position, of position and direction, or of velocity takes its place. It is left out of the result:
its law is not known.
"""

from __future__ import annotations

import numpy as np

from flexviz.analysis.motion import MotionFit
from flexviz.base.parallel import shared
from flexviz.model.effects import EFFECTS, ChosenEffect, free_curve

TWICE_AS_RICH = 1.5  # times the gain of one curve, for one per direction
ONE_WAY = ("free_curve_friction", "free_curve_position")
EACH_WAY = ("free_curve_direction", "free_curve_velocity")  # with twice as many nodes


def is_curve(effect: ChosenEffect) -> bool:
    """Whether an effect is a free curve."""
    return free_curve(effect.effect) is not None


def best_curve(fit: MotionFit, joint: int) -> tuple[ChosenEffect, float]:
    """The free curve of a joint, on motor or link, that explains most given a model, and its gain.

    One of a single branch, unless one for each direction of motion explains clearly more.
    """
    names = [
        name.replace("curve", side) for name in (*ONE_WAY, *EACH_WAY) for side in ("curve", "link_curve")
    ]
    curves = [ChosenEffect(name, joint) for name in names]
    _ = fit.projection  # for all cores
    gains = list(shared(lambda curve: curve_gain(fit, curve), curves))
    plain, rich = (max(part, key=gains.__getitem__) for part in np.split(np.arange(len(curves)), 2))
    best = rich if gains[rich] > TWICE_AS_RICH * gains[plain] else plain
    return curves[best], gains[best]


def curve_gain(fit: MotionFit, curve: ChosenEffect) -> float:
    """Decrease of the weighted sum of squares by a curve under its prior, given the model's parameters."""
    layout = fit.layout.with_effects((*fit.layout.effects, curve))
    where, start = layout.effect_slice(curve), fit.context.start(layout)
    terms = EFFECTS[curve.effect].terms(fit.point.context, curve.place, start.x[where])
    free = start.bounds.lower[where] < start.bounds.upper[where]
    columns = [fit.chain.column(terms.entry, terms.joints, slope) for slope in terms.slopes[free]]
    weighted = np.stack(columns, axis=2) * fit.weights[:, :, None]
    gram, along = fit.projection.normal(weighted.reshape(-1, weighted.shape[2]))
    prior = start.prior.gradient_and_hessian(start.x)[1][where, where][np.ix_(free, free)]
    return float(along @ np.linalg.solve(gram + prior, along))


def curve_cost(fit: MotionFit, where: slice) -> float:
    """½ log det(1 + C G) of a curve with prior covariance C and information G [nats]."""
    free = np.diag(fit.information)[where] > 0
    prior = fit.prior_derivatives[1][where, where][np.ix_(free, free)]
    known = fit.information[where, where][np.ix_(free, free)]
    return 0.5 * float(np.linalg.slogdet(prior + known)[1] - np.linalg.slogdet(prior)[1])
