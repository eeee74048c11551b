"""How sure a finding is, as a probability.

The log-odds are a weighted sum of what speaks for a finding. The weights are fitted to the cases of the
project's study and checked crosswise, half by half (`python -m benchmarks.diagnosis_study calibrate`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.diagnosis.acceptance import excess, removed
from flexviz.diagnosis.fit_context import Fit

WEIGHTS = (1.294, 0.598, 0.0, 0.546, -2.372)  # of one and of the features
MOST_SURE = 0.99  # of the findings that are stated highest the study shows no more to be right


def features(before: Fit, after: Fit, final: Fit, margin: float) -> tuple[float, float, float, float]:
    """What speaks for a finding.

    Args:
        before, after: the model without and with it.
        final: the last model of the diagnosis.
        margin: of the objective over the best rival that is not reported as tied with it.

    Returns:
        logs of the gain in the objective and of the margin, both relative to what is about needed; the share
        of the excess over the noise that it removed; the log of what the last model leaves.
    """
    gain = before.objective - after.objective
    return (
        float(np.log(max(gain, 1.0) / 100.0)),
        float(np.log(max(margin, 1.0) / 30.0)),
        removed(before, after),
        float(np.log1p(excess(final))),
    )


def probability(evidence: Sequence[float], weights: Sequence[float] = WEIGHTS) -> float:
    """That a finding with these features is the right one, or tied with the right one."""
    odds = weights[0] + float(np.dot(weights[1:], evidence))
    return float(np.clip(1 / (1 + np.exp(-np.clip(odds, -30.0, 30.0))), 0.0, MOST_SURE))
