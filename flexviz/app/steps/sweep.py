"""The bandwidth sweep in step 2: residual and stiffness against bandwidth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from flexviz.app.change import Changed, Turn
from flexviz.app.page import Page, dim, off, warning
from flexviz.app.store import Store
from flexviz.app.tasks import Sweep
from flexviz.app.uplot import ChartColumn
from flexviz.errors import InputError
from flexviz.progress import Progress
from flexviz.session import Analysis
from flexviz.view import sweep_charts, sweep_html
from flexviz.wording import plural

if TYPE_CHECKING:
    from flexviz.identification import SweepResult


class BandwidthSweep:
    """The sweep over `bandwidths()` [rad/s]; `use` sets the one with the least error."""

    def __init__(
        self,
        store: Store,
        page: Page,
        bandwidths: Callable[[], tuple[float, ...]],
        use: Callable[[float], None],
    ) -> None:
        self._store, self._bandwidths, self._use = store, bandwidths, use
        self._result: SweepResult | None = None
        self._of: Analysis | None = None  # settings of the result
        self._start = page.button("Sweep bandwidth", self._run, color="blue")
        self._about = page.gui.add_html("")
        self._best = page.button(
            "Use the sweep's minimum",
            self._use_best,
            visible=False,
            hint="the bandwidth with the least error over all joints",
        )
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
        """Start a sweep with the current settings."""
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
        """Use the bandwidth with the least error."""
        if self._result is None:
            raise InputError("nothing has been swept yet: press Sweep bandwidth (step 2) first")
        self._use(self._result.best)

    def _refresh(self) -> None:
        """Show the result for the selected joint and enable the buttons."""
        store, why = self._store, self._store.why_not
        off(self._start, why, "identifies at eleven bandwidths around this one")
        note = dim(f"Sweep is off: {why}.") if why and not store.runs(Sweep) else ""
        if self._result is not None:
            note += sweep_html(self._result, store.joint, store.joint_name)
            if self._of is not None and _settings(self._of) != _settings(store.analysis):
                note += warning("The settings have changed since this sweep.")
            self._charts.show(sweep_charts(self._result, store.joint, store.joint_name))
        self._best.visible = self._folder.visible = self._result is not None
        self._about.content = note


def _settings(analysis: Analysis) -> tuple[object, ...]:
    """The settings that a sweep depends on."""
    return (analysis.path, analysis.observer, analysis.roles, analysis.effects)
