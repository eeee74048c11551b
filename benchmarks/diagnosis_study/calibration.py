"""Weights of the confidence, fitted to a study's findings.

Fit them to another seed than the one whose table is shown: `calibrate --seed 2 --work OTHER`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize

from benchmarks.diagnosis_study.judging import Stated

SHRINK = 0.02  # of the squared weights: a few hundred findings must not lead to certainty
SIGNS = (1, 1, 1, -1)  # of the features' weights


def weights(stated: Sequence[Stated]) -> tuple[float, ...]:
    """Logistic regression of right on the features, each weight with its sign: of one and of the features."""
    features = np.array([s.features for s in stated])
    right = np.array([s.right for s in stated])
    columns = np.column_stack((np.ones(len(features)), features))

    def cost(w: np.ndarray) -> tuple[float, np.ndarray]:
        odds = columns @ w
        loss = np.logaddexp(0.0, np.where(right, -odds, odds)).sum() + 0.5 * SHRINK * float(w[1:] @ w[1:])
        slope = columns.T @ (1 / (1 + np.exp(-odds)) - right)
        slope[1:] += SHRINK * w[1:]
        return float(loss), slope

    bounds = [(None, None), *((0.0, None) if sign > 0 else (None, 0.0) for sign in SIGNS)]
    found = minimize(cost, np.zeros(columns.shape[1]), jac=True, bounds=bounds, method="L-BFGS-B")
    return tuple(round(float(w), 3) for w in found.x)
