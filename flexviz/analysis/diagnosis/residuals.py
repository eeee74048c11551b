"""Residuals for inspection: joint by joint, low-passed, without what the model's parameters can absorb."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.fit_context import Fit, FitContext
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.estimation import (
    ESTIMATION,
    NARROW_HERTZ,
    NoisePath,
    Point,
    TwoBandData,
    Whitener,
    bounded_step,
    noise_paths,
    whitened,
)
from flexviz.base.parallel import shared
from flexviz.model.equation import Pulses, side_by_side
from flexviz.model.observers import FlatZeroPhase

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

SLOW = FlatZeroPhase(2 * np.pi * NARROW_HERTZ)  # low-pass of the slow residual
DIRECTED = "position × direction"
UNITS = {
    "position": "rad", "velocity": "rad/s", "acceleration": "rad/s²", "load": "Nm", DIRECTED: "rad",
    "time": "s", "group": "-", "frequency": "Hz",
}  # of the variables of a residual map  # fmt: skip
DIRECTION_GAIN = THRESHOLDS.evidence.share  # that position and direction together have to explain more


@dataclass(frozen=True)
class JointResiduals:
    """Residual of the fit groups or of the validation groups at a fit.

    Attributes:
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
    shown: Bools
    white: Array
    paths: list[NoisePath]


def joint_residuals(context: FitContext, fit: Fit) -> list[JointResiduals]:
    """Residuals of the fit groups and, if any, of the validation groups."""
    parts = ((context.two_band, fit.point), (context.validation, fit.held_out))
    return [_of_groups(fit, data, point) for data, point in parts if data is not None and point is not None]


def chi_square(parts: Sequence[JointResiduals]) -> Array:
    """Mean square of each joint's whitened residual, shape (n,); 1 for noise."""
    used = np.sum([part.point.counted.sum(axis=0) for part in parts], axis=0)
    return np.sum([np.sum(part.white**2, axis=0) for part in parts], axis=0) / np.maximum(used, 1)


def _of_groups(fit: Fit, data: TwoBandData, point: Point) -> JointResiduals:
    two_band = data.with_layout(fit.layout)
    wide, blocks, used = two_band.wide.at(fit.x), two_band.blocks, point.used
    residual = two_band.residual(wide, fit.x) * two_band.known
    paths = noise_paths(fit.layout, fit.x, point.link)
    whiteners = two_band.joint_whiteners(paths)
    unknown: list[list[Pulses]] = [[] for _ in blocks]
    for part in two_band.pulses(wide, fit.x, point.link):
        unknown[part.block].append(part)

    def settled(at: tuple[int, int]) -> tuple[Array, Array]:
        k, j = at
        rows = blocks[k].rows
        return settled_reversals(whiteners[k][j], residual[rows, j], used[rows], unknown[k], j)

    each = [(k, j) for k in range(len(blocks)) for j in range(fit.layout.n)]
    white, slow, shown = np.zeros_like(residual), np.zeros_like(residual), np.zeros(len(residual), bool)
    for (k, j), found in zip(each, shared(settled, each), strict=True):
        residual[blocks[k].rows, j], white[blocks[k].rows, j] = found
    for block in blocks:
        kept = block.rows.start + np.flatnonzero(used[block.rows])
        step = block.segment.step * block.stride
        edge = int(np.ceil(1 / (NARROW_HERTZ * step)))  # transient of the low-pass
        inner = slice(edge, max(len(kept) - edge, edge))
        slow[kept[inner]] = SLOW.derivatives(residual[kept], step, 1)[0, inner]
        shown[kept[inner]] = True
    return JointResiduals(two_band, point, residual, slow, shown, white, paths)


def settled_reversals(
    whitener: Whitener, residual: Array, used: Bools, pulses: Sequence[Pulses], joint: int
) -> tuple[Array, Array]:
    """Residual of one joint, shape (N,), less the most probable nuisance pulses, and its form P W r.

    P W is explained at `NoiseWeighting`; zero if not `used`, shape (N,). `whitener`: of this joint alone.
    """
    residual = residual.copy()
    white = whitener.apply(residual[:, None])[:, 0] * used
    for part in pulses:
        rows, columns = part.rows, part.dense(joint)
        own = [replace(group, columns=group.columns[:, joint : joint + 1]) for group in part.groups]
        answers = [whitened(whitener, group, rows) for group in own]
        seen = side_by_side([(first, answer[:, 0]) for first, answer in answers], len(columns))
        left, sizes, right = np.linalg.svd(seen * used[rows, None], full_matrices=False)
        along, squares = left.T @ white[rows], sizes**2
        white[rows] -= left @ ((1 - 1 / np.sqrt(1 + squares)) * along)
        # a residual above the noise must not be absorbed by the pulses
        chi = max(1.0, float(np.sum(white[rows] ** 2)) / max(int(used[rows].sum()), 1))
        residual[rows] -= columns @ (right.T @ (sizes * along / (chi + squares)))
    return residual, white


