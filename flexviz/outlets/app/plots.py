"""The plots in the right dock. Charts are updated only when their content changes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Any

from flexviz.analysis.identification import Identification
from flexviz.base.errors import InputError
from flexviz.content import view
from flexviz.content.charts import PICTURE, Chart, chart_name, charts_zip, draw_svg
from flexviz.content.records import stated_errors
from flexviz.content.rendering import panel
from flexviz.content.session import runs, standing
from flexviz.content.topics import map_panel
from flexviz.model.observers import EsoGains
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.fleet import FleetTab
from flexviz.outlets.app.page import Page, put
from flexviz.outlets.app.page_script import PICTURE_LABEL
from flexviz.outlets.app.residual_axis import ResidualAxis, before_after, signal_of
from flexviz.outlets.app.state import Changed, Highlight
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.style import hidden
from flexviz.outlets.app.tab_turns import COMPARE, CONVERGENCE, PROOF, STATES
from flexviz.outlets.app.uplot import ChartColumn
from flexviz.outlets.batch import FleetRow

RIGHT_WIDTH = 430  # [pixels]
STEPS = 200  # of the range slider
OFF = "nothing"


class PlotPanel:
    """Fleet, Signals, States, Convergence, Where it fails, Compare."""

    def __init__(self, store: Store, page: Page, fleet: list[FleetRow]) -> None:
        """`fleet` are the sets of a batch, if one is served."""
        self._store, self._page = store, page
        panel = page.gui.add_panel()
        if fleet:
            FleetTab(store, page, panel.add_tab("Fleet"), fleet)
        signals = panel.add_tab("Signals")
        with signals:
            ResidualAxis(store, page, self._draw_signals)
        self._signals, self._states, self._convergence = (
            ChartColumn(page.server, tab)
            for tab in (signals, panel.add_tab(STATES), panel.add_tab(CONVERGENCE))
        )
        self.residuals = ResidualTab(store, page, panel.add_tab(PROOF))
        compare = panel.add_tab(COMPARE)
        with compare:
            self._steps = ExplainedHtml(page.gui)
            hint = "shows this model everywhere: robot, residual, parameters"
            self._models = page.choose(
                page.gui.add_button_group("Show model", ("0",), visible=False, hint=hint),
                lambda number: store.show_model(self._ends[int(number)]),
            )
            hint = "draws this model next to the shown one, each coloured by its own error"
            self._beside = page.choose(
                page.gui.add_button_group("Compare with", (OFF,), visible=False, hint=hint),
                self._compare_with,
            )
        self._fallen = ChartColumn(page.server, compare)
        self._compare = ChartColumn(page.server, compare)
        columns = (self._signals, self._states, self._convergence, self.residuals.charts, self._compare)
        for name, column in zip(
            ("signals", "states", "convergence", "residuals", "compare"), columns, strict=True
        ):
            with column.folder:
                hint = (
                    "every plot of this tab as SVG and CSV, zipped; a plot's own corner has a button for PNG"
                )
                act = partial(self._save, name, column)
                column.button = page.client_button("Save plots", act, visible=False, hint=hint)
        self._columns = (*columns, self.residuals.laws, self._fallen)
        page.style(hidden, page.client_text(PICTURE_LABEL, self._save_picture))
        panel.dock_right()
        panel.set_width(RIGHT_WIDTH)
        self._compared: object = None  # what the staircase shows
        self._draft: EsoGains | None = None  # gains of the states that are drawn
        self._stale = False  # some iterations are not drawn yet
        selected = Changed.OPENED | Changed.JOINT | Changed.GROUP
        timed = selected | Changed.SPAN
        store.subscribe(timed | Changed.OBSERVER | Changed.RESULT, self._draw_states)
        store.subscribe(timed | Changed.RESULT | Changed.DERIVED, self._draw_signals)
        store.subscribe(Changed.LIVE, self._draw_live)
        store.subscribe(selected | Changed.ANALYSIS | Changed.DERIVED, self._draw_compare)
        fit = Changed.OPENED | Changed.FIT | Changed.RESULT | Changed.DERIVED
        store.subscribe(fit, self._iterated)
        store.subscribe(
            Changed.OPENED | Changed.RESULT | Changed.ACTIVITY | Changed.TICK, self._draw_convergence
        )
        store.subscribe(Changed.TICK, self._move)

    def _save(self, name: str, column: ChartColumn, client: int) -> None:
        """Send the plots of a tab to a browser."""
        if not any(chart.series for chart in column.shown):
            raise InputError("there are no plots in this tab yet")
        self._page.send_file(client, f"{self._store.measurements.name}-{name}.zip", charts_zip(column.shown))

    def _save_picture(self, asked: tuple[int, str]) -> None:
        """Send the plot with this title, after a number, as PNG."""
        client, title = asked[0], asked[1].partition(" ")[2]
        shown = [chart for column in self._columns for chart in column.shown if chart.series]
        found = next((chart for chart in shown if chart.heading == title), None)
        if found is None:
            raise InputError("this plot is not shown any more")
        svg = draw_svg(found, found.key, PICTURE)
        self._page.send_picture(client, svg, title, f"{chart_name(found)}.png")

    def _draw_states(self) -> None:
        store = self._store
        name, bandwidth, gains = store.analysis.used_tuning
        self._draft = None if store.live is None else store.live.draft
        if self._draft is not None:
            bandwidth, gains = None, self._draft
        observer = view.observer_for(name, bandwidth, store.joint, gains)
        hold, now = store.measurements.torque_hold, store.clock.time
        states = view.states_charts(
            store.group, store.joint, observer, hold, now, store.span, signal_of(store)
        )
        self._states.show(self._of_joint(states))

    def _of_joint(self, charts: Iterable[Chart]) -> tuple[Chart, ...]:
        return in_units(self._store, charts)

    def _draw_live(self) -> None:
        """Let the selected joint's residual, and with a draft of gains the states, follow the tuning."""
        store = self._store
        which = store.group, store.joint, store.joint_name
        self._signals.update(*self._of_joint([view.signal_residual(*which, before_after(store), store.span)]))
        self._signals.move(store.clock.time)
        if self._draft != (None if store.live is None else store.live.draft):
            self._draw_states()

    def _draw_signals(self) -> None:
        """Draw torque, residual and error of the selected joint and group."""
        store, result = self._store, self._store.analysis.identification
        which = store.group, store.joint, store.joint_name
        signals = view.signals_charts(*which, before_after(store), store.motion, store.span)
        signals = self._of_joint(signals)
        self._signals.show((*signals, *self._of_joint(view.shape_charts(*which, result, signal_of(store)))))
        # under the staircase, too: what has fallen
        self._fallen.show(tuple(chart for chart in signals if chart.key == "residual" and chart.series))
        self._move()

    def _move(self) -> None:
        for column in (self._signals, self._fallen):
            column.move(self._store.clock.time)

    def _draw_compare(self) -> None:
        store, models = self._store, [step for step, _ in self._store.chain]
        joints, spread = store.measurements.joints, store.measurements.torque_spread
        result, shown = store.analysis.identification, len(store.analysis.model_steps) - 1
        parameters = result.parameters if result else ()
        own = standing(store.analysis).errors == "fit"
        rows = [
            view.StaircaseRun(
                view.run_name(run, joints, store.analysis.roles),
                errors,
                len(run.model_steps) - 1,
                own and run.identification is result,
            )
            for run in runs(store.session)
            if (errors := store.kept.keep(run.identification).errors) is not None
        ]
        drawn = [*map(id, models)], store.joint, id(result), [(row.name, row.shown) for row in rows], shown
        if drawn == self._compared:
            return  # a slider of another step is dragged
        self._compared = drawn
        self._compare.show(view.staircase_charts(models, store.joint, joints, spread))
        self._steps.content = view.staircase_html(models, joints, spread, parameters, shown, rows)
        self._ends = [last for _, _, last in view.model_runs(models, joints)] if models else []
        self._models.visible = self._beside.visible = len(self._ends) > 1
        if len(self._ends) > 1:
            numbers = tuple(str(k) for k in range(len(self._ends)))
            self._models.options, self._beside.options = numbers, (*numbers, OFF)

    def _compare_with(self, number: str) -> None:
        """Draw another model next to the shown one, or none."""
        chosen = None if number == OFF else self._ends[int(number)]
        if chosen is not None and self._store.chain[chosen][1] is None:
            raise InputError("the results of this model are not kept: press Undo, or diagnose again")
        self._store.set_view(replace(self._store.view, beside=chosen))

    def _iterated(self) -> None:
        self._stale = True

    def _draw_convergence(self) -> None:
        """Draw the iterations, at most once per tick; the last ones stay until there are new ones."""
        waiting = self._store.running and not self._store.fit.iterations and self._convergence.shown
        if not self._stale or waiting:
            return
        self._stale = False
        store, spread = self._store, self._store.measurements.torque_spread
        result, derived = store.analysis.identification, store.derived
        iterations, ends, final = store.fit.iterations, [], None
        if result is not None and result.iterations and not store.running:
            iterations, final = result.iterations, result
            ends = [stated_errors(one, spread) for one in derived.stage_errors]
        elif not (iterations or store.running):
            final = result
        self._convergence.show(
            view.convergence_charts(iterations, ends, final, store.measurements.drive is not None)
        )


