"""The plots in the right dock. Charts are updated only when their content changes."""

from __future__ import annotations

from flexviz.app.change import Changed
from flexviz.app.page import Page
from flexviz.app.residual_tab import ResidualTab
from flexviz.app.store import Store
from flexviz.app.uplot import ChartColumn
from flexviz.view import (
    convergence_charts,
    observer_for,
    signals_charts,
    staircase_charts,
    staircase_html,
    states_charts,
)

RIGHT_WIDTH = 430  # [pixels]


class PlotPanel:
    """Signals, States, Convergence, Where it fails, Compare."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store = store
        panel = page.gui.add_panel()
        self._signals, self._states, self._convergence = (
            ChartColumn(page.server, panel.add_tab(label)) for label in ("Signals", "States", "Convergence")
        )
        self.residuals = ResidualTab(store, page, panel.add_tab("Where it fails"))
        compare = panel.add_tab("Compare")
        self._compare = ChartColumn(page.server, compare)
        with compare:
            self._steps = page.gui.add_html("")
        panel.dock_right()
        panel.set_width(RIGHT_WIDTH)
        self._stale = False  # some iterations are not drawn yet
        selected = Changed.OPENED | Changed.JOINT | Changed.GROUP
        store.subscribe(selected | Changed.OBSERVER, self._draw_states)
        store.subscribe(selected | Changed.RESULT | Changed.DERIVED, self._draw_signals)
        store.subscribe(selected | Changed.RESULT | Changed.DIAGNOSIS, self._draw_compare)
        store.subscribe(Changed.OPENED | Changed.FIT, self._iterated)
        store.subscribe(
            Changed.OPENED | Changed.RESULT | Changed.ACTIVITY | Changed.TICK, self._draw_convergence
        )
        store.subscribe(Changed.TICK, self._move)

    def _draw_states(self) -> None:
        """Draw the observer states of the selected joint and group."""
        store, analysis = self._store, self._store.analysis
        observer = observer_for(analysis.observer, analysis.bandwidth, store.joint)
        hold, now = store.measurements.torque_hold, store.clock.time
        self._states.show(states_charts(store.group, store.joint, observer, hold, now))

    def _draw_signals(self) -> None:
        """Draw torque, residual and error of the selected joint and group."""
        store, result = self._store, self._store.analysis.identification
        self._signals.show(signals_charts(store.group, store.joint, store.joint_name, result, store.motion))
        self._signals.move(store.clock.time)

    def _draw_compare(self) -> None:
        """Draw the error after every model step."""
        store, models = self._store, self._store.analysis.model_steps
        self._compare.show(staircase_charts(models, store.joint, store.joint_name))
        self._steps.content = staircase_html(models)

    def _iterated(self) -> None:
        self._stale = True

    def _draw_convergence(self) -> None:
        """Draw the solver's iterations, at most once per tick."""
        if self._stale:
            self._stale = False
            self._convergence.show(convergence_charts(self._store.fit.iterations))

    def _move(self) -> None:
        """Move the playheads."""
        self._signals.move(self._store.clock.time)
