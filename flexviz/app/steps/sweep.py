"""The bandwidth sweep in step 2: a job, its progress, residual and stiffness against bandwidth."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from flexviz.app.charts import ChartColumn
from flexviz.app.work import sweep_set
from flexviz.jobs import JobEvent
from flexviz.session import Analysis
from flexviz.view.sweep import sweep_html, sweep_plots
from flexviz.view.text import plural

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
        self._running: tuple[Any, ...] | None = None
        self._result: Any = None
        self._of: tuple[Any, ...] | None = None  # what the result belongs to
        gui = app.server.gui
        self._start = gui.add_button(
            "Sweep bandwidth", color="blue", hint="identify at eleven bandwidths around this one"
        )
        self._about = gui.add_html("")
        self._best = gui.add_button(
            "Use the sweep's minimum", color="gray", visible=False, hint="the least error over all joints"
        )
        self._folder = gui.add_folder(None, visible=False)
        self._charts = ChartColumn(app.server, self._folder)
        app.press(self._start, "sweep", self.run)
        app.press(self._best, "sweep-best", lambda: self._take(self._result.best) if self._result else None)

    @property
    def running(self) -> bool:
        """True while a sweep runs or waits."""
        return self._running is not None

    def opened(self) -> None:
        """A new set is shown: the old sweep says nothing about it."""
        self._result = self._of = None

    def run(self) -> None:
        """Start a sweep with the present settings."""
        analysis = self._app.session.analysis
        if self.running or self._why_not():
            return
        self._running = belongs_to(analysis)
        self._app.dock.progress(0.0)
        self._app.say("sweep starts", "busy")
        self._app.submit("sweep", sweep_set, analysis.without_result(), self._bandwidths())
        self._app.refresh_running()

    def stop(self) -> None:
        """Stop; what is done so far is shown."""
        if self.running:
            self._app.worker.stop("sweep")
            self._app.say("stopping the sweep", "busy")

    def heard(self, event: JobEvent) -> None:
        """What the sweep has to say."""
        if event.kind == "started":
            return
        if event.kind == "progress":
            done, total = event.value
            self._app.dock.progress(done / total)
            self._app.say(f"sweep: {done} of {total} bandwidths", "busy")
            return
        of, self._running = self._running, None
        if event.kind == "failed":
            self._app.fail(event.value)
        elif event.kind == "stopped":
            self._app.say("sweep stopped before its first fit")
        elif of is not None and of[0] == self._app.session.analysis.path:
            self._result, self._of = event.value, of
            self._app.say(f"swept {plural(len(event.value.bandwidths), 'bandwidth')}")
        self._app.refresh_running()

    def refresh(self) -> None:
        """Show the result for the chosen joint, and what may be pressed."""
        why = self._why_not()
        self._start.disabled = self.running or bool(why)
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

    def _why_not(self) -> str:
        if self._app.running:
            return "something runs"
        if not self._app.session.analysis.groups_with("fit"):
            return "no group is set to Fit in step Data"
        return ""
