"""Comparison of effects with a free curve, for models that leave a large residual.

If no model reaches the noise, a flexible effect always explains part of the residual (a ripple explains part
of a bump in position). A free curve of one variable of the same joint shows how much a correct effect would
explain; one that explains much less is an imitation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.comparison import CandidateScores
from flexviz.diagnosis.curves import equally_filled_splines
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.records import DIRECTED
from flexviz.diagnosis.search import Search
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import ChosenEffect, JointMotion, smooth_sign
from flexviz.estimation import Projection, Weigh, explained

Array = NDArray[np.float64]

VARIABLES = ("position", DIRECTED, "velocity", "load", "time")


@dataclass(frozen=True)
class FreeCurveGain:
    """The best free curve on a joint.

    Attributes:
        variable: one of VARIABLES; "" if none explains anything.
        gain: decrease of the weighted sum of squares, less the number of coefficients times log N.
    """

    variable: str
    gain: float


class FreeCurveTest:
    """Compares scores of effects with free curves of their joints, in units of the noise.

    Args:
        search: the search without a model error.
        fit: the present model.
        scores: scores of all candidates at this model.
    """

    def __init__(self, search: Search, fit: Fit, scores: CandidateScores) -> None:
        self.search, self.fit, self.scores = search, fit, scores
        self._gains: dict[int, float] = {}

    def passed(self, effect: ChosenEffect) -> bool:
        """Whether the score of an effect reaches the required share of the best free curve."""
        joints = range(self.fit.layout.n) if effect.joint is None else [effect.joint]
        best = max(self.gain(joint) for joint in joints)
        gain = next((s.gain for s in self.scores.ranked if s.effect == effect), 0.0)
        return gain >= THRESHOLDS.model_error.free_curve_share * best

    def gain(self, joint: int) -> float:
        """Gain of the best free curve of a joint."""
        if joint not in self._gains:
            weigh = self.search.weigh(self.fit)
            projection = self.scores.projection
            best = best_free_curve(self.search.context, self.fit, joint, weigh, projection)
            self._gains[joint] = best.gain
        return self._gains[joint]


def best_free_curve(
    context: FitContext, fit: Fit, joint: int, weigh: Weigh, projection: Projection
) -> FreeCurveGain:
    """Best free curve of a torque on the motor of a joint, in addition to the model's own parameters."""
    point = context.two_band.with_layout(fit.layout).narrow.at(fit.x)
    motions = point.context.motions(joint)
    chain = context.chain(fit)
    best = FreeCurveGain("", 0.0)
    for variable in VARIABLES:
        weighed = []
        pieces = curve_pieces(motions, variable)
        for k, (block, piece) in enumerate(zip(point.signals.blocks, pieces, strict=True)):
            filtered = point.context.filtered_block(k, piece, joint, 3)
            here = chain.rows(block.rows)
            columns = [here.column("torque", (joint,), one[:, :, None]) for one in filtered]
            weighed.append(weigh(np.stack(columns, axis=2), k))
        gram, along = projection.normal(np.concatenate(weighed))
        gain = explained(gram, along)[1] - len(along) * float(np.log(len(projection.residual)))
        if gain > best.gain:
            best = FreeCurveGain(variable, gain)
    return best


def curve_pieces(motions: Sequence[JointMotion], variable: str) -> list[Array]:
    """Splines of a variable in every stretch, shape (C, N_fine)."""
    field = {DIRECTED: "position", "load": "torque"}.get(variable, variable)
    values = [getattr(motion, field) for motion in motions]
    splines = equally_filled_splines(values)
    pieces = [splines.design(v, m.velocity).T for v, m in zip(values, motions, strict=True)]
    signs = [smooth_sign(m.velocity) for m in motions]
    if variable == DIRECTED:
        return [np.vstack((p, p * s)) for p, s in zip(pieces, signs, strict=True)]
    if variable == "velocity":  # with a jump at rest
        return [np.vstack((p, s)) for p, s in zip(pieces, signs, strict=True)]
    return pieces
