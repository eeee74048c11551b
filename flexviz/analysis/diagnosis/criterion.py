"""The one criterion: J, a number of a model, in nats.

    J = Σ_j n_j log max(σ_j, ε_j) + ½ log N · parameters + log(K/α) · effects

σ_j is what the model leaves of joint j's recorded torque, in fitted and held-out groups. n_j, the independent
samples of joint j, and N, their sum, belong to the recording: they are the same for every model, so that
J(A) − J(C) = J(A) − J(B) + J(B) − J(C) along any path of moves, and changes sign with its direction. ε_j is
the larger of the sensors' noise and of a tolerance: below it nothing counts. The best of K effects gains
log K by chance alone; α is the probability that anything is found where nothing is missing. ½ log N is the
price of a parameter (Schwarz, Annals of Statistics 6, 1978). Torque of variance u that a model does not know
costs ½ log(1 + u/σ²) a sample.

n_j comes from the correlation of what a model leaves. Where large slow errors have been explained, more of
the rest is evidence: a search goes on from its end with the J of that model (`Coarse.renewed`).

Which joint leaves how much is decided by its own residual: for residuals of unknown variance the likelihood
is that of σ_j alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.motion import Residuals, deviations

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

LIMITS = THRESHOLDS.criterion
LAGS = 8  # part of the longest stretch over which a residual may be correlated


@dataclass(frozen=True, eq=False)
class Score:
    """What the criterion says of a model.

    Attributes:
        deviation: shape (n,), σ_j of all samples, in units of the residuals.
        held_out: shape (n,), that of the held-out groups alone (of the fit groups without any).
        by_joint: shape (n,), n_j log max(σ_j, ε_j) [nats].
        held_out_by_joint: shape (n,), the same of the held-out groups [nats].
        cost: of parameters and effects, and what else the model pays [nats].
    """

    deviation: Array
    held_out: Array
    by_joint: Array
    held_out_by_joint: Array
    cost: float

    @property
    def total(self) -> float:
        """J [nats]."""
        return float(self.by_joint.sum()) + self.cost


@dataclass(frozen=True, eq=False)
class Criterion:
    """J of every model of one recording.

    Attributes:
        samples: shape (n,), n_j: independent samples of each joint.
        least: shape (n,), ε_j, in units of the residuals.
        choices: K, number of effects that may be added to the set's own model.
        outlier: deviations from which a residual counts linearly (Huber).
    """

    samples: Array
    least: Array
    choices: int
    outlier: float = np.inf

    @property
    def of_parameter(self) -> float:
        """What a parameter costs [nats]."""
        return 0.5 * float(np.log(max(self.samples.sum(), 2.0)))

    @property
    def of_effect(self) -> float:
        """What an effect costs besides its parameters [nats]."""
        return float(np.log(max(self.choices, 1) / LIMITS.false_alarm))

    def settled(self, count: float) -> float:
        """Change of an objective, twice a sum over so many samples, by which J hardly changes.

        Few of these samples are independent.
        """
        return 2 * LIMITS.settled * count / float(self.samples.sum())

    def cost(self, parameters: int, effects: int, places: int = 1) -> float:
        """Of effects with so many parameters together; `places`: where or when each may act [nats]."""
        return parameters * self.of_parameter + effects * self.of_effect + float(np.log(places))

    def score(
        self,
        parts: Sequence[Residuals],
        cost: float,
        scale: Array | float = 1.0,
        cut: tuple[Array, Array] | None = None,
    ) -> Score:
        """The score of a model from its residuals.

        Args:
            parts: residuals of the fit groups, and of the validation groups if there are any.
            cost: of parameters and effects [nats].
            scale: shape (n,), by which the model scales the recorded torque.
            cut: shares of the samples, (n,), whose recorded torque a model says not to have acted, and the
                deviation with which those count: all of the torque's.
        """
        all_of_it, held = (deviations(some, self.outlier) / scale for some in (parts, parts[-1:]))
        if cut is not None:
            share, spread = cut
            all_of_it, held = (d ** (1 - share) * spread**share for d in (all_of_it, held))
        nats, held_nats = (self.nats(sigma) for sigma in (all_of_it, held))
        nats += self.samples * self.unknown_price(parts, all_of_it * scale)
        held_nats += self.samples * self.unknown_price(parts[-1:], held * scale)
        return Score(all_of_it, held, nats, held_nats, cost)

    def unknown_price(self, parts: Sequence[Residuals], sigma: Array) -> Array:
        """Mean of ½ log(1 + u/σ²) over samples of which a model does not know u, (n,) [nats].

        A torque that may have any size explains everything.
        """
        if all(part.unknown is None for part in parts):
            return np.zeros(len(sigma))
        own = np.maximum(sigma, self.least) ** 2
        total = sum(np.sum(part.used * np.log1p(part.variance_unknown / own), axis=0) for part in parts)
        return 0.5 * total / np.maximum(sum(part.used.sum(axis=0) for part in parts), 1)

    def nats(self, deviation: Array) -> Array:
        """n_j log max(σ_j, ε_j), shape (n,)."""
        return self.samples * np.log(np.maximum(deviation, self.least))


def criterion_of(
    parts: Sequence[Residuals], least: Array, choices: int, outlier: float = np.inf
) -> Criterion:
    """The criterion of a recording, from the residuals of the model from which a search begins."""
    count = np.maximum(sum(part.used.sum(axis=0) for part in parts), 1)
    return Criterion(count / correlation_times(parts), least, choices, outlier)


def correlation_times(parts: Sequence[Residuals]) -> Array:
    """Samples per independent one of each joint's residual, 1 + 2 Σ ρ_k², shape (n,) (Bartlett)."""
    n, longest = parts[0].values.shape[1], max(r.stop - r.start for p in parts for r in p.blocks)
    lags = max(1, longest // LAGS)
    total = np.zeros((lags + 1, n))
    for part in parts:
        kept = part.values * part.used
        for rows in part.blocks:
            spectrum = np.fft.rfft(kept[rows], rows.stop - rows.start + lags, axis=0)
            power = spectrum.real**2 + spectrum.imag**2
            found = np.fft.irfft(power, rows.stop - rows.start + lags, axis=0)[: lags + 1]
            total[: len(found)] += found
    rho = total[1:] / np.maximum(total[0], 1e-300)
    return 1 + 2 * np.sum(rho**2, axis=0)


@dataclass(frozen=True, eq=False)
class Gain:
    """What a move gains.

    Attributes:
        delta: decrease of J [nats].
        by_joint: shape (n,), the part of each joint [nats].
        held_out: decrease of the held-out part of J, without costs [nats].
    """

    delta: float
    by_joint: Array
    held_out: float

    @property
    def accepted(self) -> bool:
        """Whether J falls, and held-out groups are not described less well than chance allows."""
        return self.delta > LIMITS.settled and self.held_out > float(np.log(LIMITS.false_alarm))

    @property
    def why(self) -> str:
        """Why it is refused, in words; empty if it is accepted."""
        if self.accepted:
            return ""
        return (
            "it costs more than it gains"
            if self.delta <= LIMITS.settled
            else "held-out groups are described less well"
        )


def gain(before: Score, after: Score) -> Gain:
    """What a move from one model to another gains: Δ = J(before) − J(after)."""
    by_joint = before.by_joint - after.by_joint
    held = float((before.held_out_by_joint - after.held_out_by_joint).sum())
    return Gain(before.total - after.total, by_joint, held)


def confidence(gained: float, left: float) -> float:
    """Probability that an effect is the right one, or tied with it, against "none of these".

    The odds of "none of these" fall with what the effect gains beyond its cost [nats], and grow with what no
    effect of the library describes there: `left`, its mean square relative to what the effect removes.
    """
    none = float(np.exp(-np.clip(gained / LIMITS.temperature, -30.0, 30.0)))
    return 1 / (1 + none + LIMITS.least_doubt + LIMITS.doubt * left)


def unexplained(need: Gain, samples: Array, joint: int | None) -> float:
    """Mean square of what is left on a joint relative to what an effect removes there, by what it gains.

    `samples`: shape (n,), independent ones of each joint; without a joint, of that where it gains most.
    """
    nats = need.by_joint / np.maximum(samples, 1.0)
    j = int(np.argmax(nats)) if joint is None else joint
    return float(1 / max(np.expm1(2 * nats[j]), 1e-9))


def split(sure: float, rivals: Sequence[float]) -> float:
    """The part of a family's confidence that belongs to the member found, by what its rivals gain [nats]."""
    return sure / (1 + float(np.sum(np.exp(np.clip(rivals, -30.0, 0.0)))))
