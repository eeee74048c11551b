"""The one criterion: by how much a model describes the data better than another, in nats, and how surely.

J = −log p(residuals of fitted and held-out groups | Σ_noise + m) − log prior + the cost of complexity, with
the variance m_j ≥ 0 of each joint's model error at its most likely value. Residuals are correlated: sums over
samples are divided by each joint's correlation time, so that a difference of J is a log likelihood ratio at
any band, length and sampling rate. Its standard error comes from the scatter between paired stretches of half
a second, as that of a difference of expected log predictive densities (Vehtari, Gelman, Gabry, Stat. Comput.
27, 2017).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.equation import Block

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

LIMITS = THRESHOLDS.criterion
LEAST_DOUBT = 0.01  # odds of an error of any kind
LAGS = 8  # part of the longest stretch over which a residual may be correlated


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of one part of the data, the fit groups or the validation groups.

    Attributes:
        values: shape (N, n).
        used: shape (N, n), samples that count.
        stretches: of half a second, over which the gain of a model scatters.
        blocks: contiguous samples.
    """

    values: Array
    used: Bools
    stretches: Sequence[slice]
    blocks: Sequence[slice]


@dataclass(frozen=True, eq=False)
class Likelihood:
    """How well a model describes the data.

    Attributes:
        losses: shape (S, n), −log likelihood of each stretch and joint, of independent samples [nats].
        held_out: shape (S,), stretches that were not fitted.
        times: shape (n,), samples per independent one.
        deviation: shape (n,), √(Σ_noise + m) of each joint, in units of the residuals.
        model_error: shape (n,), share m / (Σ_noise + m) of that.
        other: −log prior, and what unknown pulses cost [nats].
        freedom: number of parameters of the effects.
        samples: independent samples of all joints.
    """

    losses: Array
    held_out: Bools
    times: Array
    deviation: Array
    model_error: Array
    other: float
    freedom: int
    samples: float


def likelihood(
    parts: Sequence[Residuals],
    floor: Array,
    other: float,
    freedom: int,
    outlier: float = np.inf,
    times: Array | None = None,
    fixed: bool = False,
) -> Likelihood:
    """Likelihood of a model from its residuals: Σ ρ(|r|/σ) + log σ per joint, σ² = Σ_noise + m.

    The variance m ≥ 0 of a joint's model error takes its most likely value, so that σ is what the residual
    shows where it is above the noise. ρ is half the square, or Huber's loss.

    Args:
        parts: the fit groups, and the validation groups if there are any.
        floor: shape (n,), standard deviation due to the noise alone.
        other: −log prior and other costs [nats].
        freedom: number of parameters of the effects.
        outlier: standard deviations from which a residual counts linearly (Huber).
        times: shape (n,), correlation times if they are known.
        fixed: the standard deviation is the floor, whatever the residuals are.
    """
    count = np.maximum(sum(part.used.sum(axis=0) for part in parts), 1)
    sigma = floor if fixed else np.maximum(robust_deviation(parts, count, outlier), floor)
    losses, held_out = [], []
    for k, part in enumerate(parts):
        each = huber(np.abs(part.values) / sigma, outlier) + (0.0 if fixed else np.log(sigma))
        each *= part.used
        sums = np.add.reduceat(each, [s.start for s in part.stretches], axis=0)
        losses.append(sums)
        held_out += [k > 0] * len(part.stretches)
    times = correlation_times(parts) if times is None else times
    samples = float(np.sum(count / times))
    error = 1 - (floor / sigma) ** 2 if not fixed else np.zeros_like(sigma)
    return Likelihood(
        np.concatenate(losses), np.array(held_out), times, sigma, error, other, freedom, samples
    )


def huber(ratio: Array, outlier: float) -> Array:
    """Huber's loss of residuals |r|/σ, of any shape: half the square, linear from `outlier` on [nats]."""
    return np.where(ratio < outlier, 0.5 * ratio**2, outlier * (ratio - 0.5 * min(outlier, 1e150)))


