"""Where the residual lives: joint by variable, by binned means that are judged out of sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.fitting import Fit, Workbench
from flexviz.diagnosis.result import Place

Array = NDArray[np.float64]

BINS = 16


def explained(variable: Array, residual: Array, bins: int = BINS) -> tuple[float, tuple[float, float]]:
    """Share of a residual's variance that its mean against a variable predicts on the other half of it.

    Args:
        variable, residual: shape (N,).

    Returns:
        the share (below zero where there is nothing to predict) and the range that carries most of it.
    """
    edges = np.unique(np.quantile(variable, np.linspace(0, 1, bins + 1)))
    if len(edges) < 3:
        return 0.0, (float(variable.min()), float(variable.max()))
    index = np.clip(np.searchsorted(edges, variable, side="right") - 1, 0, len(edges) - 2)
    # alternate stretches of samples, not single ones: neighbours are correlated
    half = (np.arange(len(residual)) // max(1, len(residual) // 40)) % 2 == 0
    total, left = 0.0, 0.0
    strength = np.zeros(len(edges) - 1)
    for train in (half, ~half):
        count = np.bincount(index[train], minlength=len(edges) - 1)
        mean = np.bincount(index[train], residual[train], len(edges) - 1) / np.maximum(count, 1)
        test = ~train
        total += float(np.sum(residual[test] ** 2))
        left += float(np.sum((residual[test] - mean[index[test]]) ** 2))
        strength += mean**2 * np.bincount(index[test], minlength=len(edges) - 1)
    order = np.argsort(-strength)
    carrying = order[: max(1, int(np.searchsorted(np.cumsum(strength[order]), 0.5 * strength.sum())) + 1)]
    span = (float(edges[carrying.min()]), float(edges[carrying.max() + 1]))
    return 1 - left / max(total, 1e-300), span


def places(bench: Workbench, fit: Fit) -> tuple[Place, ...]:
    """Joint × variable, the joint with the largest excess first, within it what explains most."""
    refinement = bench.refinement.with_layout(fit.layout)
    refinement.narrow.prepare(fit.x)
    evaluation = refinement.narrow.evaluate(fit.x)
    signals = refinement.narrow.signals
    group = np.empty(signals.count)
    for block in signals.blocks:
        group[block.rows] = block.group
    out = []
    residual = evaluation.residual
    excess = np.maximum(fit.chi - 1.0, 0.0)
    for j in np.argsort(-excess, kind="stable"):
        variables = {
            "position": signals.theta[0, :, j],
            "velocity": signals.theta[1, :, j],
            "acceleration": signals.theta[2, :, j],
            "load": evaluation.torque[0, :, j],
            "time": signals.time,
            "group": group,
        }
        rows = []
        for name, values in variables.items():
            share, span = explained(values, residual[:, j])
            rows.append(Place(fit.layout.joints[j], name, max(0.0, share), span))
        out.extend(sorted(rows, key=lambda p: -p.explained))
    return tuple(out)
