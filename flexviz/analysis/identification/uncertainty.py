"""Uncertainty of an identification: of its parameters, and of stiffnesses that may be infinite."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.analysis.estimation import Covariance
from flexviz.base.arrays import Array, Bools
from flexviz.model.equation import Layout

Stated = Callable[[Sequence[Bools]], list[tuple[Covariance, Covariance]]]
"""Parameters that are held, (P,) each -> covariance with what the model lacks, and of chance alone."""


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Covariances of the parameters.

    Attributes:
        covariance: with what the model lacks.
        chance: without.
        unbound: the two without holding a stiffness at its bound.
    """

    covariance: Covariance
    chance: Covariance
    unbound: tuple[Covariance, Covariance]


def uncertainty(stated: Stated, layout: Layout, at_bound: Bools, move: Array) -> Uncertainty:
    """The covariances of a fit with parameters at their bounds, (P,).

    `move`, shape (P,), counts as a standard error: how the parameters move with what the model lacks.
    """
    free = at_bound.copy()
    free[layout.compliance] = layout.held[layout.compliance]
    held = [at_bound] if np.array_equal(free, at_bound) else [at_bound, free]
    found = []
    for one, (covariance, chance) in zip(held, stated(held), strict=True):
        moved = np.where(one, 0.0, move)
        found.append((covariance.replaced(covariance.matrix + np.outer(moved, moved)), chance))
    covariance, chance = found[0]
    return Uncertainty(covariance, chance, found[-1])