@dataclass(frozen=True)
class SlowResidual:
    """Slow residual of all groups of a context, with the variables it may depend on.

    Attributes:
        group: shape (N,), index into `groups`.
        stretches: contiguous samples, of which only `shown`, shape (N,), count.
        time, step: shape (N,), time within the group and sample step [s].
        residual: shape (N, n) [Nm]; zero if not shown.
        theta: shape (3, N, n), motor angle, velocity, acceleration [rad/s^k].
        load: shape (N, n), transmission torque [Nm].
    """

    joints: tuple[str, ...]
    groups: tuple[str, ...]
    group: NDArray[np.int64]
    stretches: tuple[slice, ...]
    shown: Bools
    time: Array
    step: Array
    residual: Array
    theta: Array
    load: Array

    @property
    def cycle(self) -> int:
        """Samples per cycle of the low-pass, after which noise is uncorrelated."""
        return int(np.ceil(1 / (NARROW_HERTZ * self.step.min())))

    def variable(self, name: str, joint: int) -> Array:
        """A variable of a joint, such as "velocity" or "time", shape (N,)."""
        if name in ("load", "time"):
            return self.load[:, joint] if name == "load" else self.time
        return self.theta[("position", "velocity", "acceleration").index(name.split()[0]), :, joint]


def samples(context: FitContext, fit: Fit, parts: list[JointResiduals]) -> SlowResidual:
    """Slow residual of fit and validation groups, without what the parameters can absorb."""
    names = tuple(g.name for g in context.measurements.groups)
    signals = [part.two_band.narrow.signals for part in parts]
    group = [np.array([names.index(s.groups[k].name) for k in s.group], int) for s in signals]
    blocks = [(at, b) for at, s in zip((0, signals[0].count), signals, strict=False) for b in s.blocks]
    shown, found = np.concatenate([p.shown for p in parts]), absorption(context, fit, parts)
    left = np.concatenate([p.slow + jac @ found.step for p, jac in zip(parts, found.jacobians, strict=True)])
    return SlowResidual(
        fit.layout.joints, names, np.concatenate(group),
        tuple(slice(at + b.rows.start, at + b.rows.stop) for at, b in blocks), shown,
        np.concatenate([s.time for s in signals]),
        np.concatenate([np.full(b.rows.stop - b.rows.start, b.segment.step * b.stride) for _, b in blocks]),
        left * shown[:, None], np.concatenate([s.theta[:3] for s in signals], axis=1),
        np.concatenate([p.point.torque for p in parts]),
    )  # fmt: skip


@dataclass(frozen=True)
class Absorption:
    """Part of a residual that the model's parameters can absorb, by least squares in Nm.

    The fit weights every frequency by its noise. If the model error exceeds the noise by far, a few
    frequencies with little noise bias the parameters, and the missing effect spreads over all others.

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

    def left(self, columns: Array, joint: int) -> Array:
        """What the parameters cannot absorb of contributions (N, C) to a joint's residual."""
        own = np.concatenate([jacobian[:, joint] for jacobian in self.jacobians])
        scale, fitted = 1 / np.sqrt(np.maximum(np.diag(self.hessian), 1e-300)), len(self.jacobians[0])
        right = self.weight[joint] ** 2 * own[:fitted].T @ columns[:fitted]
        step = np.linalg.solve(self.hessian * scale[:, None] * scale, right * scale[:, None])
        return columns - (own * scale) @ step


def absorption(context: FitContext, fit: Fit, parts: list[JointResiduals]) -> Absorption:
    """Absorption estimated from the slow residual of the fit groups."""
    start = context.start(fit.layout)
    gradient, prior_hessian = start.prior.gradient_and_hessian(fit.x)
    shown = parts[0].shown
    jacobians = tuple(part.point.jacobian() for part in parts)
    jacobian, residual = jacobians[0][shown], parts[0].slow[shown]
    far = float(chi_square(parts[:1]).mean()) > ESTIMATION.consistent and not fit.unbiased
    found = Absorption(np.ones(fit.layout.n), prior_hessian, np.zeros(fit.layout.size), jacobians)
    for more in (far, far, far, False):
        size = np.sqrt(np.mean((residual + jacobian @ found.step) ** 2, axis=0))
        weight = 1 / np.maximum(size, 1e-12 + 1e-9 * float(size.max()))
        scaled = (jacobian * weight[:, None]).reshape(-1, fit.layout.size)
        found = replace(found, weight=weight, hessian=scaled.T @ scaled + prior_hessian)
        if more:
            right = gradient + scaled.T @ (residual * weight).ravel()
            found = replace(found, step=bounded_step(right, found.hessian, fit.x, start.bounds)[0])
    return found
