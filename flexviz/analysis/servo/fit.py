"""Fits of joints that follow goals: the free motion from the goals against the measured one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from flexviz.analysis.motion import MOTION
from flexviz.base.arrays import Array, Bools, Indices
from flexviz.model.servo import LOG, SHARED, SIZE, TURN, DrivenMotion, free_motion

AT_ONCE = 160  # joints' models that are simulated together
SHIFT = 0.01  # of a logarithm, or of a usual size: by which a derivative is taken
FINE = 0.05  # [rad] of a servo's own vibration in a step, where values are stated
FEW, ENOUGH = 24, 45  # stretches of a selection
DAMPING = 1e-2, 0.2, 8.0  # at first; after a step that helps, and after one that does not
FARTHEST = 1.5  # [-] a step of a logarithm
SETTLED, PATIENCE = 1.0, 2  # [nats] so many steps that gain less each end a fit


@dataclass(frozen=True, eq=False)
class ServoFit:
    """A model of all joints, fitted.

    Attributes:
        free: (P, n) parameters that are fitted.
        values: (P, n).
        error: (T, n, C) simulated less measured angle [rad], of all groups.
    """

    free: Bools
    values: Array
    error: Array


@dataclass(frozen=True, eq=False)
class ServoData:
    """What a fit is of.

    Attributes:
        motion: measured.
        fitted: (C,) stretches of the fit groups.
        owner: (n,) index of the first joint that has the same servo.
        center, spread: (P, n) of the prior, of what is fitted.
        unit: (P, n) usual sizes.
    """

    motion: DrivenMotion
    fitted: Bools
    owner: Indices
    center: Array
    spread: Array
    unit: Array

    def alike(self, inner: Array, free: Bools) -> Array:
        """What is fitted, (P, n), with one value for all joints of a servo where they share it."""
        out = inner.copy()
        for owner in np.unique(self.owner):
            same = self.owner == owner
            rows = SHARED & free[:, same].any(axis=1)
            out[np.ix_(rows, same)] = inner[np.ix_(rows, same)].mean(axis=1, keepdims=True)
        return out

    @cached_property
    def own(self) -> DrivenMotion:
        """Of the fit groups."""
        return self.motion.part(self.fitted)

    @cached_property
    def thin(self) -> DrivenMotion:
        """A few of them, by which models are told apart that differ much."""
        return self.selected(FEW)

    @cached_property
    def some(self) -> DrivenMotion:
        """Some of them, by which models are compared; what they leave is asked of all."""
        return self.selected(ENOUGH)

    def selected(self, count: int) -> DrivenMotion:
        """About so many of them, evenly."""
        every = max(1, int(self.fitted.sum()) // count)
        return self.motion.part(self.fitted & (np.cumsum(self.fitted) % every == 0))

    def place(self, free: Bools) -> Indices:
        """(P, n) number of the unknown that each parameter is; −1: it is given."""
        own = np.arange(free.shape[0] * free.shape[1]).reshape(free.shape)
        tied = np.where(SHARED[:, None], own[:, self.owner], own)
        out = np.full(free.shape, -1)
        out[free] = np.unique(tied[free], return_inverse=True)[1]
        return out


def to_inner(values: Array) -> Array:
    """What is fitted: logarithms where parameters have them; leading axis P."""
    log = LOG.reshape(-1, *[1] * (values.ndim - 1))
    return np.where(log, np.log(np.where(log, values, 1.0)), values)


def to_values(inner: Array) -> Array:
    log = LOG.reshape(-1, *[1] * (inner.ndim - 1))
    return np.where(log, np.exp(np.where(log, inner, 0.0)), inner)


def fit_servos(
    data: ServoData, models: Sequence[tuple[Bools, Array]], iterations: int, weight: Array,
    motion: DrivenMotion | None = None, turn: float = TURN, check: Callable[[], None] = lambda: None,
) -> list[ServoFit]:  # fmt: skip
    """Models (free, values) fitted: Gauss–Newton steps with damping for each joint, or joints of one servo.

    Until nothing changes, at most so many `iterations`. `weight`: (n,) independent samples of each joint;
    `motion`: stretches by which they are fitted, None: those of all fit groups.
    """
    motion = motion or data.own
    todo = [_Descent(data, motion, free, values, weight) for free, values in models]
    for k in range(iterations + 1):
        batch: list[_Descent] = []
        going = [one for one in todo if not one.settled]
        for one in going:
            if sum(len(b.variants) for b in batch) + len(one.variants) > AT_ONCE and batch:
                _evaluate(motion, batch, turn)
                batch = []
            batch.append(one)
            check()
        if not going:
            break
        _evaluate(motion, batch, turn)
        for one in going:
            one.judge()
            if k < iterations:
                one.step()
    values = np.stack([to_values(one.reached.z) for one in todo], axis=1)
    errors = free_motion(data.motion, values, turn) - data.motion.theta
    return [ServoFit(one.free, values[:, k], errors[k]) for k, one in enumerate(todo)]


def _evaluate(motion: DrivenMotion, batch: Sequence[_Descent], turn: float) -> None:
    values = np.concatenate([one.points() for one in batch], axis=1)
    theta, at = free_motion(motion, values, turn), 0
    for one in batch:
        count = len(one.variants) + 1
        one.take(theta[at : at + count])
        at += count


class _Point(NamedTuple):
    """Unknowns z (P, n), and of each joint the variance, Hessian (P, P) and gradient (P,) of its error."""

    z: Array
    variance: Array
    hessian: Array
    gradient: Array


class _Descent:
    def __init__(
        self, data: ServoData, motion: DrivenMotion, free: Bools, values: Array, weight: Array
    ) -> None:
        self.data, self.motion, self.free, self.weight = data, motion, free, weight
        self.z = data.alike(to_inner(values), free)
        self.place = data.place(free)
        self.n = free.shape[1]
        self.variants = np.flatnonzero(free.any(axis=1))
        self.damping = np.full(self.n, DAMPING[0])
        self.best: _Point | None = None
        self.quiet = np.zeros(self.n, int)
        self.shift = np.where(LOG[:, None], SHIFT, SHIFT * data.unit)
        self.used = used = motion.used
        self.count = np.maximum(used.sum(axis=(0, 2)), 1)

    @property
    def reached(self) -> _Point:
        """The best point so far; there is one as soon as one was judged."""
        assert self.best is not None
        return self.best

    @property
    def settled(self) -> bool:
        """Whether the last steps have changed next to nothing, of any joint that is fitted."""
        return bool(np.all((self.quiet >= PATIENCE) | ~self.free.any(axis=0)))

    def points(self) -> Array:
        z = np.repeat(self.z[:, None], len(self.variants) + 1, axis=1)
        for k, p in enumerate(self.variants):
            z[p, k + 1] += self.shift[p] * self.free[p]
        return to_values(z)

    def take(self, theta: Array) -> None:
        away = theta[0] - self.motion.theta
        own = np.moveaxis(away * self.used, 1, 0).reshape(self.n, -1)
        slopes = np.empty((self.n, len(self.variants), own.shape[1]))
        for k, p in enumerate(self.variants):
            slope = (theta[k + 1] - theta[0]) * (self.used / self.shift[p][:, None])
            slopes[:, k] = np.moveaxis(slope, 1, 0).reshape(self.n, -1)
        count = len(self.free)
        hessian, gradient = np.zeros((self.n, count, count)), np.zeros((self.n, count))
        hessian[:, self.variants[:, None], self.variants] = slopes @ slopes.transpose(0, 2, 1)
        gradient[:, self.variants] = np.einsum("jpk,jk->jp", slopes, own)
        self.new = np.square(own).sum(axis=1) / self.count, hessian, gradient

    def cost(self, variance: Array, z: Array) -> Array:
        """(n,) of each joint [nats]: a joint's own data, and its prior."""
        away = np.where(self.free, (np.where(self.free, z, 0.0) - self.data.center) / self.data.spread, 0.0)
        return self.weight * 0.5 * np.log(variance) + 0.5 * np.square(away).sum(axis=0)

    def judge(self) -> None:
        """Keep the new point of the joints that it helps."""
        variance, hessian, gradient = self.new
        if self.best is None:
            self.best = _Point(self.z.copy(), variance, hessian, gradient)
            return
        z, old_variance, old_hessian, old_gradient = self.best
        fall = self.cost(old_variance, z) - self.cost(variance, self.z)
        together = np.array([fall[self.data.owner == o].sum() for o in self.data.owner])
        better = together > 0
        self.damping *= np.where(better, DAMPING[1], DAMPING[2])
        self.quiet = np.where(together > SETTLED, 0, self.quiet + 1)

        def pick(new: Array, old: Array, axis: int) -> Array:
            shape = [-1 if k == axis else 1 for k in range(new.ndim)]
            return np.where(better.reshape(shape), new, old)

        self.best = _Point(
            pick(self.z, z, 1), pick(variance, old_variance, 0),
            pick(hessian, old_hessian, 0), pick(gradient, old_gradient, 0),
        )  # fmt: skip

    def system(self) -> tuple[Array, Array, Array]:
        """Normal equations of all unknowns together, and what scales each joint's."""
        z, variance, hessian, gradient = self.reached
        scale = self.weight / (self.count * variance)
        count = int(self.place.max()) + 1
        H, g = np.zeros((count, count)), np.zeros(count)
        for j in range(self.n):
            at = np.flatnonzero(self.place[:, j] >= 0)
            to = self.place[at, j]
            H[np.ix_(to, to)] += scale[j] * hessian[j][np.ix_(at, at)]
            g[to] += scale[j] * gradient[j][at]
            prior = self.data.spread[at, j] ** -2.0
            H[to, to] += prior
            g[to] += prior * (z[at, j] - self.data.center[at, j])
        return H, g, scale

    def step(self) -> None:
        z = self.reached.z
        H, g, _ = self.system()
        count = len(g)
        low = np.zeros(count, bool)
        damping = np.zeros(count)
        value = np.zeros(count)
        for p, j in zip(*np.nonzero(self.place >= 0), strict=True):
            value[self.place[p, j]] = z[p, j]
            damping[self.place[p, j]] = self.damping[j]
            low[self.place[p, j]] = SIZE[p]
        held = low & (value <= 0) & (g > 0)
        move = np.zeros(count)
        for _ in range(3):
            on = ~held
            A = H[np.ix_(on, on)]
            move[:] = 0.0
            move[on] = -np.linalg.solve(
                A + np.diag(damping[on] * np.diag(A) + 1e-9 * np.diag(A).max()), g[on]
            )
            below = low & on & (value + move < 0) & (value <= 0)
            if not below.any():
                break
            held |= below
        new = z.copy()
        at = self.place >= 0
        change = np.where(at, move[np.maximum(self.place, 0)], 0.0)
        change = np.where(LOG[:, None], np.clip(change, -FARTHEST, FARTHEST), change)
        new += change
        new = np.where(SIZE[:, None] & at, np.maximum(new, 0.0), new)
        self.z = new


