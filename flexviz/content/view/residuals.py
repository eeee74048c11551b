"""Where the residual lives: maps of all joints, charts of one joint, and the instants in a range."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis import DIRECTED, DIRECTION_GAIN, PredictionErrors, Step
from flexviz.analysis.identification import Identification
from flexviz.base.arrays import Array, Bools
from flexviz.base.statistics import NORMAL_95
from flexviz.content.charts import (
    COLOURS,
    DASHED,
    DASHES,
    Chart,
    ChartAxis,
    ChartSeries,
    Ribbon,
    no_chart,
)
from flexviz.content.records import JointErrors, ResidualMap, stated_errors
from flexviz.content.wording import error_hover, escape, number

MAP_COLUMNS = {
    "position": "pos.",
    "velocity": "vel.",
    "position × direction": "pos.±",
    "acceleration": "acc.",
    "load": "load",
    "time": "time",
    "group": "group",
    "frequency": "freq.",
}
"""Variable -> head of its column."""
CHARTED = ("position", "velocity", "acceleration", "load")  # variables with a chart in the app
LEADING_CANDIDATES = (*CHARTED, "position × direction", "time")  # for the report's chart
FREE = "free"
HEIGHT = 150  # [px] in the app
SPECTRUM_FLOOR = 1e-9  # [Nm/√Hz] smallest value drawn on a logarithmic axis
MIN_NOTABLE_SHARE = 0.05  # of a residual: smaller shares are not highlighted
BRIGHT_SHARE = 0.87  # of the colour of a cell, above which black reads better on it than white
MAX_DOTS = 40  # a line with more bins has no dots
CURVES = tuple(zip((COLOURS.residual, COLOURS.model, COLOURS.measured, COLOURS.torque), DASHES, strict=True))
EMPTY = (
    "The residual against position, velocity, acceleration, load, time, group and frequency appears here, "
    "with the noise floor, after Run (step 3, Identify) or Find the missing effect (step 4, Diagnose)."
)
UNITS = {"position": "rad", "velocity": "rad/s", "acceleration": "rad/s²", "load": "Nm", "time": "s"}
VARIABLES = tuple(UNITS)
MAX_GROUPS = 12  # listed


def map_of(maps: Sequence[ResidualMap], joint: str, variable: str) -> ResidualMap | None:
    """One joint's map against one variable, or None."""
    return next((one for one in maps if (one.joint, one.variable) == (joint, variable)), None)


def notable(one: ResidualMap) -> bool:
    """Whether a variable explains clearly more than chance."""
    return one.explained > NORMAL_95 * one.explained_std and one.explained >= MIN_NOTABLE_SHARE


def leading_map(maps: Sequence[ResidualMap], joint: str) -> ResidualMap | None:
    """The map of a joint against the variable that explains the largest share."""
    of_joint = [m for m in maps if m.joint == joint and m.variable in LEADING_CANDIDATES]
    of_joint = [m for m in of_joint if np.count_nonzero(np.isfinite(m.mean).any(axis=0)) > 1]
    return max(of_joint, key=lambda m: m.explained, default=None)


def map_charts(maps: Sequence[ResidualMap], joint: str, unit: str = "Nm") -> tuple[Chart, ...]:
    """One joint's residual in a unit against every variable with the noise ribbon, and its spectrum.

    The chart against position has one curve per direction of motion if the direction matters.
    """
    drawn = {name: map_of(maps, joint, name) for name in CHARTED}
    drawn["position"] = _directed(maps, joint) or drawn["position"]
    charts = [no_chart(name) if one is None else map_chart(one, name, unit) for name, one in drawn.items()]
    spectrum = map_of(maps, joint, "frequency")
    return (*charts, no_chart("spectrum") if spectrum is None else spectrum_chart(spectrum))