def robust_deviation(parts: Sequence[Residuals], count: Array, outlier: float) -> Array:
    """Standard deviation of the residuals with outliers clipped, shape (n,)."""
    limit = np.full(len(count), np.inf)
    sigma = limit
    for _ in range(1 if np.isinf(outlier) else 4):
        total = sum(np.sum(np.minimum(np.abs(p.values), limit) ** 2 * p.used, axis=0) for p in parts)
        sigma = np.sqrt(total / count) + 1e-300
        limit = outlier * sigma
    return sigma


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
        error: its standard error [nats].
        by_joint: shape (n,), the part of each joint.
        errors: shape (n,), of each.
        harmed: whether the held-out groups are clearly described less well.
    """

    delta: float
    error: float
    by_joint: Array
    errors: Array
    harmed: bool = False

    @property
    def accepted(self) -> bool:
        """Whether the move is right: it gains clearly more than it costs, also in held-out groups."""
        return self.delta > LIMITS.deviations * self.error and not self.harmed

    @property
    def reversed(self) -> Gain:
        """Of the opposite move."""
        return Gain(-self.delta, self.error, -self.by_joint, self.errors)

    @property
    def clear(self) -> bool:
        """Whether the models differ by more than the error of their difference, for better or worse."""
        return abs(self.delta) > max(LIMITS.deviations * self.error, LIMITS.temperature)

    @property
    def why(self) -> str:
        """Why it is refused, in words; empty if it is accepted."""
        if self.delta <= 0:
            return "it costs more than it gains"
        if self.delta <= LIMITS.deviations * self.error:
            return "what it gains may be chance"
        return "held-out groups are described less well" if self.harmed else ""


def gain(before: Likelihood, after: Likelihood, tried: int = 0, trace: float = 0.0) -> Gain:
    """What a move from one model to another gains: Δ = J(before) − J(after) − cost.

    The cost is log(candidates / α) for the best of many, which gains by chance, and ½ log(samples) for each
    further parameter, as in the BIC. Where the better model leaves noise alone, Δ has the variance 2 Δ of a
    log likelihood ratio. Where it leaves a model error, the scatter between stretches tells how surely Δ
    would be gained again. Between these, each counts by its share of the residual's variance.

    Args:
        before, after: likelihoods of the models, over the same stretches.
        tried: candidates among which the move was chosen; the best of many gains something by chance. None
            are tried where a part of the model is exchanged for a rival.
        trace: what approximate laws leave, which a further effect has to exceed [nats].
    """
    better = after if after.losses.sum() < before.losses.sum() else before
    falls = (before.losses - after.losses) / better.times
    by_joint = falls.sum(axis=0)
    more, each = after.freedom - before.freedom, falls.sum(axis=1)
    size = 0.5 * more * float(np.log(max(better.samples, 2.0)))
    cost = after.other - before.other + size + float(np.sign(more)) * (chance(tried) + trace)
    delta = float(each.sum()) - cost
    # what a move gains beyond its cost
    net = np.abs(by_joint) * min(1.0, abs(delta) / max(float(np.abs(by_joint).sum()), 1e-300))
    noise, uncertain = 2 * (1 - better.model_error) * net, falls * np.sqrt(better.model_error)
    scatter = np.where(better.model_error > 0, np.inf, 0.0)
    together = float(scatter.max())
    if len(falls) > 2:
        scatter = len(falls) * uncertain.var(axis=0, ddof=1)
        together = len(falls) * float(uncertain.sum(axis=1).var(ddof=1))
    errors, error = np.sqrt(noise + scatter), float(np.sqrt(noise.sum() + together))
    held, harmed = each[before.held_out], False
    if len(held) > 2:
        scatter = float(np.sqrt(len(held)) * held.std(ddof=1))
        harmed = bool(held.sum() < -chance(1) - LIMITS.deviations * scatter)
    return Gain(delta, error, by_joint, errors, harmed)


def chance(tried: int) -> float:
    """What the best of so many candidates has to gain, so that noise alone hardly ever does [nats]."""
    return float(np.log(max(tried, 1) / LIMITS.false_alarm)) if tried else 0.0


def half_seconds(blocks: Sequence[Block]) -> list[slice]:
    """Stretches of about half a second."""
    out = []
    for block in blocks:
        count = block.rows.stop - block.rows.start
        length = max(2, round(LIMITS.stretch / (block.segment.step * block.stride)))
        ends = np.linspace(0, count, max(1, count // length) + 1).astype(int) + block.rows.start
        out += [slice(int(a), int(b)) for a, b in pairwise(ends) if b > a]
    return out


def confidence(found: Gain, left: float) -> float:
    """Probability that an effect is the right one, or tied with it, against "none of these".

    The odds of "none of these" fall with what the effect gains beyond its cost; what no effect of the library
    describes on its joint, `left` [nats], may stand in for it, the more likely the more it is.
    """
    sure = (found.delta - LIMITS.deviations * found.error) / LIMITS.temperature
    none = float(np.exp(-np.clip(sure, -30.0, 30.0)))
    return 1 / (1 + none + max(LEAST_DOUBT, LIMITS.doubt * left / max(found.delta, 1e-9)))
