"""Where the residual lives: joint by variable, with the share that each explains out of sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.crossval import (
    Explained,
    Folds,
    Ints,
    bin_count,
    carrying,
    explained,
    make_folds,
    mean_and_error,
    quantile_bins,
)
from flexviz.diagnosis.fitting import Fit, Workbench
from flexviz.diagnosis.result import Place
from flexviz.diagnosis.spectrum import JointResiduals, Spectrum, joint_residuals, spectra

Array = NDArray[np.float64]

DIRECTED = "position × direction"
UNITS = {
    "position": "rad",
    "velocity": "rad/s",
    "acceleration": "rad/s²",
    "load": "Nm",
    DIRECTED: "rad",
    "time": "s",
    "group": "-",
    "frequency": "Hz",
}
DIRECTIONS = ("forward", "backward")


@dataclass(frozen=True)
class ResidualMap:
    """One joint's residual against one variable: what a plot shows, and what it explains.

    Attributes:
        joint, variable: whose, against what; "position × direction" has one curve a direction.
        unit: of the variable.
        curves: names of the S curves: directions, groups (against time), "" where there is one.
        centres: shape (S, B), mean of the variable in each bin; NaN in empty ones.
        mean: shape (S, B), mean residual there [Nm]; for "frequency" the root of its density [Nm/√Hz].
        std: shape (S, B), standard error of the mean, autocorrelation included [Nm]; half the width of a 68 %
            noise band. For "frequency" the curves are the residual and its noise floor.
        count: shape (S, B), samples.
        explained: share of the residual's mean square that the variable predicts out of sample: zero on
            average for noise, so that a little below zero is nothing to worry about.
        explained_std: its standard error.
        explained_by_group: the same within each group.
        range: what carries most of it: the shortest range with half of what is explained.
    """

    joint: str
    variable: str
    unit: str
    curves: tuple[str, ...]
    centres: Array
    mean: Array
    std: Array
    count: Ints
    explained: float
    explained_std: float
    explained_by_group: dict[str, float]
    range: tuple[float, float]


@dataclass(frozen=True)
class Samples:
    """The slow residual of all groups of a bench, with what it is held against.

    Attributes:
        joints: names.
        groups: names of the groups, in the set's order.
        group: shape (N,), index into `groups`.
        stretches: which samples are contiguous.
        shown: shape (N,).
        time: shape (N,) [s], each group's own.
        residual: shape (N, n) [Nm].
        theta: shape (3, N, n), motor angle, velocity, acceleration.
        load: shape (N, n), transmission torque [Nm].
    """

    joints: tuple[str, ...]
    groups: tuple[str, ...]
    group: Ints
    stretches: tuple[slice, ...]
    shown: NDArray[np.bool_]
    time: Array
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


def samples(bench: Workbench, fit: Fit, parts: list[JointResiduals], group: str | None = None) -> Samples:
    """Fit and validation groups, one after the other; only one group's are shown where it is named."""
    names = tuple(g.name for g in bench.measurements.groups)
    index, stretches, at = [], [], 0
    for part in parts:
        signals = part.refinement.narrow.signals
        own = np.zeros(signals.count, int)
        for block in signals.blocks:
            own[block.rows] = names.index(signals.groups[block.group].name)
            stretches.append(slice(at + block.rows.start, at + block.rows.stop))
        index.append(own)
        at += signals.count
    of_group = np.concatenate(index)
    shown = np.concatenate([p.shown for p in parts])
    if group is not None:
        shown = shown & (of_group == names.index(group))
    return Samples(
        fit.layout.joints,
        names,
        of_group,
        tuple(stretches),
        shown,
        np.concatenate([p.refinement.narrow.signals.time for p in parts]),
        np.concatenate([p.slow for p in parts]) * shown[:, None],
        np.concatenate([p.refinement.narrow.signals.theta[:3] for p in parts], axis=1),
        np.concatenate([p.narrow.torque[0] for p in parts]),
    )


def maps(bench: Workbench, fit: Fit, group: str | None = None) -> tuple[ResidualMap, ...]:
    """Every joint's residual against every variable; of all groups, or of one."""
    parts = joint_residuals(bench, fit)
    data = samples(bench, fit, parts, group)
    found = spectra(bench, fit, parts)
    return tuple(
        one
        for j in range(fit.layout.n)
        for one in (*joint_maps(data, j), frequency_map(found[j]))
    )


