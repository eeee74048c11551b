"""Residual by joint and variable, with the share that each variable explains out of sample.

The mean in bins of a variable is tested on blocks of time that were not used for it (`cross_validation`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.cross_validation import (
    ExplainedShare,
    Folds,
    Ints,
    explained,
    make_folds,
    mean_and_error,
    shortest_run,
)
from flexviz.diagnosis.curves import explained_by_curve
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.records import DIRECTED, DIRECTION_GAIN, DIRECTIONS, UNITS, ResidualMap
from flexviz.diagnosis.residuals import SLOW, SlowResidual, joint_residuals, samples
from flexviz.diagnosis.result import ResidualLocation
from flexviz.diagnosis.spectrum import HANN_LINES, Spectrum, periodogram, spectra
from flexviz.equation import layout_of
from flexviz.measurements import MeasurementSet
from flexviz.model import FlexibleModel

Array = NDArray[np.float64]

BINS = 24  # of the curves that are drawn
SAMPLES_PER_BIN = 40  # at least, on average
BAND = 1.0  # [Hz] width of the band that stands for "frequency"
UNSTRUCTURED_SHARE = 0.1  # explained share of a residual up to which it counts as unstructured
MOTION = 0.99  # share of the velocity's power that is in the motion's band
HARMONICS = 3  # of it, which simple laws like friction or a cubic spring make


def maps(context: FitContext, fit: Fit, group: str | None = None) -> tuple[ResidualMap, ...]:
    """Every joint's residual against every variable; of all groups, or of one."""
    parts = joint_residuals(context, fit)
    data = samples(context, fit, parts, group)
    found = spectra(context, fit, parts)
    return tuple(
        one for j in range(fit.layout.n) for one in (*joint_maps(data, j), frequency_map(data, j, found[j]))
    )


@dataclass(frozen=True)
class _Against:
    """A variable's values and bins: index of each sample's bin, shape (N,), of S curves with B bins each."""

    values: Array
    index: Ints
    curves: tuple[str, ...]
    bins: int


def joint_maps(data: SlowResidual, joint: int) -> list[ResidualMap]:
    """A joint's residual against position, velocity, … and group."""
    residual = data.residual[:, joint]
    folds = make_folds(residual, data.shown, data.stretches)
    out = []
    for name in UNITS:
        if name == "frequency":
            continue
        against = binned(data, folds, joint, name)
        if name in ("time", "group"):
            found = explained(against.index, residual, folds)
        else:
            found = explained_by_curve(data, folds, joint, name)
        out.append(_map(data, joint, name, against, found, folds))
    return out


