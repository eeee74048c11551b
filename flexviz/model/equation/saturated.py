"""Torques that stand at a limit, bridged for the filters.

Such rows are left out of fits; that the filters carry little of them to their neighbours, a polynomial
through the torque on both sides takes their place.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.checks import SeenLimit

SIDE = 0.5  # of a plateau's length, on either side of it, that tells how the torque goes on
DEGREE = 4  # of the polynomial
MOST = 2.0  # times the limit: beyond, the polynomial is not trusted


def bridged_torque(tau: Array, limits: Sequence[SeenLimit]) -> tuple[Array, Bools | None]:
    """τ (N, n) with polynomials in place of its plateaus, and where these are, (N, n); None without any."""
    at = {one.joint: one.reached(tau[:, one.joint]) for one in limits}
    if not any(rows.any() for rows in at.values()):
        return tau, None
    out, unknown = np.array(tau, float), np.zeros(tau.shape, bool)
    for one in limits:
        unknown[:, one.joint] = at[one.joint]
        _bridge(out[:, one.joint], at[one.joint], one)
    return out, unknown


def _bridge(tau: Array, at: Bools, seen: SeenLimit) -> None:
    """Polynomials instead of the plateaus `at` (N,) of τ (N,), in place; never short of the limit."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at, [False]]).astype(int)))
    runs = list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
    for k, (first, end) in enumerate(runs):
        low = runs[k - 1][1] if k else 0
        high = runs[k + 1][0] if k + 1 < len(runs) else len(tau)
        side = max(int(SIDE * (end - first)), DEGREE + 1)
        rows = np.concatenate(
            [np.arange(max(first - side, low), first), np.arange(end, min(end + side, high))]
        )
        level = seen.upper if tau[first] > 0 else seen.lower
        if rows.size <= DEGREE or rows[0] >= first or rows[-1] < end:
            continue  # nothing tells how it goes on
        middle, half = (first + end - 1) / 2, max((rows[-1] - rows[0]) / 2, 1.0)
        fitted = np.polynomial.polynomial.polyfit((rows - middle) / half, tau[rows], DEGREE)
        there = np.polynomial.polynomial.polyval((np.arange(first, end) - middle) / half, fitted)
        tau[first:end] = np.sign(level) * np.clip(np.sign(level) * there, abs(level), MOST * abs(level))
