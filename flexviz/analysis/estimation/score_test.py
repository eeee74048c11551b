"""Score test: expected gain of a small additional effect at a fitted model.

The signature h of an effect (the change of r per unit of its coefficients) explains (hᵀ r)² / (hᵀ h) of the
weighted residual, after the model's own parameters are projected out of h by h − Z H⁻¹ Zᵀ h, with the
weighted Jacobian Z and H = Zᵀ Z + the prior's Hessian. Norms and products of the projected signatures need
only Zᵀ h.

The interval of an episode is found in closed form over all pairs of instants: a box in time is the difference
of two steps, so that the gain of every pair follows from the Gram matrix of the steps' signatures.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np

from flexviz.analysis.estimation.linear_algebra import scaled_inverse
from flexviz.base.arrays import Array
from flexviz.model.effects import EFFECTS, ChosenEffect, Guess
from flexviz.model.equation import Chain, OperatingPoint

Weigh = Callable[[Array, int], Array]  # columns (N_block, n, C) of a stretch, its index → (N_block·n, C)

MIN_REMAINDER = 1e-10  # share of a signature's squared norm below which the model already contains the effect
MAX_BATCH_COLUMNS = 64  # weighted at a time
MIN_BATCH_COLUMNS, MAX_BATCH_NUMBERS = 8, 2e6  # … of a long record fewer
MAX_INSTANTS = 100  # candidate instants per stretch
MIN_INSTANT_SPACING = 0.1  # [s]
MIN_EPISODE = 0.2  # [s]


class Projection:
    """Projection of signatures onto the complement of the model's own parameters.

    Args:
        residual: shape (M,), weighted.
        instruments: shape (M, P), weighted Jacobian of the present model; or a function that makes it, which
            is then called whenever it is needed.
        hessian: shape (P, P), instrumentsᵀ instruments + Hessian of the prior.
        prior_gradient: shape (P,). If given, the prior counts like further measurements: an effect also gains
            what the prior pays for parameters that stand in for it, such as masses far from the CAD model.
    """

    def __init__(
        self,
        residual: Array,
        instruments: Array | Callable[[], Array],
        hessian: Array,
        prior_gradient: Array | None = None,
    ) -> None:
        self.residual, self._instruments = residual, instruments
        self._inverse = scaled_inverse(hessian, rcond=1e-13)
        z = self.instruments
        self._gram = z.T @ z
        self._along = z.T @ residual
        if prior_gradient is not None:
            self._gram = hessian
            self._along = self._along + prior_gradient

    @property
    def instruments(self) -> Array:
        """Weighted Jacobian, shape (M, P)."""
        return self._instruments() if callable(self._instruments) else self._instruments

    @property
    def of_residual(self) -> Projection:
        """The same, where an effect gains only what it explains of the residual."""
        other = copy(self)
        z = self.instruments
        other._gram, other._along = z.T @ z, z.T @ self.residual
        return other

    def normal(self, columns: Array, rows: slice | None = None) -> tuple[Array, Array]:
        """Gram matrix (C, C) of projected signatures and their products with the residual (C,).

        Args:
            columns: shape (M_rows, C), weighted signatures.
            rows: nonzero rows; default: all.
        """
        rows = slice(None) if rows is None else rows
        inside = self.instruments[rows].T @ columns
        share = self._inverse @ inside
        gram = columns.T @ columns
        full = np.diag(gram).copy()
        gram += share.T @ (self._gram @ share) - 2 * (inside.T @ share)
        along = columns.T @ self.residual[rows] - share.T @ self._along
        gram = 0.5 * (gram + gram.T)
        dead = np.diag(gram) <= MIN_REMAINDER * full
        gram[dead] = gram[:, dead] = along[dead] = 0.0
        return gram, along

    def share(self, columns: Array) -> Array:
        """Changes of the model's own parameters, shape (P, C), that imitate signatures (M, C)."""
        return self._inverse @ (self.instruments.T @ columns)

    def remainder(self, columns: Array) -> tuple[Array, Array]:
        """`share` of weighted signatures (M, C), and the squared norms that it leaves of them, shape (C,)."""
        inside = self.instruments.T @ columns
        share = self._inverse @ inside
        imitated = np.sum(share * (self._gram @ share - 2 * inside), axis=0)
        return share, np.maximum(np.einsum("mc,mc->c", columns, columns) + imitated, 0.0)

    def rest(self, columns: Array) -> Array:
        """Projected signatures of weighted ones, shape (M, C)."""
        return columns - self.instruments @ self.share(columns)


@dataclass(frozen=True, eq=False)
class ScoredCandidate:
    """A candidate effect with its expected gain.

    Attributes:
        effect: effect and location.
        gain: decrease of the weighted sum of squares.
        values: start values of the effect's parameters, shape (P,).
    """

    effect: ChosenEffect
    gain: float
    values: Array


def score(
    point: OperatingPoint, chain: Chain, wanted: Sequence[ChosenEffect], weigh: Weigh, projection: Projection
) -> list[ScoredCandidate]:
    """Score of every effect at its best guess: what it would gain without being fitted.

    For signatures h of the weighted residual, with the model's own parameters projected out, an effect lowers
    the sum of squares by (hᵀ r)² / (hᵀ h), to first order and in closed form. Values outside their bounds do
    not count.

    Args:
        point: operating point at the present parameters, with the stretches of `weigh`.
        chain: sensitivity of r to s and q.
        wanted: effects to score.
        weigh: applies the weights of the residual to columns.
        projection: projects out the model's own parameters.

    Returns:
        one entry per effect, in the order of `wanted`, without effects whose guesses are all out of bounds.
    """
    best: dict[ChosenEffect, ScoredCandidate] = {}
    for part, weighed in _weighted_batches(point, chain, wanted, weigh):
        gram, along = projection.normal(weighed)
        at = 0
        for effect, guess in part:
            here = slice(at, at + len(guess.columns))
            at = here.stop
            coefficients, gain = explained(gram[here, here], along[here])
            values = np.asarray(guess.to_values(coefficients), float)  # type: ignore[operator]
            if allowed(effect, values) and (effect not in best or gain > best[effect].gain):
                best[effect] = ScoredCandidate(effect, gain, values)
    return [best[effect] for effect in wanted if effect in best]


