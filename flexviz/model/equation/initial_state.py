"""Unknown initial state of friction with memory.

The decay of the initial state is known: r contains known columns C of unknown size h. Per stretch, the
least-squares fit of h is subtracted from r and from its Jacobian: r − C (CᵀC + λ)⁻¹ Cᵀ r.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array
from flexviz.model.effects import EFFECTS, ChosenEffect, LawEffect
from flexviz.model.equation.chain import Chain
from flexviz.model.equation.context import EffectContext
from flexviz.model.equation.signals import Signals

RIDGE = 0.01  # relative to the largest value of a column


@dataclass(frozen=True)
class InitialStates:
    """Columns of the unknown initial states of one stretch."""

    rows: slice  # the stretch's samples
    columns: Array  # (N_block · n, M), ∂r
    solve: Array  # (M, N_block · n), linear map from r to the least-squares sizes

    def remove_from(self, r: Array) -> None:
        """Project the columns out of residuals (N, n) or Jacobians (N, n, P), in place."""
        part = r[self.rows]
        flat = part.reshape(len(self.columns), -1)
        r[self.rows] = (flat - self.columns @ (self.solve @ flat)).reshape(part.shape)


def initial_states(
    context: EffectContext, signals: Signals, effects: Sequence[tuple[ChosenEffect, Array]], chain: Chain
) -> list[InitialStates]:
    """The columns of every stretch that has an unknown initial state; `effects`: with their parameters."""
    found: dict[int, list[Array]] = {}
    for effect, values in effects:
        law = EFFECTS[effect.effect]
        if not isinstance(law, LawEffect) or not law.memory or effect.joint is None:
            continue
        for index, motion in enumerate(context.motions(effect.joint)):
            unknown = law.unknown(motion, values)
            filtered = context.filtered_block(index, unknown, effect.joint, law.depth)[..., None]
            part = chain.rows(signals.blocks[index].rows)
            columns = part.columns(law.entry, (effect.joint,), filtered).reshape(-1, len(unknown))
            found.setdefault(index, []).append(columns / np.maximum(np.abs(unknown).max(axis=1), 1e-12))
    out = []
    for index, parts in found.items():
        c = np.concatenate(parts, axis=1)
        solve = np.linalg.inv(c.T @ c + RIDGE**2 * np.eye(c.shape[1])) @ c.T
        out.append(InitialStates(signals.blocks[index].rows, c, solve))
    return out