def joint_maps(data: Samples, joint: int) -> list[ResidualMap]:
    """A joint's residual against position, velocity, … and group."""
    residual = data.residual[:, joint]
    folds = make_folds(residual, data.shown, data.stretches)
    count = bin_count(int(data.shown.sum()))
    out = []
    for name in UNITS:
        if name == "frequency":
            continue
        if name == "group":
            index, curves, values = data.group, ("",), data.group.astype(float)
        elif name == "time":
            index, curves, values = _windows(data, folds), data.groups, data.time
        elif name == DIRECTED:
            values = data.theta[0, :, joint]
            index = quantile_bins(values, data.shown, count)[0]
            index = index + (data.theta[1, :, joint] < 0) * (int(index.max()) + 1)
            curves = DIRECTIONS
        else:
            values, curves = data.variable(name, joint), ("",)
            index = quantile_bins(values, data.shown, count)[0]
        found = explained(index, residual, folds)
        out.append(_map(data, joint, name, curves, values, index, found, folds))
    return out


def _windows(data: Samples, folds: Folds) -> Ints:
    """Windows of time, as many for every group."""
    window = folds.window.copy()
    seen = np.zeros(len(data.groups), int)
    for rows in folds.stretches:  # a group may have several stretches
        group = int(data.group[rows.start])
        window[rows] += seen[group]
        seen[group] = int(window[rows].max()) + 1
    return data.group * max(1, int(seen.max())) + window


def _map(
    data: Samples, joint: int, name: str, curves: tuple[str, ...], values: Array, index: Ints,
    found: Explained, folds: Folds,
) -> ResidualMap:  # fmt: skip
    residual = data.residual[:, joint]
    if name == "group":
        bins = len(data.groups)
    else:
        per_curve = -(-(int(index.max()) + 1) // len(curves))
        bins = per_curve * len(curves)
    shown = data.shown
    count = np.bincount(index[shown], minlength=bins)
    with np.errstate(invalid="ignore"):
        centres = np.bincount(index[shown], values[shown], bins) / count
    raw = np.bincount(index[shown], residual[shown], bins) / np.maximum(count, 1)
    mean, std, count = mean_and_error(index, residual, raw[index], folds, bins)
    strength = np.zeros(bins)
    strength[: len(found.strength)] = found.strength
    shape = (len(curves), bins // len(curves))
    product = np.where(shown, found.prediction * residual, 0.0)
    by_group = {}
    for k, group in enumerate(data.groups):
        here = shown & (data.group == k)
        size = float(np.sum(residual[here] ** 2))
        by_group[group] = float(product[here].sum()) / size if size > 0 else 0.0
    best = int(np.argmax(np.maximum(strength, 0).reshape(shape).sum(axis=1))) if name == "time" else None
    by_bin = strength.reshape(shape)
    run = carrying(by_bin.sum(axis=0) if best is None else by_bin[best])
    inside = shown & np.isin(index, [s * shape[1] + b for s in range(shape[0]) for b in range(run.start, run.stop)
                                     if best is None or s == best])  # fmt: skip
    span = (float(values[inside].min()), float(values[inside].max())) if inside.any() else (np.nan, np.nan)
    return ResidualMap(
        data.joints[joint], name, UNITS[name], curves, centres.reshape(shape), mean.reshape(shape),
        std.reshape(shape), count.reshape(shape), found.share, found.std, by_group, span,
    )  # fmt: skip


def frequency_map(spectrum: Spectrum) -> ResidualMap:
    """A joint's spectrum as a map: the residual's and its noise floor's."""
    density = np.array([spectrum.density, spectrum.floor])
    root = np.sqrt(density)
    relative = np.array([spectrum.std, np.zeros_like(spectrum.std)]) / np.maximum(density, 1e-300)
    return ResidualMap(
        spectrum.joint, "frequency", "Hz", ("residual", "noise floor"),
        np.broadcast_to(spectrum.frequency, density.shape), root, 0.5 * root * relative,
        np.broadcast_to(spectrum.lines, density.shape), spectrum.above, spectrum.above_std, {}, spectrum.band,
    )  # fmt: skip


def places(bench: Workbench, fit: Fit) -> tuple[Place, ...]:
    """Joint × variable, the joint with the largest excess first, within it what explains most."""
    parts = joint_residuals(bench, fit)
    data = samples(bench, fit, parts)
    found = spectra(bench, fit, parts)
    out: list[Place] = []
    for j in sorted(range(fit.layout.n), key=lambda k: -found[k].chi_square):
        rows = [Place(m.joint, m.variable, m.explained, m.range) for m in joint_maps(data, j)]
        rows.append(Place(found[j].joint, "frequency", found[j].above, found[j].band))
        out.extend(sorted(rows, key=lambda p: -p.explained))
    return tuple(out)
