"""A plot as data: lines on one common x, thinned to what a screen can show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
POINTS = 600  # points a line may have
LEVELS = (1.0, 0.95)  # of a playhead, by turns


@dataclass(frozen=True, eq=False)
class Line:
    """One line of a plot: `values` (M,) at the plot's x."""

    label: str
    colour: str
    values: Array
    width: float = 1.5
    dashed: bool = False
    points: bool = False


@dataclass(frozen=True, eq=False)
class Plot:
    """One chart.

    Attributes
    ----------
    key: name within its tab; the same key is the same chart, updated.
    title: what it shows, with the unit.
    x: (M,) common abscissa.
    lines: the lines, finite everywhere (one NaN would blank the whole chart).
    x_label: the abscissa's name with its unit.
    logarithmic: True for a logarithmic ordinate (all values are then positive).
    logarithmic_x: the same for the abscissa, which then counts in doublings of span's first value.
    playhead: (M,) 0/1 line of the present instant, or None for a plot that does not run in time.
    height: [pixels].
    note: why the plot is empty, or what to know about it.
    span: (first, last) x of the axis, so that the plots of a tab agree; None where the data decide.
    range: (lowest, highest) value of the ordinate; None where the data decide.
    mark: (M,) 0/1 line at what is worth a look, or None.
    bands: pairs of lines (their index) between which the chart is filled.
    shade: (M,) 0/1: the stretches of x that are highlighted, or None.
    whole_x: True where x counts, so that the axis shows whole numbers only.
    level: how high playhead, mark and shade are drawn on their own scale, whose top it is.
    """

    key: str
    title: str
    x: Array
    lines: tuple[Line, ...]
    x_label: str = "time [s]"
    logarithmic: bool = False
    playhead: Array | None = None
    height: int = 190
    note: str = ""
    span: tuple[float, float] | None = None
    logarithmic_x: bool = False
    range: tuple[float, float] | None = None
    mark: Array | None = None
    bands: tuple[tuple[int, int], ...] = ()
    shade: Array | None = None
    whole_x: bool = False
    level: float = 1.0

    def data(self) -> tuple[Array, ...]:
        """x and every line, as the chart wants them; shade, mark and playhead come last."""
        columns = [self.x, *(line.values for line in self.lines)]
        flags = (self.shade, self.mark, self.playhead)
        columns += [self.level * flag for flag in flags if flag is not None]
        return tuple(np.ascontiguousarray(column, dtype=float) for column in columns)

    def at(self, time: float) -> Plot:
        """The same plot with its playhead at `time` (nothing changes in a plot without one).

        The level changes with every move, and with it the scale's top: a chart whose data change in the
        moment in which it gets its width sets out its axes only where a scale changes too.
        """
        if self.playhead is None:
            return self
        level = LEVELS[self.level == LEVELS[0]]
        return replace(self, playhead=playhead(self.x, time), level=level)


def thin(
    x: Array, columns: Sequence[Array], points: int = POINTS, window: tuple[float, float] | None = None
) -> tuple[Array, list[Array]]:
    """At most `points` values of each column that keep its minima and maxima; NaN and ±inf are replaced.

    x is (N,) increasing, each column (N,). Buckets of samples give two points each: the column's minimum and
    maximum in the order in which they occur.
    """
    if window is not None:
        keep = (x >= window[0]) & (x <= window[1])
        x, columns = x[keep], [column[keep] for column in columns]
    columns = [finite(column) for column in columns]
    count = len(x)
    if count <= points:
        return np.asarray(x, dtype=float), columns
    size = -(-count // (points // 2))  # samples a bucket
    whole = count // size * size
    buckets = whole // size + (count > whole)
    starts = np.arange(buckets) * size
    middles = np.minimum(starts + size // 2, count - 1)
    out_x = np.empty(2 * buckets)
    out_x[0::2], out_x[1::2] = x[starts], x[middles]
    out: list[Array] = []
    for column in columns:
        full = np.concatenate((column, np.full(buckets * size - count, column[-1]))).reshape(buckets, size)
        low, high = full.argmin(axis=1), full.argmax(axis=1)
        rows = np.arange(buckets)
        first, second = np.minimum(low, high), np.maximum(low, high)
        values = np.empty(2 * buckets)
        values[0::2], values[1::2] = full[rows, first], full[rows, second]
        out.append(values)
    return out_x, out


def finite(column: Array) -> Array:
    """The column with every NaN or infinity replaced by the last finite value before it (0 where none is)."""
    column = np.asarray(column, dtype=float)
    good = np.isfinite(column)
    if good.all():
        return column
    index = np.maximum.accumulate(np.where(good, np.arange(len(column)), -1))
    return np.where(index >= 0, column[index], 0.0)


def playhead(x: Array, time: float) -> Array:
    """0 everywhere and 1 at the sample of x nearest to `time`."""
    line = np.zeros(len(x))
    if len(x):
        right = int(np.clip(np.searchsorted(x, time), 0, len(x) - 1))
        left = max(right - 1, 0)
        line[left if abs(x[left] - time) < abs(x[right] - time) else right] = 1.0
    return line


PREFIXES = ((1.0, ""), (1e3, "m"), (1e6, "µ"))


def time_plot(
    key: str,
    title: str,
    unit: str,
    x: Array,
    lines: Sequence[tuple[str, str, Array]],
    *,
    height: int = 190,
) -> Plot:
    """A plot over time, thinned, with a playhead; lines are (label, colour, values), the later ones thinner.

    Small values are shown in thousandths or millionths of the unit, since an axis has three decimals at most.
    """
    thinned, columns = thin(x, [values for _, _, values in lines])
    largest = max((float(np.abs(column).max(initial=0.0)) for column in columns), default=0.0)
    fallback = PREFIXES[0 if largest == 0 else -1]
    factor, prefix = next(((f, p) for f, p in PREFIXES if largest * f >= 0.1), fallback)
    widths = (2.6, 1.3) if len(lines) > 1 else (1.5,)
    drawn = tuple(
        Line(label, colour, factor * column, widths[min(i, len(widths) - 1)])
        for i, ((label, colour, _), column) in enumerate(zip(lines, columns, strict=True))
    )
    return Plot(
        key, f"{title} [{prefix}{unit}]", thinned, drawn, playhead=np.zeros(len(thinned)), height=height
    )


def aligned(plots: Sequence[Plot], first: float, last: float) -> tuple[Plot, ...]:
    """The plots with the same time axis, from `first` to `last` [s]."""
    return tuple(replace(plot, span=(float(first), float(last))) for plot in plots)


def no_plot(key: str, note: str) -> Plot:
    """Nothing to draw yet, and why."""
    return Plot(key, "", np.zeros(0), (), note=note)
