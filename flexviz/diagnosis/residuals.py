"""Residuals for inspection: joint by joint, low-passed, without what the model's parameters can absorb."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.cross_validation import Ints
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.equation import Pulses, side_by_side
from flexviz.estimation import (
    ESTIMATION,
    NoisePath,
    Point,
    TwoBandData,
    Whitener,
    bounded_step,
    noise_density,
    noise_paths,
    whitened,
)
from flexviz.observers import FlatZeroPhase
from flexviz.parallel import shared

Array = NDArray[np.float64]

SLOW_HERTZ = 6.0  # band of the slow residual
SLOW = FlatZeroPhase(2 * np.pi * SLOW_HERTZ)
SLOW_EDGE = 1 / SLOW_HERTZ  # [s] dropped at both ends of a stretch: transient of the low-pass
MANY_PULSES = 200  # of a stretch; a process is copied in the time that fewer take


@dataclass(frozen=True)
class JointResiduals:
    """Residual of the fit groups or of the validation groups at a fit.

    Attributes:
        two_band: signals.
        point: whitened residual and instruments of the fit.
        residual: shape (N, n) [Nm], in the wide band, without nuisance pulses at reversals.
        slow: shape (N, n) [Nm], `residual` after a low-pass; zero if not shown. (A residual formed from
            equally low-passed signals would contain errors in their products.)
        shown: shape (N,), samples of `slow` away from the ends of the stretch.
        white: shape (N, n), each joint whitened separately; zero if not used.
        paths: noise paths into the residual.
    """

    two_band: TwoBandData
    point: Point
    residual: Array
    slow: Array
    shown: NDArray[np.bool_]
    white: Array
    paths: list[NoisePath]

    @property
    def used(self) -> NDArray[np.bool_]:
        """Samples outside the transients, shape (N,)."""
        return self.point.used

    def floor(self, rows: slice, step: float, hertz: Array) -> tuple[Array, Array]:
        """Noise densities of `residual` and `slow` over some rows, (F, n) each [Nm²/Hz]; raw `step` [s]."""
        here = [path.rows(rows) for path in self.paths]
        observer = self.two_band.wide.signals.observer
        wide = noise_density(here, self.two_band.noise, observer.transfer, step, hertz)
        return wide, wide * np.abs(SLOW.transfer(2 * np.pi * hertz, 0))[:, None] ** 2


def joint_residuals(context: FitContext, fit: Fit) -> list[JointResiduals]:
    """Residuals of the fit groups and, if any, of the validation groups."""
    parts = ((context.two_band, fit.point), (context.validation, fit.held_out))
    return [_of_groups(fit, data, point) for data, point in parts if data is not None and point is not None]


def _of_groups(fit: Fit, data: TwoBandData, point: Point) -> JointResiduals:
    two_band = data.with_layout(fit.layout)
    wide, blocks = two_band.wide.at(fit.x), two_band.blocks
    residual = two_band.residual(wide, fit.x)
    paths = noise_paths(fit.layout, fit.x, point.link)
    whiteners = two_band.joint_whiteners(paths)
    unknown: list[list[Pulses]] = [[] for _ in blocks]
    for part in two_band.pulses(wide, fit.x, point.link):
        unknown[part.block].append(part)

    def settled(at: tuple[int, int]) -> tuple[Array, Array]:
        k, j = at
        rows = blocks[k].rows
        return settled_reversals(whiteners[k][j], residual[rows, j], point.used[rows], unknown[k], j)

    each = [(k, j) for k in range(len(blocks)) for j in range(fit.layout.n)]
    white, slow = np.zeros_like(residual), np.zeros_like(residual)
    many = max((part.count for parts in unknown for part in parts), default=0) >= MANY_PULSES
    settle = shared if many else map  # of few, it takes less than a copy of the process
    for (k, j), found in zip(each, settle(settled, each), strict=True):
        residual[blocks[k].rows, j], white[blocks[k].rows, j] = found
    shown = np.zeros(len(residual), bool)
    for block in blocks:
        kept = block.rows.start + np.flatnonzero(point.used[block.rows])
        step = block.segment.step * block.stride
        edge = int(np.ceil(SLOW_EDGE / step))
        inner = slice(edge, max(len(kept) - edge, edge))
        slow[kept[inner]] = SLOW.derivatives(residual[kept], step, 1)[0, inner]
        shown[kept[inner]] = True
    white[~point.used] = 0.0
    return JointResiduals(two_band, point, residual, slow, shown, white, paths)


def settled_reversals(
    whitener: Whitener, residual: Array, used: NDArray[np.bool_], pulses: Sequence[Pulses], joint: int
) -> tuple[Array, Array]:
    """Residual of one joint without nuisance pulses at reversals.

    Args:
        whitener: of this joint alone.
        residual: shape (N,) [Nm].
        used: shape (N,).
        pulses: of the stretch.
        joint: index of the joint.

    Returns:
        residual less the most probable pulses, and its whitened form P W r (see `NoiseWeighting`), shape (N,)
        each.
    """
    residual = residual.copy()
    white = whitener.apply(residual[:, None])[:, 0] * used
    for part in pulses:
        rows, columns = part.rows, part.dense(joint)
        own = [replace(group, columns=group.columns[:, joint : joint + 1]) for group in part.groups]
        answers = [whitened(whitener, group, rows) for group in own]
        seen = side_by_side([(first, answer[:, 0]) for first, answer in answers], len(columns))
        seen *= used[rows, None]
        # of the smaller Gram matrix: friction at rest may give thousands of pulses
        if seen.shape[1] > len(seen):
            squares, left = _spectrum(seen @ seen.T)
            right = seen.T @ left / np.sqrt(squares)
        else:
            squares, right = _spectrum(seen.T @ seen)
            left = seen @ right / np.sqrt(squares)
        along = left.T @ white[rows]
        white[rows] -= left @ ((1 - 1 / np.sqrt(1 + squares)) * along)
        # a residual above the noise must not be absorbed by the pulses
        chi = max(1.0, float(np.sum(white[rows] ** 2)) / max(int(used[rows].sum()), 1))
        residual[rows] -= columns @ (right @ (np.sqrt(squares) * along / (chi + squares)))
    return residual, white


def _spectrum(gram: Array) -> tuple[Array, Array]:
    """Eigenvalues (R,) and vectors (M, R) of a Gram matrix, without the negligible ones."""
    squares, vectors = np.linalg.eigh(gram)
    kept = squares > 1e-9 * max(float(squares[-1]), 1e-300)
    return squares[kept], vectors[:, kept]


@dataclass(frozen=True)
class SlowResidual:
    """Slow residual of all groups of a context, with the variables it may depend on.

    Attributes:
        joints: names.
        groups: names, in the order of the set.
        group: shape (N,), index into `groups`.
        stretches: contiguous samples.
        shown: shape (N,).
        time: shape (N,) [s], within the group.
        step: shape (N,) [s], sample step.
        residual: shape (N, n) [Nm]; zero if not shown.
        theta: shape (3, N, n), motor angle, velocity, acceleration [rad/s^k].
        load: shape (N, n), transmission torque [Nm].
    """

    joints: tuple[str, ...]
    groups: tuple[str, ...]
    group: Ints
    stretches: tuple[slice, ...]
    shown: NDArray[np.bool_]
    time: Array
    step: Array
    residual: Array
    theta: Array
    load: Array

    def variable(self, name: str, joint: int) -> Array:
        """Position, velocity, acceleration, load or time of a joint, shape (N,)."""
        if name == "load":
            return self.load[:, joint]
        if name == "time":
            return self.time
        return self.theta[("position", "velocity", "acceleration").index(name), :, joint]


def samples(
    context: FitContext, fit: Fit, parts: list[JointResiduals], group: str | None = None
) -> SlowResidual:
    """Slow residual of fit and validation groups; shown for a single `group` if given."""
    names = tuple(g.name for g in context.measurements.groups)
    index, stretches, steps, at = [], [], [], 0
    for part in parts:
        signals = part.two_band.narrow.signals
        own, step = np.zeros(signals.count, int), np.zeros(signals.count)
        for block in signals.blocks:
            own[block.rows] = names.index(signals.groups[block.group].name)
            step[block.rows] = block.segment.step * block.stride
            stretches.append(slice(at + block.rows.start, at + block.rows.stop))
        index.append(own)
        steps.append(step)
        at += signals.count
    of_group = np.concatenate(index)
    shown = np.concatenate([p.shown for p in parts])
    if group is not None:
        shown = shown & (of_group == names.index(group))
    return SlowResidual(
        fit.layout.joints, names, of_group, tuple(stretches), shown,
        np.concatenate([p.two_band.narrow.signals.time for p in parts]),
        np.concatenate(steps),
        np.concatenate(absorbed(context, fit, parts)) * shown[:, None],
        np.concatenate([p.two_band.narrow.signals.theta[:3] for p in parts], axis=1),
        np.concatenate([p.point.torque for p in parts]),
    )  # fmt: skip


@dataclass(frozen=True)
class Absorption:
    """Part of a residual that the model's parameters can absorb, by least squares in Nm.

    The fit weights every frequency by its noise. If the model error exceeds the noise by far, a few
    frequencies with little noise bias the parameters, and the missing effect spreads over all other
    frequencies. One step of least squares in Nm leaves the residual that no parameter explains.

    Attributes:
        weight: shape (n,), weight of each joint's residual [1/Nm].
        hessian: shape (P, P), of the weighted residual and the prior.
        step: shape (P,), parameter step; zero if the fit reaches the noise.
        jacobians: shape (N, n, P), one per part.
    """

    weight: Array
    hessian: Array
    step: Array
    jacobians: tuple[Array, ...]


def absorption(context: FitContext, fit: Fit, parts: list[JointResiduals]) -> Absorption:
    """Absorption estimated from the slow residual of the fit groups."""
    start = context.start(fit.layout)
    gradient, prior_hessian = start.prior.gradient_and_hessian(fit.x)
    shown = parts[0].shown
    jacobians = tuple(part.point.jacobian() for part in parts)
    jacobian, residual = jacobians[0][shown], parts[0].slow[shown]
    step = np.zeros(fit.layout.size)
    chi = np.sum(parts[0].white ** 2, axis=0) / max(np.count_nonzero(parts[0].used), 1)
    rounds = 3 if float(chi.mean()) > ESTIMATION.consistent and not fit.unbiased else 0
    for done in range(rounds + 1):
        size = np.sqrt(np.mean((residual + jacobian @ step) ** 2, axis=0))
        weight: Array = 1 / np.maximum(size, 1e-12 + 1e-9 * float(size.max()))
        scaled = (jacobian * weight[:, None]).reshape(-1, fit.layout.size)
        hessian = scaled.T @ scaled + prior_hessian
        if done == rounds:
            break
        right = gradient + scaled.T @ (residual * weight).ravel()
        step = bounded_step(right, hessian, fit.x, start.bounds)[0]
    return Absorption(weight, hessian, step, jacobians)


def absorbed(context: FitContext, fit: Fit, parts: list[JointResiduals]) -> list[Array]:
    """Slow residuals without the part that the model's parameters can absorb, shape (N, n) each."""
    found = absorption(context, fit, parts)
    if not found.step.any():
        return [p.slow for p in parts]
    return [
        p.slow + (jacobian @ found.step) * p.shown[:, None]
        for p, jacobian in zip(parts, found.jacobians, strict=True)
    ]
