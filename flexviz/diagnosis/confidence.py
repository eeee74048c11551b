"""How sure a finding is, as a probability."""

from __future__ import annotations

import numpy as np

from flexviz.diagnosis.fitting import Fit
from flexviz.diagnosis.judging import removed

WEIGHTS = (0.0, 1.0, 1.0, 1.0)


def features(before: Fit, after: Fit, gain: float, margin: float) -> tuple[float, float, float]:
    """What speaks for a finding: log gain, log margin over the best rival, share of the excess removed."""
    return (
        float(np.log(max(gain, 1.0) / 100.0)),
        float(np.log(max(margin, 1.0) / 30.0)),
        removed(before, after),
    )


def confidence(before: Fit, after: Fit, gain: float, margin: float) -> float:
    """Probability that the named effect is the right one."""
    evidence = WEIGHTS[0] + float(np.dot(WEIGHTS[1:], features(before, after, gain, margin)))
    return float(1 / (1 + np.exp(-np.clip(evidence, -30.0, 30.0))))
