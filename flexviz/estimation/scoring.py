"""Score test: what an effect would take from the residual if it were small.

At a fitted model, an effect's signature h (the change of r per unit of its coefficients) explains
(hᵀ r)² / (hᵀ h) of the weighted residual once everything that the model's own parameters can do is taken out
of h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import Chain, OperatingPoint
from flexviz.estimation.projection import Projection, Weigh

Array = NDArray[np.float64]

BATCH = 64  # columns that are weighted at once


@dataclass(frozen=True, eq=False)
class Scored:
    """One guess and what it would explain.

    Attributes:
        effect: which effect, where.
        gain: fall of the weighted sum of squares.
        values: the effect's parameters at which a search may start, shape (P,).
        signature: shape (M_rows,), the guess's best combination, weighted.
        rows: where the signature is not zero; everywhere where None.
    """

    effect: ChosenEffect
    gain: float
    values: Array
    signature: Array
    rows: slice | None = None


def score(
    point: OperatingPoint, chain: Chain, wanted: Sequence[ChosenEffect], weigh: Weigh, projection: Projection
) -> list[Scored]:
    """The best guess of every effect.

    Args:
        point: at the present parameters; its stretches are those of `weigh`.
        chain: how changes of s and q move r there.
        wanted: the effects to try.
        weigh: weights columns as the projection's residual.
        projection: takes out what the model can do by itself.

    Returns:
        one entry an effect, in the order of `wanted`, without those whose every guess has an impossible sign.
    """
    guesses = [
        (effect, guess)
        for effect in wanted
        for guess in EFFECTS[effect.effect].guesses(point.context, effect.place)
    ]
    best: dict[ChosenEffect, Scored] = {}
    start = 0
    while start < len(guesses):
        stop, width = start, 0
        while stop < len(guesses) and (width == 0 or width + len(guesses[stop][1].columns) <= BATCH):
            width += len(guesses[stop][1].columns)
            stop += 1
        part = guesses[start:stop]
        columns = np.concatenate(
            [np.stack([chain.column(g.entry, g.joints, one) for one in g.columns], axis=2) for _, g in part],
            axis=2,
        )
        weighed = np.concatenate(
            [weigh(columns[b.rows], k) for k, b in enumerate(point.signals.blocks)], axis=0
        )
        gram, along = projection.normal(weighed)
        at = 0
        for effect, guess in part:
            here = slice(at, at + len(guess.columns))
            at = here.stop
            coefficients, gain = explained(gram[here, here], along[here])
            values = np.asarray(guess.to_values(coefficients), float)  # type: ignore[operator]
            if allowed(effect, values) and (effect not in best or gain > best[effect].gain):
                best[effect] = Scored(effect, gain, values, weighed[:, here] @ coefficients)
        start = stop
    return [best[effect] for effect in wanted if effect in best]


def explained(gram: Array, along: Array) -> tuple[Array, float]:
    """Coefficients (C,) that take most from the residual, and the fall of its sum of squares."""
    coefficients = np.zeros(len(along))
    size = np.sqrt(np.maximum(np.diag(gram), 0.0))
    alive = size > 0
    if alive.any():
        d = size[alive]
        scaled = gram[np.ix_(alive, alive)] / d[:, None] / d
        # r + h c → least: the coefficients carry the opposite sign of what r contains
        coefficients[alive] = -np.linalg.lstsq(scaled, along[alive] / d, rcond=1e-10)[0] / d
    return coefficients, float(-2 * coefficients @ along - coefficients @ gram @ coefficients)


def allowed(effect: ChosenEffect, values: Array) -> bool:
    """False where a parameter that cannot be negative is, or one lies beyond its bound."""
    specs = EFFECTS[effect.effect].parameters
    return not any(v < p.lower or v > p.upper for v, p in zip(values, specs, strict=True) if p.lower == 0.0)
