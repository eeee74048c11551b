"""An unknown law of one joint: a free curve that is estimated together with all effects during the search.

A friction patch or a cogging torque that no effect describes pulls the parameters of all others. A curve of
the joint's position, of position and direction, or of velocity takes its place. It is left out of the result:
its law is not known.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from flexviz.diagnosis.motion_fit import MotionFit
from flexviz.effects import CURVES, EFFECTS, ChosenEffect, free_curve
from flexviz.effects.free_curve import STAND_INS
from flexviz.equation import Layout
from flexviz.parallel import shared


def is_curve(effect: ChosenEffect) -> bool:
    """Whether an effect is a free curve."""
    return free_curve(effect.effect) is not None


def best_curve(fit: MotionFit, joint: int, time: float) -> tuple[ChosenEffect, float]:
    """The free curve of a joint's motion that explains most beside a model, and its gain [nats].

    `time`: samples per independent one of the joint's residual.
    """
    motion = [curve.name for curve in (*STAND_INS, *CURVES) if curve.variable in ("position", "velocity")]
    curves = [ChosenEffect(name, joint) for name in motion]
    _ = fit.projection  # for all cores
    gains = [0.5 * gain / time - cost for gain, cost in shared(partial(curve_gain, fit), curves)]
    best = int(np.argmax(gains))
    return curves[best], gains[best]


def curve_gain(fit: MotionFit, curve: ChosenEffect) -> tuple[float, float]:
    """Decrease of the weighted sum of squares by a curve under its prior, and ½ log det(1 + C G) [nats]."""
    layout = Layout(fit.layout.joints, (*fit.layout.effects, curve))
    where, start = layout.effect_slice(curve), fit.context.start(layout)
    terms = EFFECTS[curve.effect].terms(fit.point.context, curve.place, start.x[where])
    free = start.bounds.lower[where] < start.bounds.upper[where]
    columns = [fit.chain.column(terms.entry, terms.joints, slope) for slope in terms.slopes[free]]
    weighted = np.stack(columns, axis=2) * fit.weights[:, :, None]
    gram, along = fit.projection.normal(weighted.reshape(-1, weighted.shape[2]))
    prior = start.prior.gradient_and_hessian(start.x)[1][where, where][np.ix_(free, free)]
    cost = 0.5 * float(np.linalg.slogdet(prior + gram)[1] - np.linalg.slogdet(prior)[1])
    return float(along @ np.linalg.solve(gram + prior, along)), cost
