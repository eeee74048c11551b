"""Residual maps: residual of each joint against each variable, with the share explained out of sample."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.cross_validation import (
    ExplainedShare,
    Folds,
    Ints,
    explained,
    explained_in_time,
    make_folds,
    mean_and_error,
    shortest_run,
)
from flexviz.diagnosis.curves import fit_curve
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.records import DIRECTED, DIRECTION_GAIN, DIRECTIONS, UNITS, ResidualMap
from flexviz.diagnosis.residuals import (
    SLOW,
    JointResiduals,
    SlowResidual,
    chi_square,
    joint_residuals,
    samples,
)
from flexviz.diagnosis.result import ResidualLocation
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.vibration import HARMONICS
from flexviz.effects.free_curve import NODES
from flexviz.equation import layout_of
from flexviz.estimation import noise_density
from flexviz.measurements import MeasurementSet
from flexviz.model import FlexibleModel
from flexviz.parallel import shared

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.evidence
UNSTRUCTURED_SHARE = 0.1  # explained share of a residual up to which it counts as unstructured


def joint_maps(data: SlowResidual, joint: int) -> list[ResidualMap]:
    """Maps of a joint against all variables but frequency."""
    folds = make_folds(data.shown, data.stretches, data.cycle)
    return [_map(data, joint, name, folds) for name in UNITS if name != "frequency"]


def _explained(data: SlowResidual, joint: int, name: str, folds: Folds) -> ExplainedShare:
    """Share of a joint's residual that a variable explains.

    A residual that is most of the load follows it whatever is missing: the load is seen from the motor, so
    that it contains a torque that is missing there, and a link that carries little needs nothing else.
    """
    residual = data.residual[:, joint]
    if name == "time":
        return explained_in_time(residual, folds)
    if name == "group":
        return explained(data.group, residual, folds)
    found, load = fit_curve(data, folds, joint, name).found, data.load[data.shown, joint]
    own = name == "load" and load.size and np.var(residual[data.shown]) > np.var(load - residual[data.shown])
    return replace(found, share=0.0) if own else found


def binned(
    data: SlowResidual, folds: Folds, joint: int, name: str
) -> tuple[Array, Ints, tuple[str, ...], int]:
    """Values of a variable and the index of each sample's bin, shape (N,), in curves of so many bins each.

    Edges lie midway between equally spaced and equally filled bins; one of velocity's at zero.
    """
    if name == "group":
        return data.group.astype(float), data.group, ("",), len(data.groups)
    if name == "time":
        block, seen = folds.block.copy(), np.zeros(len(data.groups), int)
        for rows in folds.stretches:  # a group may have several stretches
            block[rows] += seen[data.group[rows.start]]
            seen[data.group[rows.start]] = block[rows].max() + 1
        bins = max(int(seen.max()), 1)
        return data.time, data.group * bins + block, data.groups, bins
    values, share = data.variable(name, joint), np.linspace(0, 1, NODES + 1)
    seen = values[data.shown] if data.shown.any() else np.zeros(1)
    edges = 0.5 * (np.quantile(seen, share) + seen.min() + share * np.ptp(seen))
    if name == "velocity" and edges[0] < 0 < edges[-1]:
        edges[1 + np.argmin(np.abs(edges[1:-1]))] = 0.0
    index = np.clip(np.searchsorted(np.sort(edges), values, side="right") - 1, 0, NODES - 1)
    if name != DIRECTED:
        return values, index, ("",), NODES
    return values, index + (data.theta[1, :, joint] < 0) * NODES, DIRECTIONS, NODES


def _map(data: SlowResidual, joint: int, name: str, folds: Folds) -> ResidualMap:
    residual, shown, found = data.residual[:, joint], data.shown, _explained(data, joint, name, folds)
    values, index, curves, bins = binned(data, folds, joint, name)
    shape = (len(curves), bins)
    mean, std, count = mean_and_error(index, residual, shape[0] * bins, folds)
    with np.errstate(invalid="ignore"):
        centres = np.bincount(index[shown], values[shown], len(count)) / count
    strength = np.bincount(index, found.product, len(count)).reshape(shape)
    inside = shown
    if name == "time":  # each group has its own time
        best = int(np.argmax(np.maximum(strength, 0).sum(axis=1)))
        inside, strength = shown & (index // bins == best), strength[[best]]
    run = shortest_run(strength.sum(axis=0))
    within = values[inside & (index % bins >= run.start) & (index % bins < run.stop)]
    return ResidualMap(
        joint=data.joints[joint],
        variable=name,
        unit=UNITS[name],
        curves=curves,
        centres=centres.reshape(shape),
        mean=mean.reshape(shape),
        std=std.reshape(shape),
        count=count.reshape(shape),
        explained=found.share,
        explained_std=found.std,
        explained_by_group={
            g: found.of(residual, shown & (data.group == k)) for k, g in enumerate(data.groups)
        },
        range=(float(within.min()), float(within.max())) if len(within) else (0.0, 0.0),
    )


def frequency_maps(names: Sequence[str], parts: Sequence[JointResiduals]) -> list[ResidualMap]:
    """Spectrum of every joint's residual and its noise floor, in bands of one hertz.

    The share is that of the strongest band above those of the motion and its harmonics.
    """
    observer = parts[0].two_band.wide.signals.observer
    bands = max(1, int(np.max(observer.bandwidth) / (2 * np.pi)))
    lines, sums = np.zeros((2, bands, 1)), np.zeros((2, 3, bands, len(names)))
    for part in parts:
        velocity = part.two_band.wide.signals.theta[1]
        for block in part.two_band.blocks:
            rows, step = block.rows, block.segment.step
            used = rows.start + np.flatnonzero(part.point.used[rows])
            for half, at in enumerate(np.array_split(used, 2)):
                if len(at) > NODES:
                    window, spacing = np.hanning(len(at))[:, None], step * block.stride
                    both = np.fft.rfft(np.stack((part.residual[at], velocity[at])) * window, axis=1)
                    power = np.abs(both) ** 2 * (2 * spacing / np.sum(window**2))
                    hertz = np.arange(power.shape[1]) / (len(at) * spacing)
                    kept = hertz < bands
                    here, band = [path.rows(rows) for path in part.paths], hertz[kept].astype(int)
                    floor = noise_density(here, part.two_band.noise, observer.transfer, step, hertz)
                    np.add.at(lines[half], band, 1)
                    for total, one in zip(sums[half], (power[0], floor, power[1]), strict=True):
                        np.add.at(total, band, one[kept])
    count = np.maximum(lines.sum(axis=0), 1)
    density, floor, motion = sums.sum(axis=0) / count
    std = density * np.sqrt(2 / count)  # a Hann window correlates neighbouring lines
    centre = np.linspace(0.5, bands - 0.5, bands)
    slow = np.abs(SLOW.transfer(2 * np.pi * centre, 0))[:, None] ** 2
    size = np.maximum((density * slow).sum(axis=0), 1e-300)
    moving = np.flatnonzero(np.any(motion > LIMITS.motion_share * motion.sum(axis=0), axis=1)) + 1
    excess = (sums[:, 0] - sums[:, 1]) / np.maximum(lines, 1) * slow / size
    excess[:, : HARMONICS * int(np.max(moving, initial=1))] = 0.0
    best, chosen = np.argmax(excess.sum(axis=0), axis=0), np.argmax(excess, axis=1)
    shares = 0.5 * (
        np.take_along_axis(excess[1], chosen[:1], 0) + np.take_along_axis(excess[0], chosen[1:], 0)
    )
    root, error = np.sqrt([density, floor]), 0.5 * std / np.maximum(np.sqrt(density), 1e-300)
    return [
        ResidualMap(
            joint=name,
            variable="frequency",
            unit=UNITS["frequency"],
            curves=("residual", "noise floor"),
            centres=np.array([centre, centre]),
            mean=root[:, :, j],
            std=np.stack((error[:, j], np.zeros(bands))),
            count=np.tile(count[:, 0].astype(int), (2, 1)),
            explained=float(shares[0, j]),
            explained_std=float((std * slow)[at, j] / size[j]),
            explained_by_group={},
            range=(float(at), float(at + 1)),
        )
        for j, (name, at) in enumerate(zip(names, best, strict=True))
    ]


def maps_of(
    measurements: MeasurementSet,
    model: FlexibleModel,
    effects: Sequence[str] = (),
    check: Callable[[], None] = lambda: None,
) -> tuple[ResidualMap, ...]:
    """Maps of a model with the set's effects and additional `effects`; nothing is fitted."""
    layout = layout_of(measurements, effects)
    context = FitContext(measurements, layout)
    check()
    return locate_residual(context, context.fit(layout, layout.vector(model), iterations=0), check).maps


