"""Confidence in a finding: logistic regression on its features.

The weights for single effects are fitted to the simulated cases of the diagnosis study and cross-validated
in two halves (`python -m benchmarks.diagnosis_study calibrate`). Those for an effect among many were set
beforehand and hold on sixty sets with many effects (`python -m benchmarks.robotlike_study report`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.diagnosis.acceptance import excess, held_out_share, removed_share
from flexviz.diagnosis.fit_context import Fit
from flexviz.diagnosis.thresholds import THRESHOLDS

WEIGHTS = (1.294, 0.598, 0.546, -2.372)  # intercept, then the features
# of an effect among many: intercept, then `rich_result.features`
WEIGHTS_AMONG_MANY = (0.5, 0.8, 0.5, 0.3, -0.8)


def probability_among_many(evidence: Sequence[float]) -> float:
    """Probability that an effect found by the search backwards is correct, or tied with the correct one."""
    return probability(evidence, WEIGHTS_AMONG_MANY)


def features(before: Fit, after: Fit, final: Fit) -> tuple[float, float, float]:
    """Features of a finding.

    Args:
        before, after: the model without and with it.
        final: the last model of the diagnosis.

    Returns:
        log of the gain in the objective relative to the minimum gain; share of the excess over the noise that
        the effect removed; log of one plus the excess of the final model (`_doubtful_excess`).
    """
    gain = before.objective - after.objective
    least = THRESHOLDS.acceptance.least_gain
    share = removed_share(before, after)
    left = float(np.log1p(_doubtful_excess(share, held_out_share(before, after), final)))
    return float(np.log(max(gain, 1.0) / least)), share, left


def _doubtful_excess(share: float, held_out: float, final: Fit) -> float:
    """Excess of the final model, as far as it casts doubt on an effect that removed these shares of it.

    Where nearly all is removed, also in the held-out groups, or these are at their noise, what is left is a
    trace of the effect's own form, such as the edges of a contact: no imitation predicts others so well.
    """
    limits, chi = THRESHOLDS.evidence, final.chi_held_out
    predicted = np.isfinite(chi).all() and (chi.max() < limits.predicted or held_out > limits.nearly_all)
    if share > limits.nearly_all and predicted:
        return excess(final) * (1 - share) / (1 - limits.nearly_all)
    return excess(final)


def probability(evidence: Sequence[float], weights: Sequence[float] = WEIGHTS) -> float:
    """Probability that a finding with these features is correct, or tied with the correct one."""
    odds = weights[0] + float(np.dot(weights[1:], evidence))
    return float(
        np.clip(1 / (1 + np.exp(-np.clip(odds, -30.0, 30.0))), 0.0, THRESHOLDS.evidence.max_confidence)
    )
