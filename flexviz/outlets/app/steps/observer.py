"""Step 2, Observer: the filter that differentiates θ and τ, its tuning and what that costs, and the sweep."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from flexviz.analysis.identification import SweepResult
from flexviz.base.errors import InputError
from flexviz.base.progress import Progress
from flexviz.content.session import Analysis
from flexviz.content.view import numbers_html, observer_for, sweep_bandwidths, sweep_charts, sweep_html
from flexviz.content.wording import capitalised, escape, number, plural
from flexviz.model.observers import OBSERVERS, Observer, make_observer
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import Page, dim, off, warning
from flexviz.outlets.app.state import Changed, Turn
from flexviz.outlets.app.steps.eso_gains import GainsPanel
from flexviz.outlets.app.steps.step import WorkflowStep
from flexviz.outlets.app.steps.tuning import LiveResidual
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.style import no_number_box
from flexviz.outlets.app.tasks import Sweep
from flexviz.outlets.app.uplot import ChartColumn

LOWEST, HIGHEST = 5.0, 2000.0  # [rad/s] limits of the bandwidth
NO_OBSERVER = (
    "Joints that follow goals are fitted by simulating their motion from the goals: no observer has to "
    "differentiate it, and there is nothing to choose here. The tab States shows how the joints moved."
)
MARKS = (5.0, 20.0, 100.0, 500.0, 2000.0)

Widths = tuple[float, ...]  # [rad/s]


class ObserverStep(WorkflowStep):
    """Observer type and bandwidth; lag and noise gain as numbers; the sweep."""

    title = "Observer"

    def build(self) -> None:
        page, gui = self.page, self.page.gui
        self._none = ExplainedHtml(gui, dim(NO_OBSERVER), visible=False)
        self._controls = gui.add_folder(None)
        with self._controls:
            self._build_controls()
        page.command("Use the observer's own bandwidth", self._use_default)
        self.store.subscribe(Changed.JOINT, self.refresh, Turn.CONTROLS)

    def _build_controls(self) -> None:
        """Create the controls of sets with an observer."""
        page, gui = self.page, self.page.gui
        self._type = page.dropdown("Observer type", tuple(OBSERVERS), self._choose)
        self._slider = page.watch(
            gui.add_slider(
                "Bandwidth [rad/s]", math.log10(LOWEST), math.log10(HIGHEST), 0.01, math.log10(50.0),
                marks=tuple((math.log10(mark), f"{mark:g}") for mark in MARKS),
                hint="logarithmic; the residual below and the states on the right follow at once",
            ),
            lambda exponent: self._set_bandwidth(10.0**exponent),
        )  # fmt: skip
        hint = "the same bandwidth [rad/s] as a number"
        exact = gui.add_number("exactly", 50.0, min=LOWEST, max=HIGHEST, step=0.1, hint=hint)
        self._exact = page.watch(exact, self._set_bandwidth)
        hint = "sets the selected joint's bandwidth only, not every joint's"
        self._single = page.checkbox("Only this joint", hint=hint)
        page.button("Use the observer's own bandwidth", self._use_default)
        self._numbers = ExplainedHtml(gui)
        self.live = LiveResidual(self.store, page, lambda: self.store.step == self.title)
        GainsPanel(self.store, page, self.live.show_draft, self.live.below)
        self.sweep = BandwidthSweep(self.store, page, self._around, self._set_bandwidth)
        page.style(no_number_box, self._slider)

    def refresh(self) -> None:
        store, analysis = self.store, self.store.analysis
        goals = store.measurements.drive is not None
        self._none.visible, self._controls.visible = goals, not goals
        observer = self._present()
        width = float(observer.bandwidth)  # type: ignore[arg-type]
        self._type.value = analysis.fit.observer
        shown = min(max(width, LOWEST), HIGHEST)
        if abs(10.0**self._slider.value / shown - 1.0) > 0.005:
            self._slider.value = math.log10(shown)
        self._exact.value = float(f"{shown:.4g}")
        chosen = analysis.used_tuning != analysis.fit.tuning
        own = " (chosen by the data)" if chosen else " (its own)"
        where, listed = own if analysis.fit.bandwidth is None else "", ""
        if isinstance(analysis.fit.bandwidth, tuple):
            pairs = zip(store.measurements.joints, analysis.fit.bandwidth, strict=False)
            widths = ", ".join(f"{escape(joint)} {number(each, 3)}" for joint, each in pairs)
            where, listed = " on this joint", dim(f"Per joint [rad/s]: {widths}.")
        by_hand = ", gains set by hand" if analysis.fit.gains else ""
        self._numbers.content = (
            f'<div class="fv"><b>{OBSERVERS[analysis.fit.observer].title}</b>, '
            f"bandwidth {number(width, 4)} rad/s{where}{by_hand}</div>"
            + listed
            + numbers_html(observer, store.group.segments[0].step)
        )

    def _present(self) -> Observer:
        name, bandwidth, gains = self.store.analysis.used_tuning
        return observer_for(name, bandwidth, self.store.joint, gains)

    def _around(self) -> Widths:
        return sweep_bandwidths(float(self._present().bandwidth), LOWEST, HIGHEST)  # type: ignore[arg-type]

    def _choose(self, name: str) -> None:
        make_observer(name)
        self.store.change(f"observer {name}", self.store.analysis.with_fit(observer=name, gains=None))

    def _set_bandwidth(self, bandwidth: float) -> None:
        """Use a bandwidth [rad/s], for all joints or only the selected one."""
        width = float(f"{min(max(bandwidth, LOWEST), HIGHEST):.4g}")
        store, analysis, n = self.store, self.store.analysis, self.store.measurements.n
        if not self._single.value or n == 1:
            store.change("bandwidth", analysis.with_fit(bandwidth=width))
            return
        fit = analysis.fit
        present = [observer_for(fit.observer, fit.bandwidth, joint, fit.gains) for joint in range(n)]
        widths = [float(observer.bandwidth) for observer in present]  # type: ignore[arg-type]
        widths[store.joint] = width
        store.change(f"bandwidth of {store.joint_name}", analysis.with_fit(bandwidth=tuple(widths)))

    def _use_default(self) -> None:
        self.store.change("the observer's own bandwidth", self.store.analysis.with_fit(bandwidth=None))


class BandwidthSweep:
    """The sweep over `bandwidths()` [rad/s]; `use` sets the one with the least error."""

    def __init__(
        self, store: Store, page: Page, bandwidths: Callable[[], Widths], use: Callable[[float], None]
    ) -> None:
        self._store, self._bandwidths, self._use = store, bandwidths, use
        self._result: SweepResult | None = None
        self._of: Analysis | None = None  # settings of the result
        self._start = page.button("Sweep bandwidth", self._run, color="blue")
        self._about = ExplainedHtml(page.gui)
        hint = "the bandwidth with the least error over all joints"
        self._best = page.button("Use the sweep's minimum", self._use_best, visible=False, hint=hint)
        self._folder = page.gui.add_folder(None, visible=False)
        self._charts = ChartColumn(page.server, self._folder)
        page.command("Sweep the bandwidth", self._run)
        page.command("Use the sweep's best bandwidth", self._use_best)
        store.subscribe(Changed.OPENED, self._opened, Turn.CONTROLS)
        shown = Changed.OPENED | Changed.ANALYSIS | Changed.ACTIVITY | Changed.JOINT
        store.subscribe(shown, self._refresh, Turn.CONTROLS)

    def _opened(self) -> None:
        self._result = self._of = None

    def _run(self) -> None:
        if not self._store.may_start("Sweep"):
            return
        analysis = self._store.analysis.without_result()
        self._store.await_task(
            Sweep(analysis, self._bandwidths()),
            partial(self._take, analysis),
            begin="sweep starts",
            stopped="sweep stopped before its first fit",
            progress=self._progress,
        )

    def _progress(self, news: Progress) -> None:
        self._store.report(replace(news, text=f"sweep: {news.text}"))

    def _take(self, of: Analysis, result: SweepResult) -> None:
        if of.path == self._store.analysis.path:
            self._result, self._of = result, of
            self._store.say(f"swept {plural(len(result.bandwidths), 'bandwidth')}")

    def _use_best(self) -> None:
        if self._result is None:
            raise InputError("nothing has been swept yet: press Sweep bandwidth (step 2) first")
        self._use(self._result.best)

    def _refresh(self) -> None:
        """Show the result for the selected joint and enable the buttons."""
        store, why = self._store, self._store.why_not
        off(self._start, why, "identifies at eleven bandwidths around this one")
        note = dim(f"{capitalised(why)}.") if why and not store.runs(Sweep) else ""
        if self._result is not None:
            note += sweep_html(self._result, store.joint, store.joint_name)
            if self._of is not None and _settings(self._of) != _settings(store.analysis):
                note += warning("The settings have changed since this sweep.")
            self._charts.show(sweep_charts(self._result, store.joint, store.joint_name))
        self._best.visible = self._folder.visible = self._result is not None
        self._about.content = note


def _settings(analysis: Analysis) -> tuple[object, ...]:
    """The settings that a sweep depends on."""
    return (analysis.path, analysis.fit.observer, analysis.fit.gains, analysis.roles, analysis.effects)