def binned(data: SlowResidual, folds: Folds, joint: int, name: str) -> _Against:
    """Bins of a variable."""
    bins = int(np.clip(data.shown.sum() // SAMPLES_PER_BIN, 4, BINS))
    if name == "group":
        return _Against(data.group.astype(float), data.group, ("",), len(data.groups))
    if name == "time":
        window = folds.window.copy()
        seen = np.zeros(len(data.groups), int)
        for rows in folds.stretches:  # a group may have several stretches
            group = int(data.group[rows.start])
            window[rows] += seen[group]
            seen[group] = int(window[rows].max()) + 1
        bins = int(seen.max())
        return _Against(data.time, data.group * bins + window, data.groups, bins)
    values = data.variable("position" if name == DIRECTED else name, joint)
    edges = _edges(values[data.shown], bins, name == "velocity")
    index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, bins - 1)
    if name != DIRECTED:
        return _Against(values, index, ("",), bins)
    return _Against(values, index + (data.theta[1, :, joint] < 0) * bins, DIRECTIONS, bins)


def _edges(values: Array, bins: int, at_zero: bool) -> Array:
    """Half way between equally spaced and equally filled bins; one edge at zero where friction may jump."""
    if not len(values):
        return np.linspace(0.0, 1.0, bins + 1)
    share = np.linspace(0, 1, bins + 1)
    low, high = float(values.min()), float(values.max())
    edges = 0.5 * (np.quantile(values, share) + low + share * (high - low))
    if at_zero and low < 0 < high:
        edges[1 + int(np.argmin(np.abs(edges[1:-1])))] = 0.0
    return np.sort(edges)


def _map(
    data: SlowResidual, joint: int, name: str, against: _Against, found: ExplainedShare, folds: Folds
) -> ResidualMap:
    residual, shown = data.residual[:, joint], data.shown
    shape = (len(against.curves), against.bins)
    total = shape[0] * shape[1]
    mean, std, count = mean_and_error(against.index, residual, total, folds)
    with np.errstate(invalid="ignore"):
        centres = np.bincount(against.index[shown], against.values[shown], total) / count
    strength = np.bincount(against.index, found.product, total).reshape(shape)
    run = shortest_run(strength.sum(axis=0))
    inside = (against.index % against.bins >= run.start) & (against.index % against.bins < run.stop) & shown
    if name == "time":  # a time means something within one group only
        best = int(np.argmax(np.maximum(strength, 0).sum(axis=1)))
        run = shortest_run(strength[best])
        inside = (against.index >= best * shape[1] + run.start) & (against.index < best * shape[1] + run.stop)
        inside &= shown
    values = against.values[inside]
    return ResidualMap(
        joint=data.joints[joint],
        variable=name,
        unit=UNITS[name],
        curves=against.curves,
        centres=centres.reshape(shape),
        mean=mean.reshape(shape),
        std=std.reshape(shape),
        count=count.reshape(shape),
        explained=found.share,
        explained_std=found.std,
        explained_by_group={
            g: found.of(residual, shown & (data.group == k)) for k, g in enumerate(data.groups)
        },
        range=(float(values.min()), float(values.max())) if len(values) else (0.0, 0.0),
    )


def frequency_map(data: SlowResidual, joint: int, spectrum: Spectrum) -> ResidualMap:
    """A joint's spectrum as a map: the residual's and its noise floor's."""
    density = np.array([spectrum.density, spectrum.floor])
    root = np.sqrt(density)
    std = np.array([spectrum.std, np.zeros_like(spectrum.std)])
    share, scatter, band = band_share(data, joint, spectrum)
    return ResidualMap(
        joint=spectrum.joint,
        variable="frequency",
        unit="Hz",
        curves=("residual", "noise floor"),
        centres=np.broadcast_to(spectrum.frequency, density.shape),
        mean=root,
        std=0.5 * std / np.maximum(root, 1e-300),
        count=np.broadcast_to(spectrum.lines, density.shape),
        explained=share,
        explained_std=scatter,
        explained_by_group={},
        range=band,
    )


def band_share(
    data: SlowResidual, joint: int, spectrum: Spectrum
) -> tuple[float, float, tuple[float, float]]:
    """Share of the strongest band beyond the motion's frequencies, its standard error, and the band [Hz].

    The band is chosen on one half of every stretch and judged on the other, and the other way round.
    """
    width = float(spectrum.frequency[1] - spectrum.frequency[0])
    bands = len(spectrum.frequency)
    wide = max(1, round(BAND / width))
    power, speed, lines = np.zeros((2, bands)), np.zeros(bands), np.zeros((2, bands))
    for rows in data.stretches:
        shown = rows.start + np.flatnonzero(data.shown[rows])
        for half, part in enumerate(np.array_split(shown, 2)):
            if len(part) < 8:
                continue
            both = np.stack((data.residual[part, joint], data.theta[1, part, joint]), axis=1)
            hertz, found = periodogram(both, float(data.step[rows.start]))
            band = (hertz / width).astype(int)
            inside = band < bands
            power[half] += np.bincount(band[inside], found[inside, 0], bands)
            lines[half] += np.bincount(band[inside], minlength=bands)
            speed += np.bincount(band[inside], found[inside, 1], bands)
    power /= np.maximum(lines, 1)
    floor = spectrum.floor * np.abs(SLOW.transfer(2 * np.pi * spectrum.frequency, 0)) ** 2
    moving = HARMONICS * (int(np.searchsorted(np.cumsum(speed), MOTION * speed.sum())) + 1)
    size = float(np.mean(data.residual[data.shown, joint] ** 2)) if data.shown.any() else 0.0
    if size <= 0 or bands - moving < wide:
        return 0.0, 0.0, (0.0, float(bands * width))
    excess = (power - floor)[:, moving:] * width / size
    runs = np.array([np.convolve(e, np.ones(wide), mode="valid") for e in excess])
    chosen = np.argmax(runs, axis=1)
    share = 0.5 * (runs[1, chosen[0]] + runs[0, chosen[1]])
    at = moving + int(np.argmax(runs.sum(axis=0)))
    scatter = HANN_LINES / np.maximum(lines.sum(axis=0), 1) * (floor * width / size) ** 2
    return (
        float(share),
        float(np.sqrt(scatter[at : at + wide].sum())),
        (float(at * width), float((at + wide) * width)),
    )


def maps_of(
    measurements: MeasurementSet,
    model: FlexibleModel,
    effects: Sequence[str] = (),
    check: Callable[[], None] = lambda: None,
) -> tuple[ResidualMap, ...]:
    """Maps of a model with the set's own effects and these; nothing is fitted."""
    layout = layout_of(measurements, effects)
    context = FitContext(measurements, layout)
    check()
    return locate_residual(context, context.fit(layout, layout.vector(model), iterations=0), check)[1]


def residual_locations(
    context: FitContext, fit: Fit, check: Callable[[], None] = lambda: None
) -> tuple[ResidualLocation, ...]:
    """Joint and variable, the joint with the largest excess first, on it the variable that explains most."""
    return locate_residual(context, fit, check)[0]


def locate_residual(
    context: FitContext, fit: Fit, check: Callable[[], None] = lambda: None
) -> tuple[tuple[ResidualLocation, ...], tuple[ResidualMap, ...]]:
    """Locations of the residual and their maps; first the joint with a large, structured residual.

    A law missing on a neighbouring joint may leave more on this one, but unstructured.

    "position" also stands for position and direction of motion together, where these explain clearly more
    than position or velocity alone.
    """
    parts = joint_residuals(context, fit)
    data = samples(context, fit, parts)
    found = spectra(context, fit, parts)
    places: list[tuple[float, list[ResidualLocation]]] = []
    all_maps: list[ResidualMap] = []
    for j in sorted(range(fit.layout.n), key=lambda k: -found[k].chi_square):
        check()
        seen = (*joint_maps(data, j), frequency_map(data, j, found[j]))
        all_maps.extend(seen)
        rows = {m.variable: m for m in seen}
        both, position = rows.pop(DIRECTED), rows["position"]
        simpler = max(position, rows["velocity"], key=lambda m: m.explained)
        if both.explained - simpler.explained > max(DIRECTION_GAIN, both.explained_std):
            rows["position"] = replace(both, variable="position")
        ranked = sorted(rows.values(), key=lambda m: -m.explained)
        surely = max(m.explained - m.explained_std for m in ranked)  # noise follows some variable by chance
        weight = found[j].chi_square * max(surely, UNSTRUCTURED_SHARE)
        places.append((weight, [ResidualLocation(m.joint, m.variable, m.explained, m.range) for m in ranked]))
    places.sort(key=lambda joint: -joint[0])
    return tuple(place for _, joint in places for place in joint), tuple(all_maps)