def in_units(store: Store, charts: Iterable[Chart]) -> tuple[Chart, ...]:
    """Charts of the selected joint, in m and N if it slides."""
    slides = bool(store.measurements.robot.prismatic[store.joint])
    return tuple(chart.of_joint(slides) for chart in charts)


class ResidualTab:
    """The tab "Where it fails": laws through their data, residual maps, curves, a highlighted range."""

    def __init__(self, store: Store, page: Page, tab: Any) -> None:
        self._store = store
        self._of: tuple[Identification | None, int] | None = None  # result and joint of the samples
        self._samples: view.ResidualSamples | None = None
        gui = page.gui
        self.laws = ChartColumn(page.server, tab)
        with tab:
            self._map = ExplainedHtml(gui)
            self._groups = ExplainedHtml(gui)
            self._stopgap = ExplainedHtml(gui)
            hint = "marks, in time and on the robot, the instants where this variable is in the range"
            self._variable = page.dropdown(
                "Highlight", (OFF, *view.VARIABLES), self._chosen, visible=False, hint=hint
            )
            self._range = page.watch(
                gui.add_multi_slider("Range", 0.0, 1.0, 1.0 / STEPS, (0.0, 1.0), visible=False),
                lambda _: self._draw(),
            )
            self._about = ExplainedHtml(gui)
            ResidualAxis(store, page, self._draw)
        self.charts = ChartColumn(page.server, tab)
        store.subscribe(Changed.OPENED, lambda: put(self._variable, value=OFF))
        selected = Changed.OPENED | Changed.JOINT | Changed.GROUP | Changed.SPAN
        store.subscribe(selected | Changed.RESULT | Changed.DIAGNOSIS | Changed.DERIVED, self._draw)
        store.subscribe(Changed.SEARCH, self._draw_laws)
        store.subscribe(Changed.TICK, self._move)

    def _draw(self) -> None:
        store, name = self._store, self._store.joint_name
        result, joint = store.analysis.identification, store.joint
        if self._of is None or self._of[0] is not result or self._of[1] != joint:
            self._samples, self._of = view.ResidualSamples.of(result, joint), (result, joint)
        self._map.content = panel(map_panel(store.maps, store.measurements.joints, joint))
        self._groups.content = view.groups_html(store.errors, joint, name, store.measurements.torque_spread)
        self._variable.visible = self._samples is not None
        residual = view.time_residual(before_after(store), joint, name, store.group.name, store.span)
        marked = self._marked()
        self._range.visible = marked is not None
        if marked is not None and residual.series:
            residual = replace(residual, highlights=view.stretches_of(marked.time, marked.marked))
        curve = view.offered_curve(store.analysis.current_diagnosis)
        self._stopgap.content = view.free_html(curve)
        own = view.model_curve_charts(result.parameters) if result else ()
        self._draw_laws()
        free, unit = view.free_chart(curve), signal_of(store).unit
        self.charts.show((*own, free, *in_units(store, (residual, *view.map_charts(store.maps, name, unit)))))
        self._move()
        store.set_highlight(marked)

    def _draw_laws(self) -> None:
        """Draw the laws of findings and model; during a search the residual so far and the leader's law."""
        store, name, search = self._store, self._store.joint_name, self._store.search
        if search.first is None or search.best is None:
            self.laws.show(view.law_charts(store.analysis.current_diagnosis, store.derived.laws, name))
            return
        where = store.joint, name, store.group.name, store.span
        self.laws.show(view.search_charts(search.first, search.best, search.law, *where))

    def _move(self) -> None:
        self.charts.move(self._store.clock.time)
        self.laws.move(self._store.clock.time)

    def _marked(self) -> Highlight | None:
        key = self._variable.value
        if self._samples is None or self._samples.limits(key) is None:
            self._about.content = ""
            return None
        low, high = self._range.value
        time, inside = self._samples.instants(key, low, high, self._store.group.name)
        self._about.content = view.range_html(key, low, high, inside)
        return Highlight(time, inside)

    def _chosen(self, key: str) -> None:
        ends = None if self._samples is None else self._samples.limits(key)
        if ends is not None:
            low, high = (float(f"{end:.6g}") for end in ends)
            self._range.min, self._range.max, self._range.step = low, high, (high - low) / STEPS
            self._range.value = self._first_range(key, low, high)
        self._draw()

    def _first_range(self, key: str, low: float, high: float) -> tuple[float, float]:
        """The range with most of the residual, or else the upper quarter."""
        found = view.map_of(self._store.maps, self._store.joint_name, key)
        if found is None or not low <= found.range[0] < found.range[1] <= high:
            return low + 0.75 * (high - low), high
        first, last = found.range
        return float(f"{first:.4g}"), float(f"{last:.4g}")
