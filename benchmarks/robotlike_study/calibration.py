"""Stated confidences scaled to how often they are right; each half of the cases by the other half."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.logistic import half, logistic
from benchmarks.robotlike_study.judging import Addition, Scored

Array = NDArray[np.float64]

PRIOR = 0.1  # of the squared deviations from the stated log-odds: few findings must not lead to certainty


def scale(stated: Array, right: NDArray[np.bool_]) -> tuple[float, float]:
    """Offset a and factor b of the log-odds, a + b·logit(stated), that make the stated confidences likeliest.

    Args:
        stated: shape (M,), confidences.
        right: shape (M,), whether each was right.
    """
    columns = np.column_stack((np.ones(len(stated)), _logit(stated)))
    offset, factor = logistic(columns, right, np.array([0.0, 1.0]), np.full(2, PRIOR), signs=(0, 1))
    return float(offset), float(factor)


def crosswise(cases: Sequence[Scored]) -> tuple[Array, NDArray[np.bool_]]:
    """Every stated confidence (M,), scaled as the other half of the cases says, and whether it was right."""
    halves: tuple[list[Addition], list[Addition]] = ([], [])
    for case in cases:
        halves[half(case.case)].extend(a for a in case.additions if a.confidence is not None)
    stated, right = zip(*(_arrays(each) for each in halves), strict=True)
    scales = [scale(*each) for each in zip(stated, right, strict=True)]
    scaled = [
        1 / (1 + np.exp(-(offset + factor * _logit(given))))
        for given, (offset, factor) in zip(stated, reversed(scales), strict=True)
    ]
    return np.concatenate(scaled), np.concatenate(right)


def overall(cases: Sequence[Scored]) -> tuple[float, float]:
    """The scale that all cases say."""
    return scale(*_arrays([a for c in cases for a in c.additions if a.confidence is not None]))


def _arrays(additions: Sequence[Addition]) -> tuple[Array, NDArray[np.bool_]]:
    return np.array([a.confidence for a in additions], float), np.array([a.right for a in additions], bool)


def _logit(probability: Array) -> Array:
    clipped = np.clip(probability, 1e-3, 1 - 1e-3)
    return np.log(clipped / (1 - clipped))