def shares_alone(
    point: OperatingPoint, chain: Chain, wanted: Sequence[ChosenEffect], weigh: Weigh, projection: Projection
) -> dict[ChosenEffect, float]:
    """Share of the rms residual of its joint (without one: of all) that each effect alone would remove.

    An estimate in closed form, 1 − √(1 − gain / |r|²), of the gain in the residual alone; arguments as in
    `score`.
    """
    squares = np.sum(projection.residual.reshape(-1, point.layout.n) ** 2, axis=0)
    found = score(point, chain, wanted, weigh, projection.of_residual)
    of = {s.effect: squares.sum() if s.effect.joint is None else squares[s.effect.joint] for s in found}
    return {s.effect: 1.0 - float(np.sqrt(max(1.0 - s.gain / of[s.effect], 0.0))) for s in found}


def weighted_guesses(
    point: OperatingPoint, chain: Chain, wanted: Sequence[ChosenEffect], weigh: Weigh
) -> Iterator[tuple[ChosenEffect, Array]]:
    """Each guess of each effect with its weighted signatures, shape (N n, C); arguments as in `score`."""
    for part, weighed in _weighted_batches(point, chain, wanted, weigh):
        ends = np.cumsum([len(guess.columns) for _, guess in part])
        for (effect, _), columns in zip(part, np.split(weighed, ends[:-1], axis=1), strict=True):
            yield effect, columns


def _weighted_batches(
    point: OperatingPoint, chain: Chain, wanted: Sequence[ChosenEffect], weigh: Weigh
) -> Iterator[tuple[list[tuple[ChosenEffect, Guess]], Array]]:
    """Guesses with their weighted signatures side by side, shape (N n, C)."""
    for part in _batches(point, wanted):
        columns = np.concatenate(
            [np.stack([chain.column(g.entry, g.joints, one) for one in g.columns], axis=2) for _, g in part],
            axis=2,
        )
        yield (
            part,
            np.concatenate([weigh(columns[b.rows], k) for k, b in enumerate(point.signals.blocks)], axis=0),
        )


def _batches(
    point: OperatingPoint, wanted: Sequence[ChosenEffect]
) -> Iterator[list[tuple[ChosenEffect, Guess]]]:
    """Guesses of all effects, as many at a time as are weighted together."""
    samples = point.signals.count * point.layout.n
    most = int(np.clip(MAX_BATCH_NUMBERS / samples, MIN_BATCH_COLUMNS, MAX_BATCH_COLUMNS))
    batch: list[tuple[ChosenEffect, Guess]] = []
    width = 0
    for effect in wanted:
        for guess in EFFECTS[effect.effect].guesses(point.context, effect.place):
            if batch and width + len(guess.columns) > most:
                yield batch
                batch, width = [], 0
            batch.append((effect, guess))
            width += len(guess.columns)
    if batch:
        yield batch


def explained(gram: Array, along: Array) -> tuple[Array, float]:
    """Coefficients (C,) of largest gain, and the gain: the decrease of the sum of squares."""
    coefficients = np.zeros(len(along))
    size = np.sqrt(np.maximum(np.diag(gram), 0.0))
    alive = size > 0
    if alive.any():
        d = size[alive]
        scaled = gram[np.ix_(alive, alive)] / d[:, None] / d
        # minimises |r + h c|²: the coefficients have the opposite sign of the component in r
        coefficients[alive] = -np.linalg.lstsq(scaled, along[alive] / d, rcond=1e-10)[0] / d
    return coefficients, float(-2 * coefficients @ along - coefficients @ gram @ coefficients)


def allowed(effect: ChosenEffect, values: Array) -> bool:
    """Whether the nonnegative parameters are within their bounds."""
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
    """Interval of each stretch in which a constant torque on a joint explains most, the best stretch first.

    Args:
        point: operating point at the present parameters.
        joint: index in the set's joint order.
        weigh: applies the weights of the residual to columns.
        projection: projects out the model's own parameters.
        group: restrict the search to this group.
        longest: maximum length of an episode relative to its stretch.
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
        instants = np.arange(time.min(), time.max(), max(MIN_INSTANT_SPACING, length / MAX_INSTANTS))
        # a step of torque on the link side adds its filtered form to r
        columns = np.zeros((len(time), n, len(instants)))
        columns[:, joint] = point.context.steps_block(index, instants, joint).T
        weighed = weigh(columns, index)
        rows = slice(block.rows.start * n, block.rows.stop * n)
        gram, along = projection.normal(weighed, rows)
        first, last = np.triu_indices(len(instants), 1)
        duration = instants[last] - instants[first]
        fits = (duration >= MIN_EPISODE) & (duration <= longest * length + 1e-9)
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
        for episode in episodes:
            out.append(ScoredCandidate(ChosenEffect(episode, joint, name), float(gain[best]), values))
    return sorted(out, key=lambda s: -s.gain)
