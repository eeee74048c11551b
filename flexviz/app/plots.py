"""The right dock's tabs of plots. A tab's charts change only when what they show does."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flexviz.app.charts import ChartColumn
from flexviz.app.where_tab import WhereTab
from flexviz.view import (
    convergence_plots,
    observer_for,
    signals_plots,
    staircase_html,
    staircase_plots,
    states_plots,
)

if TYPE_CHECKING:
    from flexviz.app.application import Application

RIGHT = 430  # [pixels]


class PlotPanel:
    """Signals, States, Convergence, Where it fails, Compare."""

    def __init__(self, app: Application) -> None:
        self._app = app
        gui = app.server.gui
        panel = gui.add_panel()
        self._signals, self._states, self._convergence = (
            ChartColumn(app.server, panel.add_tab(label)) for label in ("Signals", "States", "Convergence")
        )
        self.where = WhereTab(app, panel.add_tab("Where it fails"))
        compare = panel.add_tab("Compare")
        self._compare = ChartColumn(app.server, compare)
        with compare:
            self._steps = gui.add_html("")
        panel.dock_right()
        panel.set_width(RIGHT)

    def show_signals(self) -> None:
        """Torque, residual, error of the selected joint in the selected group."""
        show, result = self._app.show, self._app.session.analysis.identification
        name = self._app.measurements.joints[show.joint]
        self._signals.show(signals_plots(show.group, show.joint, name, result, show.motion))
        self.move(show.clock.time)

    def show_states(self) -> None:
        """The observer's states of the selected joint in the selected group."""
        show, analysis = self._app.show, self._app.session.analysis
        observer = observer_for(analysis.observer, analysis.bandwidth, show.joint)
        hold, now = self._app.measurements.torque_hold, show.clock.time
        self._states.show(states_plots(show.group, show.joint, observer, hold, now))

    def show_convergence(self, iterations: list[Any]) -> None:
        """The solver's way."""
        self._convergence.show(convergence_plots(iterations))

    def show_compare(self) -> None:
        """The staircase of errors."""
        app = self._app
        model_steps = app.session.analysis.model_steps
        joint = app.show.joint
        self._compare.show(staircase_plots(model_steps, joint, app.measurements.joints[joint]))
        self._steps.content = staircase_html(model_steps)

    def move(self, time: float) -> None:
        """Move the playheads [s]."""
        self._signals.move(time)
        self.where.move(time)
