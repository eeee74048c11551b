"""Weights of the confidence, fitted to a study's cases and checked crosswise: each half by the other's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from flexviz.diagnosis.confidence import probability

from benchmarks.diagnosis_study.judging import Judged, Stated
from benchmarks.logistic import half, logistic

SHRINK = 0.02  # of the squared weights: a few hundred findings must not lead to certainty
SIGNS = (1, 1, -1)  # of the features' weights
BINS = (0.0, 0.5, 0.7, 0.85, 0.95, 0.98, 1.0)


def halves(cases: Sequence[Judged]) -> tuple[list[Stated], list[Stated]]:
    """The findings of each half; a case's name decides where it belongs."""
    out: tuple[list[Stated], list[Stated]] = ([], [])
    for case in cases:
        out[half(case.case)].extend(case.stated)
    return out


def weights(stated: Sequence[Stated]) -> tuple[float, ...]:
    """Logistic regression of right on the features, each weight with its sign: of one and of the features."""
    features = np.array([s.features for s in stated])
    right = np.array([s.right for s in stated])
    columns = np.column_stack((np.ones(len(features)), features))

    shrink = 0.5 * SHRINK * np.array([0.0, *np.ones(len(SIGNS))])
    found = logistic(columns, right, np.zeros(columns.shape[1]), shrink, signs=(0, *SIGNS))
    return tuple(round(float(w), 3) for w in found)


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
