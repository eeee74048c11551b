"""Renderer-independent chart description for app, report, recording and documentation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.base.units import joint_unit

Dash = tuple[int, ...]
MAX_POINTS = 600  # of a drawn line
SOLID: Dash = ()
DASHES: tuple[Dash, ...] = (SOLID, (7, 4), (2, 3), (8, 3, 2, 3))
DASHED = DASHES[1]


@dataclass(frozen=True)
class ChartAxis:
    """One axis of a chart.

    Attributes:
        label: the quantity; empty if the title names it.
        unit: empty for counts.
        limits: (lowest, highest); None: from the data.
        ticks: (value, text) of named positions.
        whole: integer values only.
    """

    label: str = ""
    unit: str = ""
    logarithmic: bool = False
    limits: tuple[float, float] | None = None
    ticks: tuple[tuple[float, str], ...] = ()
    whole: bool = False

    @property
    def text(self) -> str:
        """Label and unit: "time [s]"."""
        return f"{self.label} [{self.unit}]".strip() if self.unit else self.label


TIME = ChartAxis("time", "s")


@dataclass(frozen=True, eq=False)
class ChartSeries:
    """A line through x and y, each of shape (N,); a NaN interrupts it.

    Attributes:
        dash: one of DASHES, so that lines can be distinguished without colour.
        points: mark every sample.
        steps: hold each value from x − 0.5 to x + 0.5.
    """

    label: str
    colour: str
    x: Array
    y: Array
    width: float = 1.5
    dash: Dash = SOLID
    points: bool = False
    steps: bool = False

    def path(self) -> tuple[Array, Array]:
        """x and y of the drawn line: the corners of the steps, or the samples."""
        if not self.steps:
            return self.x, self.y
        return np.repeat(self.x, 2) + np.tile([-0.5, 0.5], len(self.x)), np.repeat(self.y, 2)


@dataclass(frozen=True, eq=False)
class Ribbon:
    """The area between low and high, each of shape (N,) at x: an interval around a line or zero.

    Without a label it is not in the legend.
    """

    label: str
    colour: str
    x: Array
    low: Array
    high: Array


@dataclass(frozen=True)
class ShadedStage:
    """A shaded interval of x with a name."""

    name: str
    first: float
    last: float

    def inside(self, x: Array) -> Bools:
        """Which points x (N,) it holds; of two at one end only the inner one."""
        inside = (x > self.first) & (x < self.last)
        for ends, pick in ((np.flatnonzero(x == self.first), -1), (np.flatnonzero(x == self.last), 0)):
            inside[ends[pick : pick + 1 or None]] = True
        return inside


@dataclass(frozen=True, eq=False)
class Chart:
    """A line chart with ribbons behind the lines.

    Attributes:
        key: name within its tab or page; a chart with the same key replaces it.
        title: without the unit of y.
        description: caption and alternative text.
        note: the reason for an empty chart, or a remark on it.
        highlights: highlighted intervals of x; None: the chart has no highlights.
        marker: x of a vertical line, called `marked`.
        stages: shaded intervals of x with their names.
        playhead: show the playback time on x, which is then time.
        height: [px].
    """

    key: str
    title: str
    x: ChartAxis = TIME
    y: ChartAxis = field(default_factory=ChartAxis)
    series: tuple[ChartSeries, ...] = ()
    ribbons: tuple[Ribbon, ...] = ()
    description: str = ""
    note: str = ""
    highlights: tuple[tuple[float, float], ...] | None = None
    marker: float | None = None
    marked: str = "least"
    stages: tuple[ShadedStage, ...] = ()
    playhead: bool = False
    height: int = 190

    @property
    def heading(self) -> str:
        """Title with the unit of y, for renderers without a label of that axis."""
        return f"{self.title} [{self.y.unit}]" if self.y.unit else self.title

    def of_joint(self, slides: bool) -> Chart:
        """The chart with the units of a joint that slides or turns, from those of one that turns."""
        x, y = (replace(axis, unit=joint_unit(axis.unit, slides)) for axis in (self.x, self.y))
        return replace(self, x=x, y=y)

    def spans(self, first: float, last: float) -> Chart:
        """The chart with x limited to `first` … `last`."""
        return replace(self, x=replace(self.x, limits=(float(first), float(last))))


def no_chart(key: str, note: str = "") -> Chart:
    """An empty chart with the reason."""
    return Chart(key, "", note=note)


PREFIXES = ((1.0, ""), (1e3, "m"), (1e6, "µ"))


def time_chart(
    key: str,
    title: str,
    unit: str,
    time: Array,
    lines: Sequence[tuple[str, str, Array]],
    *,
    height: int = 190,
) -> Chart:
    """A downsampled chart over time with a playhead; lines are (label, colour, values), later ones thinner.

    Small values get the prefix m or µ, because axes show at most three decimals.
    """
    x, columns = thin(time, [values for _, _, values in lines])
    largest = max((float(np.abs(column).max(initial=0.0)) for column in columns), default=0.0)
    fallback = PREFIXES[0 if largest == 0 else -1]
    factor, prefix = next(((f, p) for f, p in PREFIXES if largest * f >= 0.1), fallback)
    widths = (2.6, 1.3) if len(lines) > 1 else (1.5,)
    series = tuple(
        ChartSeries(label, colour, x, factor * column, widths[min(i, len(widths) - 1)])
        for i, ((label, colour, _), column) in enumerate(zip(lines, columns, strict=True))
    )
    y = ChartAxis(unit=f"{prefix}{unit}")
    return Chart(key, title, y=y, series=series, playhead=True, height=height)


def thin(x: Array, columns: Sequence[Array], points: int = MAX_POINTS) -> tuple[Array, list[Array]]:
    """Min–max downsampling to at most `points` values per column; NaN and ±inf are replaced.

    x is (N,) increasing, each column (N,). Each bucket of samples gives the column's minimum and maximum in
    their order of occurrence.
    """
    columns = [finite(column) for column in columns]
    count = len(x)
    if count <= points:
        return np.asarray(x, dtype=float), columns
    size = -(-count // (points // 2))  # samples per bucket
    buckets = -(-count // size)
    starts = np.arange(buckets) * size
    out_x = np.empty(2 * buckets)
    out_x[0::2], out_x[1::2] = x[starts], x[np.minimum(starts + size // 2, count - 1)]
    out: list[Array] = []
    for column in columns:
        full = np.concatenate((column, np.full(buckets * size - count, column[-1]))).reshape(buckets, size)
        extremes = np.sort(np.stack((full.argmin(axis=1), full.argmax(axis=1)), axis=1), axis=1)
        out.append(np.take_along_axis(full, extremes, axis=1).ravel())
    return out_x, out


def finite(column: Array) -> Array:
    """The column with NaN and infinities replaced by the preceding finite value, or 0 at the start."""
    column = np.asarray(column, dtype=float)
    good = np.isfinite(column)
    if good.all():
        return column
    index = np.maximum.accumulate(np.where(good, np.arange(len(column)), -1))
    return np.where(index >= 0, column[index], 0.0)