@dataclass(frozen=True, eq=False)
class Slopes:
    """Derivatives of a model's free motion by its U unknowns.

    Attributes:
        place: (P, n) number of the unknown that each parameter is; −1: given.
        prior: (U, U) of the prior's Hessian [nats].
        hessians: (C, U, U) of each stretch of the fit groups, or of a group's stretches together.
        scores: (C, U) their gradients.
        group: (C,) to which they belong.
        tolerated: (U,) variance that a systematic error of the size that right laws leave may cause.
    """

    place: Indices
    prior: Array
    hessians: Array
    scores: Array
    group: Array
    tolerated: Array

    @property
    def hessian(self) -> Array:
        """(U, U) of the objective [nats]."""
        return self.prior + self.hessians.sum(axis=0)

    def spread(self) -> Array:
        """(U,) variance of the unknowns as the parts disagree (a sandwich over them)."""
        inverse, count = np.linalg.pinv(self.hessian, hermitian=True), len(self.scores)
        moved = self.scores @ inverse
        apart: Array = np.square(moved).sum(axis=0) * count / max(count - 1, 1)
        return apart


def slopes_at(data: ServoData, free: Bools, values: Array, weight: Array) -> Slopes:
    """Derivatives at a model, (P, n) each."""
    one = _Descent(data, data.own, free, values, weight)
    theta = free_motion(data.own, one.points(), FINE)
    one.take(theta)
    one.judge()
    hessian, _, scale = one.system()
    away = (theta[0] - data.own.theta) * one.used
    count, stretches = len(hessian), theta.shape[-1]
    scores, hessians = np.zeros((stretches, count)), np.zeros((stretches, count, count))
    for j in range(free.shape[1]):
        at = [k for k, p in enumerate(one.variants) if one.place[p, j] >= 0]
        if not at:
            continue
        to = one.place[one.variants[at], j]
        shift = np.array([one.shift[one.variants[k], j] for k in at])[:, None, None]
        slope = (theta[np.array(at) + 1, :, j] - theta[0, :, j]) * one.used[:, j] / shift  # (U, T, C)
        scores[:, to] += scale[j] * np.einsum("utc,tc->cu", slope, away[:, j])
        hessians[:, to[:, None], to] += scale[j] * np.einsum("utc,vtc->cuv", slope, slope, optimize=True)
    whole = hessians.sum(axis=0)
    return Slopes(one.place, hessian - whole, hessians, scores, data.own.group, _tolerated(one, whole))


def _tolerated(one: _Descent, hessian: Array) -> Array:
    """(U,) variance of each unknown by an error of its own form, a share of the following error.

    Such an error is the same in every sample, so that more of them do not average it.
    """
    motion, variance = one.motion, one.reached.variance
    following = np.square(motion.goal - motion.theta) * motion.used
    share = MOTION.tolerance**2 * following.sum(axis=(0, 2)) / one.count / variance * one.weight  # (n,)
    out = np.zeros(len(hessian))
    for p, j in zip(*np.nonzero(one.place >= 0), strict=True):
        at = one.place[p, j]
        out[at] = max(out[at], share[j] / max(hessian[at, at], 1e-300))
    return out
