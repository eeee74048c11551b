"""The bandwidth sweep in step 2: a job, its progress, residual and stiffness against bandwidth."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from flexviz.app.charts import ChartColumn
from flexviz.app.controls import off
from flexviz.app.steps.task import Task
from flexviz.app.work import sweep_set
from flexviz.errors import InputError
from flexviz.jobs import JobEvent
from flexviz.progress import Progress
from flexviz.session import Analysis
from flexviz.view import sweep_html, sweep_plots
from flexviz.wording import plural

if TYPE_CHECKING:
    from flexviz.app.application import Application


def belongs_to(analysis: Analysis) -> tuple[Any, ...]:
    """What a sweep depends on."""
    return (analysis.path, analysis.observer, analysis.roles, analysis.effects)


class Sweep:
    """Sweep, take the minimum; made inside the step's folder.

    `bandwidths` gives the ones to try, `take` sets a bandwidth [rad/s].
    """

    def __init__(
        self, app: Application, bandwidths: Callable[[], tuple[float, ...]], take: Callable[[float], None]
    ) -> None:
        self._app, self._bandwidths, self._take = app, bandwidths, take
        self._task = Task(app, "sweep", "sweep stopped before its first fit", self._progress, self._swept)
        self._result: Any = None
        self._of: tuple[Any, ...] | None = None  # what the result belongs to
        gui = app.server.gui
        self._start = gui.add_button("Sweep bandwidth", color="blue")
        self._about = gui.add_html("")
        self._best = gui.add_button(
            "Use the sweep's minimum", color="gray", visible=False, hint="the least error over all joints"
        )
        self._folder = gui.add_folder(None, visible=False)
        self._charts = ChartColumn(app.server, self._folder)
        app.press(self._start, "sweep", self.run)
        app.press(self._best, "sweep-best", self.take_best)

    @property
    def running(self) -> bool:
        """True while a sweep runs or waits."""
        return self._task.running

    def opened(self) -> None:
        """A new set is shown: the old sweep says nothing about it."""
        self._result = self._of = None

    def run(self) -> None:
        """Start a sweep with the present settings."""
        analysis = self._app.session.analysis
        if not self._app.may_start("Sweep"):
            return
        self._task.start(
            belongs_to(analysis), "sweep starts", sweep_set, analysis.without_result(), self._bandwidths()
        )

    def stop(self) -> None:
        """Stop; what is done so far is shown."""
        self._task.stop()

    def take_best(self) -> None:
        """Use the bandwidth with the least error, where one has been looked for."""
        if self._result is None:
            raise InputError("nothing has been swept yet: Sweep bandwidth (step 2) does that")
        self._take(self._result.best)

    def heard(self, event: JobEvent) -> None:
        """What the sweep has to say."""
        self._task.heard(event)

    def _progress(self, news: Progress) -> None:
        self._app.dock.progress(news.share or 0.0)
        self._app.say(f"sweep: {news.text}", "busy")

    def _swept(self, of: tuple[Any, ...], result: Any) -> None:
        if of[0] == self._app.session.analysis.path:
            self._result, self._of = result, of
            self._app.say(f"swept {plural(len(result.bandwidths), 'bandwidth')}")

    def refresh(self) -> None:
        """Show the result for the chosen joint, and what may be pressed."""
        why = self._app.why_not()
        off(self._start, why, "identify at eleven bandwidths around this one")
        self._best.visible = self._folder.visible = self._result is not None
        note = f'<div class="fv fv-dim">Sweep is off: {why}.</div>' if why and not self.running else ""
        if self._result is not None:
            joint = self._app.show.joint
            name = self._app.measurements.joints[joint]
            note += sweep_html(self._result, joint, name)
            if self._of != belongs_to(self._app.session.analysis):
                note += '<div class="fv fv-warn">The settings have changed since this sweep.</div>'
            self._charts.show(sweep_plots(self._result, joint, name))
        self._about.content = note
