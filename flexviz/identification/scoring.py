"""Score test: what an effect would take from the residual if it were small.

At a fitted model, an effect's signature h (the change of r per unit of its coefficients) explains
(hᵀ r)² / (hᵀ h) of the weighted residual once everything that the model's own parameters can do is taken out
of h.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import EFFECTS, ChosenEffect, Guess
from flexviz.equation import Equation
from flexviz.equation.chain import Chain

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scored:
    """One guess and what it would explain.

    Attributes:
        effect: which effect, where.
        guess: the small version that was scored.
        gain: fall of the weighted sum of squares.
        values: the effect's parameters at which a search may start, shape (P,).
        signature: shape (M,), what is left of the guess's best combination beside the model's own
            parameters, unit length.
    """

    effect: ChosenEffect
    guess: Guess
    gain: float
    values: Array
    signature: Array


def score(
    equation: Equation,
    chain: Chain,
    wanted: Sequence[ChosenEffect],
    weigh: Callable[[Array], Array],
    residual: Array,
    instruments: Array,
    hessian: Array,
) -> list[Scored]:
    """Every guess of every effect.

    Args:
        equation: prepared at the present parameters; its samples are those of `weigh`.
        chain: how changes of s and q move r there.
        wanted: the effects to try.
        weigh: (N, n, C) → (M, C), weighted as `residual`.
        residual: shape (M,).
        instruments: shape (M, P), weighted Jacobian of the present model.
        hessian: shape (P, P), instrumentsᵀ instruments + the prior's.

    Returns:
        one entry a guess, in the order of `wanted`.
    """
    guesses = [
        (effect, guess)
        for effect in wanted
        for guess in EFFECTS[effect.effect].guesses(equation.context, effect.place)
    ]
    if not guesses:
        return []
    rest = beside(instruments, hessian)
    out: list[Scored] = []
    batch = 64
    for start in range(0, len(guesses), batch):
        part = guesses[start : start + batch]
        columns = [
            np.stack([chain.column(g.entry, g.joints, one) for one in g.columns], axis=2) for _, g in part
        ]
        weighed = rest(weigh(np.concatenate(columns, axis=2)))
        at = 0
        for effect, guess in part:
            width = len(guess.columns)
            out.append(_scored(effect, guess, weighed[:, at : at + width], residual))
            at += width
    return out


def beside(instruments: Array, hessian: Array) -> Callable[[Array], Array]:
    """A function that takes out of signatures, shape (M, C), what the model's own parameters can do.

    Args:
        instruments: shape (M, P), weighted Jacobian of the present model.
        hessian: shape (P, P), instrumentsᵀ instruments + the prior's.
    """
    scale = 1 / np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    factor = np.linalg.pinv(hessian * scale[:, None] * scale, rcond=1e-13, hermitian=True)

    def rest(signatures: Array) -> Array:
        share = scale[:, None] * (factor @ (scale[:, None] * (instruments.T @ signatures)))
        return signatures - instruments @ share

    return rest


def _scored(effect: ChosenEffect, guess: Guess, columns: Array, residual: Array) -> Scored:
    norm = np.linalg.norm(columns, axis=0)
    alive = norm > 1e-12 * max(float(np.linalg.norm(residual)), 1e-300)
    coefficients = np.zeros(columns.shape[1])
    if alive.any():
        scaled = columns[:, alive] / norm[alive]
        # r + h c → least: the coefficients carry the opposite sign of what r contains
        coefficients[alive] = -np.linalg.lstsq(scaled, residual, rcond=1e-6)[0] / norm[alive]
    fitted = columns @ coefficients
    length = float(np.linalg.norm(fitted))
    values = np.asarray(guess.to_values(coefficients), float)  # type: ignore[operator]
    return Scored(
        effect, guess, float(-2 * fitted @ residual - fitted @ fitted), values, fitted / max(length, 1e-300)
    )


def best_each(scored: Sequence[Scored]) -> list[Scored]:
    """The best guess of each effect, best effect first; those with an impossible sign come last."""
    best: dict[ChosenEffect, Scored] = {}
    for s in scored:
        if s.effect not in best or _allowed_gain(s) > _allowed_gain(best[s.effect]):
            best[s.effect] = s
    return sorted(best.values(), key=_allowed_gain, reverse=True)


def _allowed_gain(s: Scored) -> float:
    """Its gain; none where a parameter has an impossible sign."""
    specs = EFFECTS[s.effect.effect].parameters
    wrong = any(v < p.lower or v > p.upper for v, p in zip(s.values, specs, strict=True) if p.lower == 0.0)
    return 0.0 if wrong else s.gain
