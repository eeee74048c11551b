"""Plots on the page: a `view.plots.Plot` as a uPlot chart that is updated in place."""

from __future__ import annotations

from typing import Any

import viser

from flexviz.charts import COLOURS, LEVELS, Plot
from flexviz.wording import escape

SHADE = f"{COLOURS.playhead}40"


class UplotChart:
    """One chart; `show` brings it to a new plot by sending only what changed."""

    def __init__(self, server: viser.ViserServer, plot: Plot) -> None:
        self._server = server
        self._plot = plot
        self._handle = server.gui.add_uplot(
            plot.data(),
            series=_series(plot),  # type: ignore[arg-type]
            title=plot.title,
            scales=_scales(plot),  # type: ignore[arg-type]
            axes=_axes(plot),  # type: ignore[arg-type]
            legend={"show": True},  # type: ignore[arg-type]
            cursor={"sync": {"key": "time"}} if plot.playhead is not None else None,  # type: ignore[arg-type]
            height=plot.height,
            padding=(10, 14, 0, 0),
            bands=_bands(plot),  # type: ignore[arg-type]
        )

    def show(self, plot: Plot) -> None:
        """Draw this plot instead of the one before."""
        before, self._plot = self._plot, plot
        with self._server.atomic():
            if _look(before) != _look(plot):
                self._handle.series = _series(plot)  # type: ignore[assignment]
                self._handle.scales = _scales(plot)  # type: ignore[assignment]
                self._handle.axes = _axes(plot)  # type: ignore[assignment]
                self._handle.bands = _bands(plot)  # type: ignore[assignment]
            if before.title != plot.title:
                self._handle.title = plot.title
            self._handle.data = plot.data()

    def visible(self, on: bool) -> None:
        """Show or hide the chart."""
        self._handle.visible = on

    def move(self, time: float) -> None:
        """Move the playhead [s]; nothing is sent for a plot without one or when it stays where it is."""
        moved = self._plot.at(time)
        if moved is self._plot or moved.playhead is None or self._plot.playhead is None:
            return
        if moved.playhead.argmax() == self._plot.playhead.argmax() and self._plot.playhead.any():
            return
        self._plot = moved
        self._handle.data = moved.data()


class ChartColumn:
    """The charts of one tab, by key; charts appear when first shown and are hidden when no longer given."""

    def __init__(self, server: viser.ViserServer, tab: Any) -> None:
        self._server = server
        self.folder = tab  # what holds the charts
        self._charts: dict[str, UplotChart] = {}
        with tab:
            self._notes = server.gui.add_html("")

    def show(self, plots: tuple[Plot, ...]) -> None:
        """Bring the tab to these plots; one without lines is only its note."""
        notes = "".join(f'<div class="fv fv-dim">{escape(plot.note)}</div>' for plot in plots if plot.note)
        self._notes.content = notes
        drawn = [plot for plot in plots if plot.lines]
        for key, chart in self._charts.items():
            chart.visible(any(plot.key == key for plot in drawn))
        for plot in drawn:
            chart = self._charts.get(plot.key)
            if chart is None:
                with self.folder:
                    self._charts[plot.key] = UplotChart(self._server, plot)
            else:
                chart.show(plot)

    def move(self, time: float) -> None:
        """Move every playhead [s]."""
        with self._server.atomic():
            for chart in self._charts.values():
                chart.move(time)


def _look(plot: Plot) -> tuple[Any, ...]:
    lines = tuple((line.label, line.colour, line.width, line.dashed, line.points) for line in plot.lines)
    extra = plot.playhead is not None, plot.mark is not None, plot.shade is not None, plot.whole_x
    return lines, extra, plot.bands, plot.logarithmic, plot.logarithmic_x, plot.x_label, plot.span, plot.range


def _series(plot: Plot) -> tuple[dict[str, Any], ...]:
    series: list[dict[str, Any]] = [{"label": plot.x_label}]
    for line in plot.lines:
        entry: dict[str, Any] = {
            "label": line.label,
            "stroke": line.colour,
            "width": line.width,
            "scale": "y",
        }
        if line.dashed:
            entry["dash"] = [6, 4]
        entry["points"] = {"show": line.points, "size": 5, "fill": line.colour}
        series.append(entry)
    if plot.shade is not None:
        series.append(
            {"label": "chosen", "fill": SHADE, "width": 0, "scale": "now", "points": {"show": False}}
        )
    if plot.mark is not None:
        series.append(
            {
                "label": "least",
                "stroke": COLOURS.playhead,
                "width": 1.5,
                "scale": "now",
                "points": {"show": False},
            }
        )
    if plot.playhead is not None:
        series.append(
            {
                "label": "now",
                "stroke": COLOURS.playhead,
                "width": 1.5,
                "scale": "now",
                "points": {"show": False},
            }
        )
    return tuple(series)


def _scales(plot: Plot) -> dict[str, Any]:
    scales: dict[str, Any] = {
        # of base 10 uPlot would write only the powers of ten at a horizontal axis
        "x": {"time": False} | _scale(plot.logarithmic_x, plot.span, base=2),
        "y": _scale(plot.logarithmic, plot.range),
    }
    if plot.playhead is not None or plot.mark is not None or plot.shade is not None:
        # its zeros lie below the chart; its top is as high as what is drawn (see `Plot.at`)
        top = {"pad": 0, "soft": min(LEVELS), "mode": 1}
        scales["now"] = {"range": {"min": {"pad": 0, "hard": 0.02}, "max": top}}
    return scales


def _scale(logarithmic: bool, limits: tuple[float, float] | None, base: int = 10) -> dict[str, Any]:
    scale: dict[str, Any] = {"distr": 3, "log": base} if logarithmic else {}
    return scale if limits is None else scale | {"range": limits}


def _axes(plot: Plot) -> tuple[dict[str, Any], ...]:
    x: dict[str, Any] = {"scale": "x", "size": 42, "space": 60}
    if plot.whole_x:
        x |= {"incrs": [1, 2, 5, 10, 20, 50], "space": 30}
    return (x, {"scale": "y", "size": 58})


def _bands(plot: Plot) -> tuple[dict[str, Any], ...] | None:
    fill = f"{COLOURS.reference}40"
    return tuple({"series": [high + 1, low + 1], "fill": fill} for high, low in plot.bands) or None
