"""Weights of the confidence, fitted to a study's cases and checked crosswise: each half by the other's."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize

from benchmarks.diagnosis_study.judging import Judged, Stated
from flexviz.diagnosis.confidence import probability

SHRINK = 0.02  # of the squared weights: a few hundred findings must not lead to certainty
SIGNS = (1, 1, -1)  # of the features' weights
BINS = (0.0, 0.5, 0.7, 0.85, 0.95, 0.98, 1.0)


def halves(cases: Sequence[Judged]) -> tuple[list[Stated], list[Stated]]:
    """The findings of each half; a case's name decides where it belongs."""
    out: tuple[list[Stated], list[Stated]] = ([], [])
    for case in cases:
        out[zlib.crc32(case.case.encode()) % 2].extend(case.stated)
    return out


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


def crosswise(cases: Sequence[Judged]) -> list[Stated]:
    """Every finding, stated as the weights that were fitted to the other half of the cases say."""
    one, other = halves(cases)
    out = []
    for judged, fitted in ((one, other), (other, one)):
        if len({s.right for s in fitted}) > 1:
            given = weights(fitted)
            out += [replace(s, confidence=probability(s.features, given)) for s in judged]
    return out


def report(stated: Sequence[Stated]) -> list[str]:
    """Stated against right, a line a bin."""
    sure = np.array([s.confidence for s in stated])
    right = np.array([s.right for s in stated])
    lines = []
    for low, high in pairwise(BINS):
        inside = (sure >= low) & ((sure < high) | (high == 1.0))
        if inside.any():
            n, mean = int(inside.sum()), sure[inside].mean()
            lines.append(f"{low:.2f}-{high:.2f}: {right[inside].sum()} of {n} right, stated {mean:.3f}")
    return lines
