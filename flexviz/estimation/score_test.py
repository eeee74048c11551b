"""Score test: what an effect would take from the residual if it were small.

At a fitted model, an effect's signature h (the change of r per unit of its coefficients) explains
(hᵀ r)² / (hᵀ h) of the weighted residual once everything that the model's own parameters can do is removed
from h by h − Z H⁻¹ Zᵀ h, with the weighted Jacobian Z and H = Zᵀ Z + the prior's Hessian. Lengths and
products of what is left need only Zᵀ h.

The interval of an episode is found in closed form over all pairs of instants: a box in time is the difference
of two steps, and with the steps' weighted signatures at all candidate instants, the gain of every pair
follows from their Gram matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import Chain, OperatingPoint
from flexviz.estimation.linear_algebra import scaled_inverse

Array = NDArray[np.float64]
Weigh = Callable[[Array, int], Array]  # columns (N_block, n, C) of a stretch, its index → (N_block·n, C)

LEAST_LEFT = 1e-10  # share of a signature's squared length; below it the model's own parameters do the same
BATCH = 64  # columns that are weighted at once
INSTANTS = 100  # in a group
CLOSEST = 0.1  # [s] between candidate instants
SHORTEST = 0.2  # [s]


class Projection:
    """Gram matrices of signatures, what the model can do taken out of them.

    Args:
        residual: shape (M,), weighted.
        instruments: shape (M, P), weighted Jacobian of the present model.
        hessian: shape (P, P), instrumentsᵀ instruments + the prior's.
    """

    def __init__(self, residual: Array, instruments: Array, hessian: Array) -> None:
        self.residual, self.instruments = residual, instruments
        self._inverse = scaled_inverse(hessian, rcond=1e-13)
        self._gram = instruments.T @ instruments
        self._along = instruments.T @ residual

    def normal(self, columns: Array, rows: slice | None = None) -> tuple[Array, Array]:
        """Gram matrix (C, C) and products with the residual (C,) of what is left of weighted signatures.

        Args:
            columns: shape (M_rows, C).
            rows: where they are not zero.
        """
        rows = slice(None) if rows is None else rows
        inside = self.instruments[rows].T @ columns
        share = self._inverse @ inside
        gram = columns.T @ columns
        full = np.diag(gram).copy()
        gram += share.T @ (self._gram @ share) - 2 * (inside.T @ share)
        along = columns.T @ self.residual[rows] - share.T @ self._along
        gram = 0.5 * (gram + gram.T)
        dead = np.diag(gram) <= LEAST_LEFT * full
        gram[dead] = gram[:, dead] = along[dead] = 0.0
        return gram, along

    def rest(self, columns: Array, rows: slice | None = None) -> Array:
        """What is left of weighted signatures (M_rows, C) themselves, shape (M, C)."""
        rows = slice(None) if rows is None else rows
        share = self._inverse @ (self.instruments[rows].T @ columns)
        out = -(self.instruments @ share)
        out[rows] += columns
        return out


@dataclass(frozen=True, eq=False)
class ScoredCandidate:
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
) -> list[ScoredCandidate]:
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
    best: dict[ChosenEffect, ScoredCandidate] = {}
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
                best[effect] = ScoredCandidate(effect, gain, values, weighed[:, here] @ coefficients)
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


def best_intervals(
    point: OperatingPoint,
    joint: int,
    weigh: Weigh,
    projection: Projection,
    *,
    group: str | None = None,
    longest: float = 1.0,
) -> list[ScoredCandidate]:
    """The interval of every stretch in which a torque on a joint explains most, the best stretch first.

    Args:
        point: at the present parameters.
        joint: index in the set's joint order.
        weigh: weights columns as the projection's residual.
        projection: takes out what the model can do by itself.
        group: only in this one.
        longest: share of the stretch that an episode may fill.
    """
    episodes = [name for name, effect in EFFECTS.items() if effect.scope == "episode"]
    sig, n = point.signals, point.layout.n
    out = []
    for index, block in enumerate(sig.blocks):
        name = sig.groups[block.group].name
        if group is not None and name != group:
            continue
        time = sig.time[block.rows]
        length = float(np.ptp(time))
        instants = np.arange(time.min(), time.max(), max(CLOSEST, length / INSTANTS))
        # T on the link side: r gains the filtered step
        columns = np.zeros((len(time), n, len(instants)))
        columns[:, joint] = point.context.steps_block(index, instants, joint).T
        weighed = weigh(columns, index)
        rows = slice(block.rows.start * n, block.rows.stop * n)
        gram, along = projection.normal(weighed, rows)
        first, last = np.triu_indices(len(instants), 1)
        duration = instants[last] - instants[first]
        fits = (duration >= SHORTEST) & (duration <= longest * length + 1e-9)
        first, last = first[fits], last[fits]
        if not len(first):
            continue
        diagonal = np.diag(gram)
        norm = np.maximum(diagonal[first] + diagonal[last] - 2 * gram[first, last], 1e-9 * gram.max())
        share = along[first] - along[last]
        gain = share**2 / np.maximum(norm, 1e-300)
        best = int(np.argmax(gain))
        a, b = first[best], last[best]
        torque = -share[best] / max(float(norm[best]), 1e-300)
        values = np.array([torque, instants[a], instants[b]])
        signature = (weighed[:, a] - weighed[:, b]) * torque
        for episode in episodes:
            effect = ChosenEffect(episode, joint, name)
            out.append(ScoredCandidate(effect, float(gain[best]), values, signature, rows))
    return sorted(out, key=lambda s: -s.gain)
