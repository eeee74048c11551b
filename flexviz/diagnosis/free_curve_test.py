"""What a free curve could explain: the measure for effects that leave much unexplained.

Where no model reaches the noise, some flexible effect always takes a part of what is left (a ripple of a bump
in position). A curve of free shape against one variable of the same joint tells how large a part an effect of
that kind should take; one that takes much less is an imitation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from flexviz.diagnosis.acceptance import NAMED
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.search import Scores, Search
from flexviz.effects import ChosenEffect, JointMotion, smooth_sign
from flexviz.estimation import Projection, Weigh, explained

Array = NDArray[np.float64]

PIECES = 14  # of a curve


@dataclass(frozen=True)
class FreeCurveGain:
    """The best free curve on a joint.

    Attributes:
        variable: "position", "position × direction", "velocity", "load" or "time".
        gain: fall of the weighted sum of squares, less the curve's freedom times log N.
    """

    variable: str
    gain: float


class FreeCurveTest:
    """Whether effects take a share of what free curves on their joints would, in units of the noise.

    Args:
        search: without a model error.
        fit: the model so far.
        scores: of all candidates there.
    """

    def __init__(self, search: Search, fit: Fit, scores: Scores) -> None:
        self.search, self.fit, self.scores = search, fit, scores
        self._free: dict[int, float] = {}

    def __call__(self, effect: ChosenEffect) -> bool:
        joints = range(self.fit.layout.n) if effect.joint is None else [effect.joint]
        most = max(self.free(joint) for joint in joints)
        gain = next((s.gain for s in self.scores.ranked if s.effect == effect), 0.0)
        return gain >= NAMED * most

    def free(self, joint: int) -> float:
        """What a free curve on a joint would explain."""
        if joint not in self._free:
            weigh = self.search.weigh(self.fit)
            projection = self.scores.projection
            self._free[joint] = free_curve(self.search.context, self.fit, joint, weigh, projection).gain
        return self._free[joint]


def free_curve(
    fit_context: FitContext, fit: Fit, joint: int, weigh: Weigh, projection: Projection
) -> FreeCurveGain:
    """The best free curve of a torque on the motor of a joint, beside what the model can do."""
    point = fit_context.two_band.with_layout(fit.layout).narrow.at(fit.x)
    motions = point.context.motions(joint)
    chain = fit_context.chain(fit)
    best = FreeCurveGain("", 0.0)
    for variable in VARIABLES:
        parts = _columns(motions, variable)
        weighed = []
        for k, (block, part) in enumerate(zip(point.signals.blocks, parts, strict=True)):
            filtered = point.context.filtered_block(k, part, joint, 3)
            here = chain.rows(block.rows)
            columns = [here.column("torque", (joint,), one[:, :, None]) for one in filtered]
            weighed.append(weigh(np.stack(columns, axis=2), k))
        gram, along = projection.normal(np.concatenate(weighed))
        gain = explained(gram, along)[1] - len(along) * float(np.log(len(projection.residual)))
        if gain > best.gain:
            best = FreeCurveGain(variable, gain)
    return best


VARIABLES = ("position", "position × direction", "velocity", "load", "time")


def _columns(motions: Sequence[JointMotion], variable: str) -> list[Array]:
    """Pieces of a curve for every stretch, shape (C, N_fine)."""
    if variable == "position × direction":
        pieces = _splines([m.position for m in motions], PIECES)
        signs = [smooth_sign(m.velocity) for m in motions]
        return [np.vstack((p, p * s)) for p, s in zip(pieces, signs, strict=True)]
    values = {
        "position": [m.position for m in motions],
        "velocity": [m.velocity for m in motions],
        "load": [m.torque for m in motions],
        "time": [m.time for m in motions],
    }[variable]
    pieces = _splines(values, PIECES)
    if variable == "velocity":  # with a jump at rest
        return [np.vstack((p, smooth_sign(m.velocity))) for p, m in zip(pieces, motions, strict=True)]
    return pieces


def _splines(values: list[Array], pieces: int) -> list[Array]:
    """Cubic B-splines between evenly filled knots."""
    together = np.concatenate(values)
    low, high = np.quantile(together, [0.001, 0.999])
    inner = np.quantile(together, np.linspace(0, 1, pieces - 2)[1:-1])
    width = max(float(high - low), 1e-12)
    knots = np.concatenate(([low] * 4, np.clip(inner, low, high), [low + width] * 4))
    knots = np.maximum.accumulate(knots)
    return [BSpline.design_matrix(np.clip(v, low, low + width), knots, 3).toarray().T for v in values]
