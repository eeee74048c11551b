"""The tab "Where it fails": map, residual against every variable, and a range that is shown everywhere."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flexviz.app.charts import ChartColumn
from flexviz.app.controls import watch
from flexviz.view import (
    VARIABLES,
    ResidualSamples,
    free_html,
    free_plot,
    groups_html,
    map_html,
    map_of,
    map_plots,
    range_html,
    shaded,
    time_residual,
)

if TYPE_CHECKING:
    from flexviz.app.application import Application

STEPS = 200  # of the range slider
OFF = "nothing"


class WhereTab:
    """Only the loop's thread calls it."""

    def __init__(self, app: Application, tab: Any) -> None:
        self._app = app
        self._of: tuple[Any, int] | None = None  # the result and the joint the samples belong to
        self._samples: ResidualSamples | None = None
        gui = app.server.gui
        with tab:
            self._map = gui.add_html("")
            self._groups = gui.add_html("")
            self._stopgap = gui.add_html("")
            self._variable: Any = gui.add_dropdown(
                "Highlight", (OFF, *VARIABLES), initial_value=OFF, visible=False,
                hint="where this variable is in the range, the instants are marked in time and on the robot",
            )  # fmt: skip
            self._range: Any = gui.add_multi_slider("Range", 0.0, 1.0, 1.0 / STEPS, (0.0, 1.0), visible=False)
            self._about = gui.add_html("")
        self._charts = ChartColumn(app.server, tab)
        watch(self._variable, app.queue, "highlight")
        watch(self._range, app.queue, "range")
        app.on("highlight", self._chosen)
        app.on("range", lambda _: self.show())

    def opened(self) -> None:
        """A new set is shown."""
        self._variable.value = OFF

    def show(self) -> None:
        """Draw the present result for the selected joint and group."""
        app = self._app
        result, joint = app.session.analysis.identification, app.show.joint
        if self._of is None or self._of[0] is not result or self._of[1] != joint:
            self._samples, self._of = ResidualSamples.of(result, joint), (result, joint)
        name = app.measurements.joints[joint]
        maps = app.show.maps
        self._map.content = map_html(maps, app.measurements.joints, joint)
        self._groups.content = groups_html(self._samples, name)
        self._variable.visible = self._samples is not None
        residual = time_residual(self._samples, name, app.show.group.name)
        found = self._instants()
        self._range.visible = found is not None
        if found is None:
            app.show.scene.mark(None)
        else:
            time, inside = found
            if residual.shade is not None:
                residual = replace(residual, shade=shaded(residual, time, inside))
            app.show.scene.mark(app.show.marked(time, inside))
        curve = app.show.free_curve
        self._stopgap.content = free_html(curve)
        self._charts.show((free_plot(curve), residual, *map_plots(maps, name)))
        self.move(app.show.clock.time)

    def move(self, time: float) -> None:
        """Move the playhead [s]."""
        self._charts.move(time)

    def _instants(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Times and whether each is in the chosen range; None where nothing is to be highlighted."""
        key = self._variable.value
        if self._samples is None or self._samples.limits(key) is None:
            self._about.content = ""
            return None
        low, high = self._range.value
        time, inside = self._samples.instants(key, low, high, self._app.show.group.name)
        self._about.content = range_html(key, low, high, inside)
        return time, inside

    def _chosen(self, key: str) -> None:
        ends = None if self._samples is None else self._samples.limits(key)
        if ends is not None:
            low, high = ends
            low, high = float(f"{low:.6g}"), float(f"{high:.6g}")
            self._range.min, self._range.max, self._range.step = low, high, (high - low) / STEPS
            self._range.value = self._first_range(key, low, high)
        self.show()

    def _first_range(self, key: str, low: float, high: float) -> tuple[float, float]:
        """Where the residual lives along a variable; the highest quarter where that is not known."""
        show = self._app.show
        one = map_of(show.maps, self._app.measurements.joints[show.joint], key)
        if one is None or not low <= one.range[0] < one.range[1] <= high:
            return low + 0.75 * (high - low), high
        first, last = one.range
        return float(f"{first:.4g}"), float(f"{last:.4g}")
