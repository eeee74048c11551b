"""Step 3, Identify: effects in the model, Run and Stop, the parameter table."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from flexviz.app.controls import off, watch
from flexviz.app.show import IDLE_JOBS
from flexviz.app.steps.check import Check
from flexviz.app.steps.effects import EffectList
from flexviz.app.steps.task import Task
from flexviz.app.work import identify_set
from flexviz.jobs import JobEvent
from flexviz.progress import Progress
from flexviz.view import parameters_html, progress_text, truth_html
from flexviz.wording import number, plural

if TYPE_CHECKING:
    from flexviz.app.application import Application


class IdentifyStep:
    """The solver's controls and its result."""

    def __init__(self, app: Application) -> None:
        self._app = app
        gui = app.server.gui
        stopped = "stopped before a first result"
        # of the settings it was started with
        self._task = Task(app, "identify", stopped, self.iterated, self._take, self._draw_convergence)
        self.iterations: list[Any] = []
        self._new_iterations = False
        self._fits = False  # whether iterations that come belong to one result
        self.effects_fitted: tuple[str, ...] = ()  # of the model that is being fitted
        self.folder = gui.add_folder(None, visible=False)
        with self.folder:
            self.effects = EffectList(app)
            self._refine = gui.add_checkbox(
                "Refine", False, hint="a second stage that removes the observer's bias; takes longer"
            )
            self.check = Check(app)
            self._run = gui.add_button("Run", color="blue")
            app.row(self.check.button, self._run)
            self._why = gui.add_html("")
            self.check.add_text()
            self._truth = gui.add_checkbox(
                "Show truth", False, visible=False, hint="the values the set was made with"
            )
            self._table = gui.add_html("")
        app.press(self._run, "run", self.run)
        watch(self._refine, app.queue, "refine")
        watch(self._truth, app.queue, "truth")
        app.on("refine", lambda on: app.change("refine", replace(app.session.analysis, refine=on)))
        app.on("truth", lambda _: self._draw_table())

    @property
    def running(self) -> bool:
        """True while an identification runs."""
        return self._task.running

    def opened(self) -> None:
        """A new set is shown."""
        self.effects.opened()
        self.check.opened()
        self.iterations = []
        self._draw_convergence()
        self._truth.visible = self._app.truth is not None
        self._truth.value = False
        self.refresh()

    def refresh(self) -> None:
        """Show the session's effects and result, and what may be pressed."""
        analysis = self._app.session.analysis
        self.effects.refresh()
        self.check.refresh()
        self._refine.value = analysis.refine
        nothing = not analysis.groups_with("fit")
        off(self._run, self._app.why_not(), "identifies the model with these groups and effects")
        if self.running:
            text = "Running; Stop keeps what the solver has."
        elif self._app.running:
            text = "Run is off: something else runs. Stop ends it."
        elif nothing:
            text = "Run is off: no group is set to Fit in step Data."
        elif analysis.identification is not None and not analysis.up_to_date:
            text = "The settings have changed since this result: press Run again."
        else:
            text = f"Fits {plural(len(analysis.groups_with('fit')), 'group')}, " + (
                f"validates on {len(analysis.groups_with('validate'))}."
                if analysis.groups_with("validate")
                else "no validation."
            )
        self._why.content = f'<div class="fv fv-dim">{text}</div>'
        self._draw_table()

    def run(self) -> None:
        """Start the identification of the present settings."""
        analysis = self._app.session.analysis
        if not self._app.may_start("Run"):
            return
        self.begin(analysis.effects)
        # how many iterations it takes is not known: the bar is full
        self._task.start(analysis.settings, "running", identify_set, analysis.without_result(), share=1.0)

    def stop(self) -> None:
        """Stop the identification; it gives back what it has."""
        self._task.stop()

    def begin(self, effects: tuple[str, ...], fits: bool = True) -> None:
        """A fit of a model with these effects begins: what was done in idle time makes room.

        `fits` is whether iterations will come that belong to one result.
        """
        for key in ("check", *IDLE_JOBS):
            self._app.worker.stop(key)
        self.iterations, self.effects_fitted, self._fits = [], effects, fits
        self._draw_convergence()

    @property
    def fitting(self) -> bool:
        """Whether a fit is under way that gives one result."""
        return self._app.running and self._fits

    def iterated(self, news: Progress) -> None:
        """An iteration of an identification."""
        iteration = news.iteration
        if iteration is None:
            return
        self.iterations.append(iteration)
        if self._fits:
            if len(self.iterations) == 1:
                self._app.recordings.began()
            self._app.recordings.iterated(iteration)
        self._app.say(progress_text(self.iterations), "busy")
        self._new_iterations = True

    def tick(self) -> None:
        """Let the convergence plots follow a running identification, and the check the settings."""
        self.check.tick()
        if self._new_iterations:
            self._draw_convergence()

    def heard(self, event: JobEvent) -> None:
        """What the identification has to say."""
        self._task.heard(event)

    def _take(self, settings: tuple[Any, ...], result: Any) -> None:
        self._draw_convergence()
        if settings[0] == self._app.session.analysis.path:
            self._app.change("identified", self._app.session.analysis.with_identification(result, settings))
            self._app.say(self._summary(result), "" if result.converged else "bad")

    def _summary(self, result: Any) -> str:
        count = plural(len(result.iterations), "iteration")
        how = "stopped" if result.stopped else "converged" if result.converged else "did not converge"
        message = f": {result.message}" if result.message and not result.converged else ""
        return f"{how} after {count} in {number(result.seconds, 3)} s{message}"

    def _draw_convergence(self) -> None:
        self._new_iterations = False
        self._app.show.plots.show_convergence(self.iterations)

    def _draw_table(self) -> None:
        result = self._app.session.analysis.identification
        truth = self._app.truth if self._truth.value else None
        self._table.content = truth_html(truth) + parameters_html(result, truth)
