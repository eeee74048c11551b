"""Whether the size of an effect is the same throughout the recordings.

A clamp that works loose looks like backlash, and a constant backlash explains most of it. The score test of a
size that changes linearly with the time of each recording shows the difference: the law is not the library's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.acceptance import verdict
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.estimation import Projection, explained

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.acceptance


@dataclass(frozen=True)
class ChangingSize:
    """A size p of an effect that changes during the recordings.

    Attributes:
        effect: the effect.
        parameter: index of p among the effect's parameters.
        start, end: about p at the start and at the end of a recording, in the unit of p.
        gain: decrease of the weighted sum of squares if p changes linearly with time.
    """

    effect: ChosenEffect
    parameter: int
    start: float
    end: float
    gain: float

    def text(self, joints: tuple[str, ...]) -> str:
        """The finding as a sentence."""
        law = EFFECTS[self.effect.effect]
        spec = law.parameters[self.parameter]
        verb = "grows" if abs(self.end) > abs(self.start) else "falls"
        return (
            f"{spec.name} of {self.effect.text(joints)} is not constant: it {verb} from about "
            f"{self.start:.2g} to {self.end:.2g} {spec.unit} during a recording, "
            "which this effect cannot describe"
        )


def changing_size(context: FitContext, fit: Fit, rival: float = 0.0) -> ChangingSize | None:
    """The size whose change with time explains most of what a model leaves; None if all are constant.

    `rival`: the score of another effect, which it has to surpass clearly.
    """
    sized = [
        (effect, k, where.start + k)
        for effect, where in fit.layout.effect_slices()
        if EFFECTS[effect.effect].scope != "episode"
        for k in EFFECTS[effect.effect].size_at
    ]
    if not sized:
        return None
    point, z = fit.point, fit.point.z
    flat = z.reshape(-1, fit.layout.size)
    hessian = flat.T @ flat + context.start(fit.layout).prior.gradient_and_hessian(fit.x)[1]
    projection = Projection(point.r.ravel(), flat, hessian)
    left = np.count_nonzero(point.used) * float(np.maximum(point.chi - 1.0, 0.0).sum())
    least = max(LIMITS.changing_gain, LIMITS.changing_share_of_left * left, LIMITS.changing_lead * rival)
    time = _time_within_groups(context)[:, None]
    found = []
    for effect, k, column in sized:
        signature = (z[:, :, column] * time).reshape(-1, 1)
        change, gain = explained(*projection.normal(signature))
        middle = fit.x[column] - projection.share(signature)[column, 0] * change[0]
        spec = EFFECTS[effect.effect].parameters[k]
        ends = np.clip(middle + change[0] * np.array([-1.0, 1.0]), spec.lower, spec.upper)
        if gain > least and abs(change[0]) > LIMITS.changing_share * abs(fit.x[column]):
            found.append(ChangingSize(effect, k, float(ends[0]), float(ends[1]), gain))
    return max(found, key=lambda one: one.gain, default=None)


def unexplained(context: FitContext, fit: Fit, reference: Fit) -> bool:
    """Whether a model leaves more than noise and the change of a size; `reference` has no effects at all."""
    return verdict(fit, reference) == "unknown" and changing_size(context, fit) is None


def _time_within_groups(context: FitContext) -> Array:
    """Time of each sample, shape (N,), from −1 to 1 within each group."""
    signals = context.two_band.narrow.signals
    out = np.zeros(signals.count)
    for k in range(len(signals.groups)):
        blocks = [block.rows for block in signals.blocks if block.group == k]
        time = np.concatenate([signals.time[rows] for rows in blocks])
        for rows in blocks:
            out[rows] = 2 * (signals.time[rows] - time.min()) / max(float(np.ptp(time)), 1e-300) - 1
    return out