class Located(NamedTuple):
    """Where the residual of a fit lies: the worst joint first, each by explained share; maps; residuals."""

    places: tuple[ResidualLocation, ...]
    maps: tuple[ResidualMap, ...]
    parts: list[JointResiduals]


def residual_locations(context: FitContext, fit: Fit) -> tuple[ResidualLocation, ...]:
    """Locations of the residual: by joint, then by explained share."""
    return locate_residual(context, fit).places


def locate_residual(context: FitContext, fit: Fit, check: Callable[[], None] = lambda: None) -> Located:
    """Locations of the residual and their maps, the joint with the largest structured residual first.

    An effect missing on a neighbouring joint may leave a larger but unstructured residual. "position" also
    represents position and direction of motion together, if these explain clearly more than position or
    velocity alone.
    """
    parts = joint_residuals(context, fit)
    data, chi = samples(context, fit, parts), chi_square(parts)
    spectra = frequency_maps(fit.layout.joints, parts)

    def maps_of_joint(j: int) -> list[ResidualMap]:
        check()
        return [*joint_maps(data, j), spectra[j]]

    places: list[tuple[float, list[ResidualLocation]]] = []
    order = [int(j) for j in np.argsort(-chi)]
    maps = list(shared(maps_of_joint, order))
    for j, seen in zip(order, maps, strict=True):
        rows = {m.variable: m for m in seen}
        both, position = rows.pop(DIRECTED), rows["position"]
        simpler = max(position, rows["velocity"], key=lambda m: m.explained)
        if both.explained - simpler.explained > max(DIRECTION_GAIN, both.explained_std):
            rows["position"] = replace(both, variable="position")
        ranked = sorted(rows.values(), key=lambda m: -m.explained)
        surely = max(m.explained - m.explained_std for m in ranked)  # noise follows some variable by chance
        own = [ResidualLocation(m.joint, m.variable, m.explained, m.range) for m in ranked]
        places.append((chi[j] * max(surely, UNSTRUCTURED_SHARE), own))
    places.sort(key=lambda joint: -joint[0])
    return Located(
        tuple(place for _, own in places for place in own), tuple(m for seen in maps for m in seen), parts
    )
