"""Step 3, Identify: effects in the model, Run and Stop, the parameter table."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from flexviz.app.change import Changed, Turn
from flexviz.app.commands import CTRL
from flexviz.app.page import dim, off
from flexviz.app.state import FitProgress
from flexviz.app.steps.check import ParameterCheck
from flexviz.app.steps.effect_list import EffectList
from flexviz.app.steps.step import WorkflowStep
from flexviz.app.tasks import Identify
from flexviz.session import Settings
from flexviz.view import parameters_html, truth_html
from flexviz.wording import number, plural

if TYPE_CHECKING:
    from flexviz.identification import Identification


class IdentifyStep(WorkflowStep):
    """The solver's controls and its result."""

    title = "Identify"

    def build(self) -> None:
        """Effects, refinement, Check and Run, the table."""
        store, page, gui = self.store, self.page, self.page.gui
        self.effects = EffectList(store, page)
        self._refine = page.watch(
            gui.add_checkbox(
                "Refine", False, hint="a second stage that removes the observer's bias; takes longer"
            ),
            lambda on: store.change("refine", replace(store.analysis, refine=on)),
        )
        self.check = ParameterCheck(store, page)
        self._run = page.button("Run", self._start, color="blue")
        page.row((self.check.button, self._run))
        self._why = gui.add_html("")
        self._check = gui.add_html("")
        self._truth = page.watch(
            gui.add_checkbox(
                "Show truth", False, visible=False, hint="the values the set was simulated with"
            ),
            lambda _: self._draw_table(),
        )
        self._table = gui.add_html("")
        page.command("Run the identification", self._start, "enter", CTRL)
        store.subscribe(Changed.OPENED, self._opened, Turn.CONTROLS)
        store.subscribe(Changed.OPENED | Changed.CHECK, self._show_check, Turn.CONTROLS)

    def _opened(self) -> None:
        self._truth.visible = self.store.opened.truth is not None
        self._truth.value = False

    def _show_check(self) -> None:
        self._check.content = self.store.check

    def refresh(self) -> None:
        """Show the result and enable Run."""
        self._draw_table()
        self._refine.value = self.store.analysis.refine
        self._why.content = dim(self._state())
        off(self._run, self.store.why_not, "identifies the model with these groups and effects")

    def _state(self) -> str:
        """What Run does, or why it is off."""
        analysis, running = self.store.analysis, self.store.running
        fitted, held_out = analysis.groups_with("fit"), analysis.groups_with("validate")
        if self.store.runs(Identify):
            return "Running; Stop keeps the results so far."
        if running:
            return "Run is off: something else is running. Stop ends it."
        if not fitted:
            return "Run is off: no group is set to Fit in step Data."
        if analysis.identification is not None and not analysis.up_to_date:
            return "The settings have changed since this result: press Run again."
        validation = f"validates on {len(held_out)}" if held_out else "no validation"
        return f"Fits {plural(len(fitted), 'group')}, {validation}."

    def _start(self) -> None:
        """Identify with the current settings."""
        store, analysis = self.store, self.store.analysis
        if not store.may_start("Run"):
            return
        store.await_task(
            Identify(analysis.without_result()),
            partial(self._take, analysis.settings),
            begin="running",
            stopped="stopped before a first result",
            share=1.0,  # the number of iterations is unknown
            fit=FitProgress(analysis.effects),
        )

    def _take(self, settings: Settings, result: Identification) -> None:
        if settings.path != self.store.analysis.path:
            return
        self.store.change("identified", self.store.analysis.with_identification(result, settings))
        count = plural(len(result.iterations), "iteration")
        how = "stopped" if result.stopped else "converged" if result.converged else "did not converge"
        message = f": {result.message}" if result.message and not result.converged else ""
        text = f"{how} after {count} in {number(result.seconds, 3)} s{message}"
        self.store.say(text, "" if result.converged else "bad")

    def _draw_table(self) -> None:
        truth = self.store.opened.truth if self._truth.value else None
        self._table.content = truth_html(truth) + parameters_html(self.store.analysis.identification, truth)
