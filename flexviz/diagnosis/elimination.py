"""Backward elimination in closed form: which effects of a fitted model do the data need?

A fit gives its parameters as a normal distribution N(x, C). Leaving an effect out means conditioning on its
size being zero, which moves all other parameters linearly and changes the residual by the Jacobian times that
move. One covariance and one Jacobian therefore judge every smaller model.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.acceptance import credible
from flexviz.diagnosis.motion_fit import MotionFit
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.unknown_curve import is_curve
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.estimation import sandwich

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.motion
# share of a variance, beside effects dropped since it was computed, below which rounding takes part in it:
# the models of robots with all usual effects have scaled eigenvalues of 1e-10
CANCELLED = 1e-4


@dataclass(frozen=True)
class Necessity:
    """How much a model needs one of its effects.

    Attributes:
        deviations: size of the effect in standard errors.
        held_out_rise: rise of the judged mean square of the effect's joint without it, relative to that with
            it; of all joints for effects at the link or without a joint.
        rise_error: standard error of the rise, from its scatter between short stretches; infinite for less
            than three of them.
        share: root of the absolute rise, relative to the spread of the joint's torque; limited where the
            residual is small, because large residuals count less.
        torque: rms change of the judged residual without the effect, relative to the same; not limited.
        credible: its parameters could be real.
        quiet: the full model errs little on its joint, so that even small effects stand out.
        at_noise: the full model reaches the noise of its joint, or for effects without one, of most joints.
    """

    deviations: float
    held_out_rise: float
    rise_error: float
    share: float
    torque: float
    credible: bool
    quiet: bool
    at_noise: bool

    @property
    def needed(self) -> bool:
        """Whether the effect stays in the model."""
        harmless = self.held_out_rise < LIMITS.rise_deviations * self.rise_error
        return (
            self.credible
            and self.deviations > (LIMITS.plain if harmless or self.quiet else LIMITS.significant)
            and self.held_out_rise > 0
            and (max(self.share, self.torque) > LIMITS.least_torque_share or self.completes)
        )

    @property
    def implausible(self) -> bool:
        """Whether the data show the effect, but with parameters that cannot be real."""
        return not self.credible and self.deviations > LIMITS.significant

    @property
    def completes(self) -> bool:
        """Whether only the effect, however small, brings its joint, or most joints, down to the noise."""
        return self.at_noise and self.held_out_rise - self.rise_error > LIMITS.completing_rise


@dataclass(frozen=True)
class Elimination:
    """Result of an elimination: the effects that stay, and the start of a fit without the others.

    Attributes:
        kept: effects that stay, with their necessity beside each other.
        dropped: effects left out, in this order, each with its necessity when it was dropped.
        x: shape (P,), parameters of the full layout with the dropped effects at zero.
    """

    kept: dict[ChosenEffect, Necessity]
    dropped: dict[ChosenEffect, Necessity]
    x: Array


def eliminate(fit: MotionFit, firm: frozenset[ChosenEffect] = frozenset()) -> Elimination:
    """Drop, one by one, the effects that a model does not need.

    Those with implausible parameters go first, then the least significant.

    Args:
        fit: the model.
        firm: effects that are not dropped, such as those of the set's own model.
    """
    covariance = fit.covariance.matrix
    variance = np.diag(covariance)
    x, moved, data = fit.x, np.zeros(len(fit.x)), _Judged.of(fit)
    judged = data.residual
    left = dict(fit.layout.effect_slices())
    dropped: dict[ChosenEffect, Necessity] = {}
    while True:
        curves_held = _with_curves_held(fit, covariance)
        found = {
            effect: _necessity(data, effect, where, x, covariance, curves_held)
            for effect, where in left.items()
        }
        weak = [e for e, n in found.items() if not n.needed and e not in firm]
        if not weak:
            return Elimination(found, dropped, x)
        worst = min(weak, key=lambda e: (found[e].credible, found[e].deviations))
        move, covariance = _without(x, covariance, sizes(worst, left.pop(worst)), data.walls)
        moved += move
        dropped[worst] = found[worst]
        rows = [row for where in left.values() for row in range(where.start, where.stop)]
        if np.any(np.diag(covariance)[rows] < CANCELLED * variance[rows]):
            moved, covariance = _afresh(fit, dropped, data.walls)
            variance = np.diag(covariance)
        data = replace(data, residual=judged + data.jacobian @ moved)
        x = fit.x + moved
        for effect in dropped:
            x[fit.layout.effect_slice(effect)] = 0.0


def necessities(fit: MotionFit) -> dict[ChosenEffect, Necessity]:
    """How much a model needs each of its effects."""
    return eliminate(fit, frozenset(fit.layout.effects)).kept


def by_weight(fit: MotionFit, effects: Sequence[ChosenEffect]) -> list[tuple[ChosenEffect, Array]]:
    """The effects, the weightiest first, each with the parameters (P,) of the model without it and the next.

    Each is the one that lowers the judged mean square most, relative to each joint's torque and summed over
    the joints, beside those before it.
    """
    # of independent errors: with it the conditional parameters are those of a fit without the effects
    covariance = sandwich(fit.information, fit.information, fit.prior_derivatives[1], fit.held).matrix
    walls = Walls.of(fit)
    judged, jacobian = fit.judged
    left = {effect: where for effect, where in fit.layout.effect_slices() if effect in effects}

    def without(absent: Mapping[ChosenEffect, slice]) -> Array:
        rows = [row for e, where in absent.items() for row in sizes(e, where)]
        x = fit.x + _without(fit.x, covariance, rows, walls)[0]
        for where in absent.values():
            x[where] = 0.0
        return x

    def misfit(x: Array) -> float:
        squares = np.mean((judged + jacobian @ (x - fit.x)) ** 2, axis=0)
        return float(np.sum(squares / fit.context.spread**2))

    order: list[tuple[ChosenEffect, Array]] = []
    while left:
        before = without(left)
        trials = {e: misfit(without({k: v for k, v in left.items() if k != e})) for e in left}
        best = min(trials, key=lambda e: trials[e])
        del left[best]
        order.append((best, before))
    return order


def sizes(effect: ChosenEffect, where: slice) -> list[int]:
    """Parameters whose zero means that the effect is absent."""
    return [where.start + k for k in EFFECTS[effect.effect].size_at]


@dataclass(frozen=True, eq=False)
class Walls:
    """Bounds of the robot's own parameters that lie at one, where an effect may have driven them.

    Attributes:
        rows: shape (K,), indices of the parameters.
        lower, upper: shape (K,).
    """

    rows: NDArray[np.intp]
    lower: Array
    upper: Array

    @staticmethod
    def of(fit: MotionFit) -> Walls:
        """Those of a fit."""
        rows = np.flatnonzero(fit.at_bound & ~fit.held)
        bounds = fit.context.start(fit.layout).bounds
        return Walls(rows, bounds.lower[rows], bounds.upper[rows])

    def beyond(self, x: Array) -> list[int]:
        """Parameters of x, shape (P,), outside their bounds."""
        return self.rows[(x[self.rows] < self.lower) | (x[self.rows] > self.upper)].tolist()


def _without(x: Array, covariance: Array, rows: list[int], walls: Walls) -> tuple[Array, Array]:
    """Move (P,) of the parameters when those at `rows` become zero, and the covariance given that.

    Parameters held at a bound, without variance, say nothing about the others; those at `walls` stay where
    they would leave their bounds.
    """
    free = [row for row in rows if covariance[row, row] > 0]
    gain = np.linalg.solve(covariance[np.ix_(free, free)], covariance[free]).T
    move, stay = -gain @ x[free], list[int]()
    while out := [row for row in walls.beyond(x + move) if row not in stay]:
        stay += out
        fixed = free + stay
        moves = np.linalg.solve(covariance[np.ix_(fixed, fixed)], covariance[fixed])[: len(free)]
        move = -x[free] @ moves
        move[stay] = 0.0
    move[rows] = -x[rows]
    return move, covariance - gain @ covariance[free]


def _afresh(fit: MotionFit, dropped: Collection[ChosenEffect], walls: Walls) -> tuple[Array, Array]:
    """Move (P,) of the parameters without dropped effects, and covariance (P, P), from the data themselves.

    Beside an effect that is nearly the same, another has a variance so large that what the data say of it
    alone is lost in its rounding.
    """
    hessian = fit.information + fit.prior_derivatives[1]
    absent, held = np.zeros(len(fit.x)), fit.held.copy()
    for effect in dropped:
        where = fit.layout.effect_slice(effect)
        held[where] = True
        absent[sizes(effect, where)] = -fit.x[sizes(effect, where)]
    free = ~held
    while True:
        move = absent.copy()
        move[free] = -np.linalg.solve(hessian[np.ix_(free, free)], hessian[free] @ absent)
        if not (out := walls.beyond(fit.x + move)):
            return move, fit.covariance_with(held).matrix
        free[out] = False


def _with_curves_held(fit: MotionFit, covariance: Array) -> Array:
    """The covariance (P, P) with free curves held: without an effect they would stand in for it."""
    curves = [where for effect, where in fit.layout.effect_slices() if is_curve(effect)]
    held = [row for where in curves for row in range(where.start, where.stop) if covariance[row, row] > 0]
    if not held:
        return covariance
    gain = np.linalg.solve(covariance[np.ix_(held, held)], covariance[held])
    return covariance - covariance[:, held] @ gain


@dataclass(frozen=True, eq=False)
class _Judged:
    """A fit, and the samples by which its effects are judged.

    Attributes:
        residual, jacobian: shape (N, n), (N, n, P).
        stretches: of the samples.
    """

    fit: MotionFit
    walls: Walls
    residual: Array
    jacobian: Array
    stretches: list[slice]

    @staticmethod
    def of(fit: MotionFit) -> _Judged:
        return _Judged(fit, Walls.of(fit), *fit.judged, _stretches(fit))


def _necessity(
    data: _Judged, effect: ChosenEffect, where: slice, x: Array, covariance: Array, curves_held: Array
) -> Necessity:
    fit = data.fit
    rows = sizes(effect, where)
    values, inside = x[rows], covariance[np.ix_(rows, rows)]
    if np.any(np.diag(inside) <= 0) or not np.any(values):
        return Necessity(0.0, 0.0, 0.0, 0.0, 0.0, False, False, False)
    deviations = float(np.sqrt(max(values @ np.linalg.solve(inside, values), 0.0)))
    move, _ = _without(x, covariance if is_curve(effect) else curves_held, rows, data.walls)
    # inertias of links stand in for a missing spring or counterweight, at the expense of the other joints
    joint = effect.joint
    joints = slice(None)
    if joint is not None and EFFECTS[effect.effect].where != "link":
        joints = slice(joint, joint + 1)
    change = data.jacobian[:, joints] @ move
    sigma = fit.sigma[joints]
    here = data.residual[:, joints]
    old, new = here / sigma, (here + change) / sigma
    limit = LIMITS.outlier * max(1.0, float(np.sqrt(np.mean(old**2))))
    squares = np.minimum(new**2, 9 * limit**2) - np.minimum(old**2, limit**2)
    rise = squares.sum(axis=1)
    level = float(np.minimum(old**2, limit**2).sum(axis=1).mean()) + 1e-300
    each = np.array([rise[part].mean() for part in data.stretches]) / level
    error = float(each.std(ddof=1) / np.sqrt(len(each))) if len(each) > 2 else np.inf
    mean = float(each.mean())
    shares = squares.mean(axis=0) * (sigma / fit.context.spread[joints]) ** 2
    # an effect without a joint acts on all of them, not only on one that lacks something else
    share = float(np.sqrt(max(np.median(shares) if effect.joint is None else shares.sum(), 0.0)))
    moved = np.mean(change**2, axis=0) / fit.context.spread[joints] ** 2
    torque = float(np.sqrt(np.median(moved) if effect.joint is None else moved.sum()))
    ratio = fit.rms / fit.context.noise_floor
    at_noise = bool(np.median(ratio) < LIMITS.small_left if joint is None else ratio[joint] < LIMITS.quiet)
    near = ratio < LIMITS.far_off
    for curve in filter(is_curve, fit.layout.effects):
        near[curve.place.own_joint] = False  # the curve takes what the effect shows
    quiet = bool(near.all() if effect.joint is None else near[effect.joint])
    believed = credible(fit, effect, raw_step(fit), x[where])
    if joint is not None and ratio[joint] > LIMITS.small_left:
        believed &= expected(effect, x[where])
    return Necessity(deviations, mean, error, share, torque, believed, quiet, at_noise)


def expected(effect: ChosenEffect, values: Array) -> bool:
    """Whether parameters are such as a real robot may show."""
    law = EFFECTS[effect.effect]
    spread = np.array([law.expected.get(spec.name, np.inf) for spec in law.parameters])
    return bool(np.all(np.abs(values) < LIMITS.unexpected * spread))


def raw_step(fit: MotionFit) -> float:
    """Longest sampling interval of the recordings [s]."""
    return max(b.segment.step for b in fit.context.signals.blocks)


def _stretches(fit: MotionFit) -> list[slice]:
    """Stretches of the judged samples of about `LIMITS.stretch` seconds."""
    signals = fit.context.judged_signals
    out = []
    for block in signals.blocks:
        count = block.rows.stop - block.rows.start
        length = max(2, round(LIMITS.stretch / (block.segment.step * block.stride)))
        ends = np.linspace(0, count, max(1, count // length) + 1).astype(int) + block.rows.start
        out += [slice(int(a), int(b)) for a, b in pairwise(ends)]
    return out