def _directed(maps: Sequence[ResidualMap], joint: str) -> ResidualMap | None:
    """The map of position and direction if it explains clearly more than position or velocity alone."""
    both = map_of(maps, joint, DIRECTED)
    simpler = [one for name in ("position", "velocity") if (one := map_of(maps, joint, name)) is not None]
    if both is None or not simpler:
        return None
    more = both.explained - max(one.explained for one in simpler)
    return both if more > max(DIRECTION_GAIN, both.explained_std) else None


def map_chart(one: ResidualMap, key: str = "", unit: str = "Nm") -> Chart:
    """The mean residual against one variable, with the 95 % ribbon of noise."""
    key = key or one.variable
    known = np.isfinite(one.mean).any(axis=0) & np.isfinite(one.std).any(axis=0)
    if np.count_nonzero(known) < 2:
        return no_chart(key, f"The {key} of {one.joint} hardly changes.")
    mean, std, x = one.mean[:, known], one.std[:, known], np.nanmean(one.centres[:, known], axis=0)
    points = len(x) <= MAX_DOTS
    series = [
        ChartSeries(name or "mean residual", colour, x, y, 2.2, dash, points)
        for name, y, (colour, dash) in zip(one.curves, mean, CURVES, strict=False)
    ]
    half = NORMAL_95 * np.nanmax(std, axis=0)
    share, error = (100 * max(value, 0.0) for value in (one.explained, NORMAL_95 * one.explained_std))
    words = f"{share:.0f} % ± {error:.0f} % of the residual of {one.joint} follows its {one.variable}"
    low, high = (number(edge, 3) for edge in one.range)
    words += f", most of it from {low} to {high} {one.unit}." if notable(one) else ": no more than chance."
    return Chart(
        key,
        f"Residual of {one.joint} against {key}, {share:.0f} %",
        ChartAxis(f"{one.variable} of {one.joint}", one.unit),
        ChartAxis("mean residual", unit),
        tuple(series),
        (Ribbon("95 % of noise", COLOURS.reference, x, -half, half),),
        description=f"{words} Largest mean: {number(float(np.nanmax(np.abs(mean))), 3)} {unit}.",
        highlights=(one.range,) if notable(one) else None,
        height=HEIGHT,
    )


def spectrum_chart(one: ResidualMap) -> Chart:
    """Spectra of residual and noise."""
    if one.mean.shape[1] < 2:
        return no_chart("spectrum")
    looks = ((COLOURS.residual, ()), (COLOURS.reference, DASHED))
    series = tuple(
        ChartSeries(name, colour, x, np.maximum(np.nan_to_num(values), SPECTRUM_FLOOR), dash=dash)
        for name, (colour, dash), x, values in zip(one.curves, looks, one.centres, one.mean, strict=False)
    )
    share, middle = 100 * max(one.explained, 0.0), number(sum(one.range) / 2, 3)
    return Chart(
        "spectrum",
        f"Spectrum of the residual of {one.joint}",
        ChartAxis("frequency", "Hz"),
        ChartAxis("residual", "Nm/√Hz", logarithmic=True),
        series,
        description=f"Of the residual of {one.joint} above the noise floor and the motion's frequencies, the "
        f"strongest band of 1 Hz, near {middle} Hz, holds {share:.0f} %"
        + ("." if notable(one) else ": no more than chance."),
        height=HEIGHT,
    )


