"""Charts on the page: a `charts.Chart` as a uPlot that is updated in place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import viser

from flexviz.base.arrays import Array
from flexviz.content.charts import COLOURS, TIME, Chart, ChartAxis
from flexviz.content.wording import escape
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import put
from flexviz.outlets.app.viser_private import put_together

LEVELS = (1.0, 0.95)  # of a playhead, by turns (see `UplotChart.move`)
TINT, FAINT = "40", "20"  # opacity of areas; of those without a label, which are many
HIGHLIGHT = f"{COLOURS.playhead}{TINT}"
SHADES = (COLOURS.reference, *COLOURS.series)  # of the stages, in turn
RIBBON_WIDTH = 0.8  # [pixels] of its edges
FLAGS = {"scale": "now", "points": {"show": False}}  # series of zeros and ones on a scale of their own


class UplotChart:
    """One chart; `show` sends its data, and its look only if that has changed."""

    def __init__(self, server: viser.ViserServer, chart: Chart, order: float) -> None:
        self._chart = chart
        self._columns = columns(chart)
        self._look = _look(chart, self._columns[0])
        self._at: int | None = None  # row of the playhead
        self._level = LEVELS[0]
        self._handle = server.gui.add_uplot(
            self._data(),
            title=chart.heading,
            legend={"show": True},  # type: ignore[arg-type]
            cursor={"sync": {"key": "time"}} if chart.x.text == TIME.text else None,  # type: ignore[arg-type]
            height=chart.height,
            order=order,
            padding=(10, 14, 0, 0),
            **self._look,
        )

    def show(self, chart: Chart, drawn: tuple[Array, ...]) -> None:
        """Replace the chart, whose columns are `drawn`."""
        before, self._chart = self._chart, chart
        self._columns, self._at, self._level = drawn, None, LEVELS[0]
        look, self._look = self._look, _look(chart, drawn[0])
        if (before.heading, look) != (chart.heading, self._look):
            put_together(self._handle, **self._look, title=chart.heading, data=self._data())
        self._handle.data = self._data()  # always the last: earlier data do not fit into a later look

    def visible(self, on: bool) -> None:
        put(self._handle, visible=on)

    def move(self, time: float) -> None:
        """Move the playhead to `time` [s], if it changes.

        The level alternates, and with it the scale: uPlot lays out the axes of a chart whose data change
        while it is resized only if a scale changes, too.
        """
        if not self._chart.playhead:
            return
        at = nearest(self._columns[0], time)
        if at != self._at:
            self._at, self._level = at, LEVELS[self._level == LEVELS[0]]
            self._handle.data = self._data()

    def _data(self) -> tuple[Array, ...]:
        if not self._chart.playhead:
            return self._columns
        now = np.zeros(len(self._columns[0]))
        if self._at is not None:
            now[self._at] = self._level
        return (*self._columns, now)


class ChartColumn:
    """The charts of one tab, by key; charts that are no longer given are hidden."""

    def __init__(self, server: viser.ViserServer, tab: Any) -> None:
        self._server = server
        self.folder = tab  # what holds the charts
        self.button: Any = None  # shown while there is a chart
        self._charts: dict[str, UplotChart] = {}
        self.shown: tuple[Chart, ...] = ()  # as given last
        with tab:
            self._notes = ExplainedHtml(server.gui)

    def show(self, charts: tuple[Chart, ...]) -> None:
        """Show these charts; a chart without series shows only its note."""
        self.shown = charts
        notes = "".join(f'<div class="fv fv-dim">{escape(c.note)}</div>' for c in charts if c.note)
        drawn = {chart.key: (chart, table) for chart in charts if chart.series
                 and len((table := columns(chart))[0]) > 1}  # fmt: skip
        with self._server.atomic():
            put(self._notes, content=notes)
            if self.button is not None:
                put(self.button, visible=bool(drawn))
            for key, shown in self._charts.items():
                shown.visible(key in drawn)
            for key, (chart, table) in drawn.items():
                if key in self._charts:
                    self._charts[key].show(chart, table)
                else:
                    place = self._notes.order + 1e-3 * (1 + [one.key for one in charts].index(key))
                    with self.folder:
                        self._charts[key] = UplotChart(self._server, chart, place)

    def update(self, chart: Chart) -> None:
        """Draw one of the shown charts anew."""
        if chart.series and chart.key in self._charts and chart.key in [one.key for one in self.shown]:
            self.shown = tuple(chart if one.key == chart.key else one for one in self.shown)
            self._charts[chart.key].show(chart, columns(chart))

    def move(self, time: float) -> None:
        """Move every playhead [s]."""
        with self._server.atomic():
            for chart in self._charts.values():
                chart.move(time)


def columns(chart: Chart) -> tuple[Array, ...]:
    """x, every series, both edges of every ribbon, highlights and marker, each (M,).

    Where all share x, rows with NaN are omitted, because a single one would blank a chart without limits.
    Otherwise x are all of theirs: points are NaN between them, lines and edges are interpolated.
    """
    paths = [(*series.path(), series.points) for series in chart.series]
    paths += [(one.x, edge, False) for one in chart.ribbons for edge in (one.high, one.low)]
    if all(np.array_equal(x, paths[0][0]) for x, *_ in paths):
        table = np.stack([paths[0][0], *(y for _, y, _ in paths)]).astype(float)
        table = table[:, np.isfinite(table).all(axis=0)]
    else:
        table = _on_one_axis(paths)
    if chart.marker is not None and table.shape[1]:  # three rows with one x are a vertical line
        at = nearest(table[0], chart.marker)
        table = np.insert(table, [at, at], table[:, [at]], axis=1)
    x, flags = table[0], []
    if chart.highlights is not None:
        inside = [(x >= first) & (x <= last) for first, last in chart.highlights]
        flags.append(np.any([np.zeros(len(x), bool), *inside], axis=0).astype(float))
    if chart.marker is not None:
        flags.append((np.arange(len(x)) == nearest(x, chart.marker) + 1).astype(float))
    flags += [stage.inside(x).astype(float) for stage in chart.stages]
    return tuple(np.ascontiguousarray(column) for column in (*table, *flags))


def _on_one_axis(paths: Sequence[tuple[Array, Array, bool]]) -> Array:
    """The union of all x, then each column on it; entries are x, y, whether only its points are drawn."""
    union = np.unique(np.concatenate([x for x, _, _ in paths]))
    rows = [union]
    for x, y, points in paths:
        inside = (union >= x[0]) & (union <= x[-1])
        kept = np.isin(union, x) if points else inside
        rows.append(np.where(kept, np.interp(union, x, y), np.nan))
    return np.array(rows)


def nearest(x: Array, value: float) -> int:
    """Index of the value in x (M,) nearest to `value`; 0 if x is empty."""
    return int(np.argmin(np.abs(x - value))) if len(x) else 0


def _look(chart: Chart, drawn: Array) -> dict[str, Any]:
    """All options of a uPlot at `drawn` (M,) except data, title and size."""
    x: dict[str, Any] = {"scale": "x", "size": 42, "space": 60}
    if chart.x.whole:
        x |= {"incrs": [1, 2, 5, 10, 20, 50], "space": 30}
    y: dict[str, Any] = {"scale": "y", "size": 58, "space": 20}
    if chart.y.logarithmic:  # over many decades the marks and grid lines would be solid blocks
        y |= {"ticks": {"show": False}, "grid": {"width": 0.5}, "size": 70}  # holds "1,000,000"
    first = 1 + len(chart.series)  # of the ribbons' edges
    bands = [
        {
            "series": [first + 2 * i, first + 2 * i + 1],
            "fill": f"{ribbon.colour}{TINT if ribbon.label else FAINT}",
        }
        for i, ribbon in enumerate(chart.ribbons)
    ]
    return {
        "series": _series(chart),
        "scales": _scales(chart, drawn),
        "axes": (x, y),
        "bands": tuple(bands) or None,
    }


def _series(chart: Chart) -> tuple[dict[str, Any], ...]:
    entries: list[dict[str, Any]] = [{"label": chart.x.text}]
    for series in chart.series:
        entry = {"label": series.label, "stroke": series.colour, "width": series.width, "scale": "y"}
        if series.dash:
            entry["dash"] = list(series.dash)
        entries.append(entry | {"points": {"show": series.points, "size": 5, "fill": series.colour}})
    for ribbon in chart.ribbons:
        edge = {"stroke": ribbon.colour, "width": RIBBON_WIDTH, "scale": "y", "points": {"show": False}}
        unnamed = edge | {"label": "", "class": "fv-edge"}  # not in the legend
        entries += [edge | {"label": ribbon.label} if ribbon.label else unnamed, unnamed]
    line = {"stroke": COLOURS.playhead, "width": 1.5, **FLAGS}
    if chart.highlights is not None:
        entries.append({"label": "highlighted", "fill": HIGHLIGHT, "width": 0, **FLAGS})
    if chart.marker is not None:
        entries.append({"label": chart.marked, **line})
    for number, stage in enumerate(chart.stages):
        fill = f"{SHADES[number % len(SHADES)]}30"
        entries.append({"label": stage.name, "fill": fill, "width": 0, **FLAGS})
    if chart.playhead:
        entries.append({"label": "now", **line})
    return tuple(entries)


def _scales(chart: Chart, drawn: Array) -> dict[str, Any]:
    x = chart.x
    if x.limits is None and x.text != TIME.text and not x.whole and not x.logarithmic and len(drawn):
        # the page keeps the range of a chart that is built anew with other data, such as another joint's
        x = replace(x, limits=(float(drawn.min()), float(drawn.max())))
    # of base 10 uPlot would write only the powers of ten at a horizontal axis
    scales: dict[str, Any] = {"x": {"time": False} | _scale(x, base=2), "y": _scale(chart.y, base=10)}
    if chart.playhead or chart.marker is not None or chart.highlights is not None or chart.stages:
        # its zeros lie below the chart; its top is as high as what is drawn (see `UplotChart.move`)
        top = {"pad": 0, "soft": min(LEVELS), "mode": 1}
        scales["now"] = {"range": {"min": {"pad": 0, "hard": 0.02}, "max": top}}
    return scales


def _scale(axis: ChartAxis, base: int) -> dict[str, Any]:
    scale: dict[str, Any] = {"distr": 3, "log": base} if axis.logarithmic else {}
    return scale if axis.limits is None else scale | {"range": axis.limits}
