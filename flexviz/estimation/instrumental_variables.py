"""The two_band stage: removes what filtering and noise do to the plain fit.

Two bands. The residual r comes from a wide filter that is exactly flat where the robot moves, so that
products of filtered signals are right; it is full of noise, but that noise's covariance is known
(`whitening`). The Jacobian comes from a narrow filter, so that its noise is small: it serves as instrument Z.
Solved is Zᵀ W r = b with W the inverse covariance — generalised least squares without the errors-in-variables
bias of one band — and b what noise that Z and r share leaves on average (`instrument_bias`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.equation import Evaluation
from flexviz.estimation.covariance import covariance, score_covariance
from flexviz.estimation.least_squares import Bounds, bounded_step
from flexviz.estimation.noise_weighting import NoiseWeighting
from flexviz.estimation.prior import Prior
from flexviz.estimation.two_band import TwoBandData
from flexviz.estimation.whitening import Whitener

Array = NDArray[np.float64]

CONSISTENT = 2.0  # χ² per sample up to which the measurement noise alone explains the residual
TOLERANCE = 3e-4  # first guess of a model error, relative to the torque's rms
TRANSIENT = 5.0
NEGLIGIBLE = 0.02  # [standard deviations] a step that ends the iteration


@dataclass(frozen=True)
class Refined:
    """Result of the two_band.

    Attributes:
        x: shape (P,).
        covariance: shape (P, P).
        prior_share: shape (P,), share of the prior in each variance.
        chi_square: mean square of the whitened residual.
        chi_squares: shape (n,), the same for each joint.
        converged: the last step was negligible.
        at_bound: shape (P,).
    """

    x: Array
    covariance: Array
    prior_share: Array
    chi_square: float
    chi_squares: Array
    converged: bool
    at_bound: NDArray[np.bool_]


def refine(
    two_band: TwoBandData,
    prior: Prior,
    bounds: Bounds,
    x: Array,
    *,
    max_iterations: int = 12,
    report: Callable[[Array, float, float], None] = lambda x, cost, step: None,
) -> Refined:
    """Solve Zᵀ W r = b (plus the prior) from the plain fit's x.

    Where the residual is far above the measurement noise the model, not the noise, is what is wrong: a white
    model error is then added to the noise, as large as it takes to explain the residual, so that nothing is
    weighted by a noise that does not matter.
    """
    first = _solve(two_band, prior, bounds, x, max_iterations, report)
    if first.chi_square <= CONSISTENT:
        return first
    torque = two_band.narrow.evaluate(x).torque[0]
    two_band.tolerance = TOLERANCE**2 * np.mean(torque**2, axis=0)
    refined = first
    for _ in range(8):
        refined = _solve(two_band, prior, bounds, x, max_iterations, report)
        x = refined.x
        if np.all(refined.chi_squares < 1.5):
            break
        two_band.tolerance = two_band.tolerance * np.maximum(refined.chi_squares, 0.5)
    return refined


@dataclass(frozen=True)
class Point:
    """Whitened residual and instruments at one x.

    Attributes:
        r: shape (N, n); unusable samples are zero.
        z: shape (N, n, P), likewise.
        used: shape (N,).
        weightings, whiteners: one a block.
        narrow: the narrow band's equation.
        shared: shape (P,) a block, mean of zᵀ r a sample from the noise that both contain.
    """

    r: Array
    z: Array
    used: NDArray[np.bool_]
    weightings: list[NoiseWeighting]
    whiteners: list[Whitener]
    narrow: Evaluation
    shared: list[Array]


def whitened_point(
    two_band: TwoBandData,
    x: Array,
    whiteners: list[Whitener] | None = None,
) -> Point:
    """Residual and instruments at x; the noise's way is followed anew where no whiteners are given.

    Args:
        two_band: the data and the model.
        x: shape (P,).
        whiteners: of another point, near enough.
    """
    residual, narrow = evaluated(two_band, x)
    if whiteners is None:
        whiteners = two_band.whiteners(x, narrow.link)
    shared = two_band.instrument_bias(x, narrow.link, whiteners)
    return weighted_point(two_band, residual, narrow, two_band.weightings(x, narrow, whiteners), shared)


def evaluated(two_band: TwoBandData, x: Array) -> tuple[Array, Evaluation]:
    """The wide band's residual (N, n) and the narrow band's equation at x."""
    for equation in (two_band.wide, two_band.narrow):
        equation.prepare(x)
    return two_band.wide.residual(x), two_band.narrow.evaluate(x)


def weighted_point(
    two_band: TwoBandData,
    residual: Array,
    narrow: Evaluation,
    weightings: list[NoiseWeighting],
    shared: list[Array],
) -> Point:
    """What `evaluated` gives, in units of the noise."""
    blocks = two_band.blocks
    pairs = list(zip(weightings, blocks, strict=True))
    r = np.concatenate([m.apply(residual[b.rows]) for m, b in pairs])
    z = np.concatenate([m.apply(narrow.jacobian[b.rows]) for m, b in pairs])
    used = np.concatenate([settled(r[b.rows]) for b in blocks])
    r[~used] = 0.0
    z[~used] = 0.0
    return Point(r, z, used, weightings, [m.whitener for m in weightings], narrow, shared)


def compensated_score(two_band: TwoBandData, point: Point, window: NDArray[np.bool_] | None = None) -> Array:
    """Zᵀ W r − b, shape (P,): zero on average where the model is right.

    Args:
        two_band: the data and the model.
        point: there.
        window: shape (N,), the samples that count; all of them where None.
    """
    used = point.used if window is None else point.used & window
    r = point.r if window is None else point.r * window[:, None]
    score: Array = point.z.reshape(-1, point.z.shape[2]).T @ r.ravel()
    for block, mean in zip(two_band.blocks, shared_part(two_band, point, used), strict=True):
        score -= np.count_nonzero(used[block.rows]) * mean
    return score


def shared_part(two_band: TwoBandData, point: Point, used: NDArray[np.bool_]) -> list[Array]:
    """b a sample, shape (P,) a block.

    A joint whose residual is below its noise has less of it than was estimated (torque chatter, for one, is
    not noise): less is taken off then.

    Args:
        two_band: the data and the model.
        point: there.
        used: shape (N,), the samples that count.
    """
    layout = two_band.layout
    chi = np.sum(point.r[used] ** 2, axis=0) / max(np.count_nonzero(used), 1)
    share = np.zeros(layout.size)
    share[layout.compliance] = np.minimum(chi, 1.0)
    for effect, where in layout.effect_slices():
        if effect.joint is not None:
            share[where] = min(chi[effect.joint], 1.0)
    return [share * mean for mean in point.shared]


def settled(r: Array) -> NDArray[np.bool_]:
    """Samples of one stretch outside the transients at its ends, shape (N,).

    A record that starts with a jump leaves a longer transient than one that does not. The whitened residual
    shows it: windows of 1/80 of the stretch at either end are dropped up to the last one, within the first
    eighth, that is TRANSIENT times as large as usual.
    """
    window = max(3, len(r) // 80)
    count = len(r) // window
    energy = (r[: count * window] ** 2).reshape(count, -1).mean(axis=1)
    usual = np.median(energy)
    loud = energy > TRANSIENT * usual
    used = np.ones(len(r), bool)
    edge = count // 8
    first, last = np.flatnonzero(loud[:edge]), np.flatnonzero(loud[::-1][:edge])
    if first.size:
        used[: (first[-1] + 1) * window] = False
    if last.size:
        used[(count - last[-1] - 1) * window :] = False
    return used


def _solve(
    two_band: TwoBandData,
    prior: Prior,
    bounds: Bounds,
    x: Array,
    max_iterations: int,
    report: Callable[[Array, float, float], None],
) -> Refined:
    lay, blocks = two_band.layout, two_band.blocks
    whiteners: list[Whitener] | None = None
    iteration = 0
    while True:
        # the noise's way through the equation is followed anew once the parameters are nearly right
        point = whitened_point(two_band, x, whiteners if iteration >= 2 else None)
        whiteners = point.whiteners
        gradient, prior_hessian = prior.gradient_and_hessian(x)
        flat = point.z.reshape(-1, lay.size)
        information = flat.T @ flat
        hessian = information + prior_hessian
        step, at_bound = bounded_step(gradient + compensated_score(two_band, point), hessian, x, bounds)
        length = float(np.sqrt(max(step @ hessian @ step, 0.0)))
        report(x, 0.5 * float((point.r**2).sum()), length)
        converged = length < NEGLIGIBLE and iteration >= 2
        if converged or iteration == max_iterations:
            break
        x = feasible_step(prior, bounds, x, step)
        iteration += 1
    chi_squares: Array = np.sum(point.r**2, axis=0) / np.count_nonzero(point.used)
    chi_square = float(np.mean(chi_squares))
    free = ~at_bound
    colour = (
        two_band.noise_score_covariance(x, point.z, point.weightings) * max(chi_square, 1.0)
        if chi_square < 1.2
        else score_covariance(point.r, point.z, [b.rows for b in blocks])
    )
    cov, share = np.zeros_like(information), np.ones(lay.size)
    index = np.ix_(free, free)
    cov[index], share[free] = covariance(information[index], colour[index], prior_hessian[index])
    return Refined(x, cov, share, chi_square, chi_squares, converged, at_bound)


def feasible_step(prior: Prior, bounds: Bounds, x: Array, step: Array) -> Array:
    length = 1.0
    compliance = prior.layout.compliance
    for _ in range(30):
        trial = bounds.clip(x + length * step)
        trial[compliance] = np.clip(trial[compliance], 0.2 * x[compliance], 5 * x[compliance])
        if prior.feasible(trial):
            return trial
        length *= 0.5
    return x