@dataclass(frozen=True, eq=False)
class ResidualSamples:
    """The residual of one joint and the variables it may depend on, over all groups of a result."""

    names: tuple[str, ...]  # of the groups
    group: NDArray[np.int64]  # (N,) index into `names`
    variables: dict[str, Array]  # name -> (N,), in the units of `UNITS`
    residual: Array  # (N,) [Nm]
    floor: float  # rms expected from measurement noise alone [Nm]; NaN if unknown

    @classmethod
    def of(cls, result: Identification | None, joint: int) -> ResidualSamples | None:
        """The samples of one joint; None if the result has no residuals."""
        if result is None:
            return None
        names: list[str] = []
        rows: list[tuple[Array, ...]] = []
        group: list[Array] = []
        for name, series in result.residuals.items():
            if len(series.time) < 5:
                continue
            time, q = np.asarray(series.time), np.asarray(series.q[:, joint])
            velocity = np.gradient(q, time)
            steps = np.diff(time, prepend=2 * time[0] - time[1])
            near_gap = steps > 2.5 * np.median(steps)
            near_gap |= np.roll(near_gap, -1) | np.roll(near_gap, 1)
            acceleration, load = np.gradient(velocity, time), series.torque[:, joint]
            columns = (q, velocity, acceleration, load, time, series.residual[:, joint])
            rows.append(tuple(np.asarray(column)[~near_gap] for column in columns))
            group.append(np.full(np.count_nonzero(~near_gap), len(names)))
            names.append(name)
        if not rows:
            return None
        columns = [np.concatenate(pieces) for pieces in zip(*rows, strict=True)]
        noise = result.noise_in(names[0])
        floor = float(noise[joint]) if joint < len(noise) else float("nan")
        variables = dict(zip(VARIABLES, columns[:-1], strict=True))
        return cls(tuple(names), np.concatenate(group).astype(np.int64), variables, columns[-1], floor)

    def rows(self, group: str) -> Bools:
        """Bools (N,) of the samples of a group."""
        return self.group == (self.names.index(group) if group in self.names else -1)

    def limits(self, variable: str) -> tuple[float, float] | None:
        """Smallest and largest value of a variable, rounded outwards for the range slider."""
        if variable not in self.variables:
            return None
        values = self.variables[variable]
        low, high = float(values.min()), float(values.max())
        if not high > low:
            return None
        digit = 10.0 ** (np.floor(np.log10(high - low)) - 1)
        return float(np.floor(low / digit) * digit), float(np.ceil(high / digit) * digit)

    def instants(self, variable: str, low: float, high: float, group: str) -> tuple[Array, Bools]:
        """Times (M,) [s] in a group, and whether the variable is in the range there."""
        rows = self.rows(group)
        values = self.variables[variable][rows]
        return self.variables["time"][rows], (values >= low) & (values <= high)


def left_out(group: str) -> str:
    """The reason for a group without residual."""
    return f"{group} has no residual: the last Run ignored it (Ignore in step Data)."


def stretches_of(time: Array, inside: Bools) -> tuple[tuple[float, float], ...]:
    """The intervals of time (M,) in which all instants are inside."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], inside, [False])).astype(int)))
    return tuple(
        (float(time[first]), float(time[last - 1]))
        for first, last in zip(edges[::2], edges[1::2], strict=True)
    )


def range_html(variable: str, low: float, high: float, inside: Bools) -> str:
    """A sentence on the highlighted range."""
    if not len(inside):
        return ""
    share = float(np.mean(inside))
    return (
        f'<div class="fv fv-dim">{escape(variable)} from {number(low, 3)} to {number(high, 3)} '
        f"{UNITS[variable]}: {100 * share:.0f} % of the time in this group, orange in the plot over time and "
        "on the robot's path.</div>"
    )


def groups_html(
    errors: PredictionErrors | Step | None, joint: int, name: str, spread: Sequence[float] = ()
) -> str:
    """The error of a joint in every group."""
    if errors is None or not errors.groups:
        return ""
    cells = []
    for group in errors.groups[:MAX_GROUPS]:
        one = JointErrors(group.rms, spread, errors.noise_floor, errors.units)
        tip = f'class="fv-joint fv-tip" title="{error_hover(one, joint)}"'
        cells.append(f"<span {tip}>{escape(group.name)} <b>{number(one.of(joint), 3)}</b></span>")
    unit = stated_errors(errors, spread).unit
    return f'<div class="fv">Error of {escape(name)} [{unit}]: {", ".join(cells)}.</div>'
