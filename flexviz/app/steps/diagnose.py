"""Step 4, Diagnose: find what the model lacks, add it, diagnose again."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from flexviz.app.change import Changed, Turn
from flexviz.app.commands import SHIFT
from flexviz.app.page import dim, off
from flexviz.app.state import FitProgress
from flexviz.app.steps.findings import HEIGHT, FindingList
from flexviz.app.steps.model_list import ModelList
from flexviz.app.steps.step import WorkflowStep
from flexviz.app.tasks import Diagnose, DiagnosedSet
from flexviz.app.uplot import ChartColumn
from flexviz.errors import InputError
from flexviz.session import Analysis
from flexviz.view import free_chart, free_html, heading_html, verdict_html
from flexviz.wording import effect_text_name, number

LOOKED = "looked for the missing effect"
STOPPED = "stopped early; the model is unchanged"


class DiagnoseStep(WorkflowStep):
    """The verdict, the findings, and the added effects."""

    title = "Diagnose"

    def build(self) -> None:
        """Find, the verdict, the findings, the model."""
        page, gui = self.page, self.page.gui
        self._find = page.button("Find the missing effect", self._look, color="blue")
        self._why = gui.add_html("")
        self._verdict = gui.add_html("")
        self._stopgap = gui.add_html("")
        self._curve = ChartColumn(page.server, gui.add_folder(None, visible=False))
        self._all = page.button("Add all found", self._add_all, visible=False)
        self._heading = gui.add_html("")
        self.findings = FindingList(page, self._add)
        self.model = ModelList(page, self._remove)
        self.next_buttons = {"find": self._find, "add": self.findings.entries[0].add}
        page.command("Find what is missing in the model", self._look, "enter", SHIFT)
        page.command("Add the best finding and refit", lambda: self._add(0))
        page.command("Add all that is found", self._add_all)
        self.store.subscribe(Changed.GROUP, self._show_findings, Turn.CONTROLS)

    def refresh(self) -> None:
        """Show the diagnosis and enable the buttons."""
        store, analysis, why = self.store, self.store.analysis, self.store.why_not
        diagnosis, fresh = analysis.diagnosis, analysis.diagnosis_up_to_date
        self._verdict.content = verdict_html(diagnosis, fresh)
        curve = store.free_curve
        self._stopgap.content = free_html(curve)
        self._curve.folder.visible = curve is not None
        self._curve.show((free_chart(curve, height=HEIGHT),))
        self._heading.content = heading_html(diagnosis) if fresh else ""
        self._show_findings()
        self.model.show(store.measurements.effects, analysis.effects, why)
        found = diagnosis is not None and fresh and diagnosis.verdict == "missing" and diagnosis.findings
        self._all.visible = bool(found)
        off(self._all, why, "adds the best finding and diagnoses again, until nothing is missing")
        self._why.content = dim(f"Off: {why}." if why else "")
        off(self._find, why, "identifies if needed, then tries every effect of the library on the residual")

    def _show_findings(self) -> None:
        diagnosis, fresh = self.store.analysis.diagnosis, self.store.analysis.diagnosis_up_to_date
        findings = diagnosis.findings if diagnosis is not None and fresh else ()
        self.findings.show(findings, self.store.why_not, self.store.group.name)

    def _look(self) -> None:
        """Diagnose the current model."""
        self._start(LOOKED, self.store.analysis)

    def _add(self, index: int) -> None:
        """Add finding `index`, refit, diagnose again."""
        analysis = self.store.analysis
        diagnosis = analysis.diagnosis
        if diagnosis is None or not analysis.diagnosis_up_to_date or index >= len(diagnosis.findings):
            raise InputError("there are no findings for the current model: press Find the missing effect")
        text = diagnosis.findings[index].text
        self._start(f"added {effect_text_name(text)}", analysis.with_effect(text, True))

    def _add_all(self) -> None:
        """Add all findings one by one."""
        self._start("added all found", self.store.analysis, apply=True)

    def _remove(self, effect: str) -> None:
        """Remove an effect from the model, refit, diagnose again."""
        analysis = self.store.analysis
        if effect in analysis.effects:
            self._start(f"removed {effect_text_name(effect)}", analysis.with_effect(effect, False))

    def _start(self, label: str, analysis: Analysis, apply: bool = False) -> None:
        store = self.store
        if not store.may_start("Looking for what is missing"):
            return
        result = analysis.identification if analysis.up_to_date else None
        task = Diagnose(analysis.without_result(), None if result is None else result.model, apply)
        done = partial(self._take, label, analysis, store.analysis)
        fit = FitProgress(analysis.effects, single=not apply)
        store.await_task(task, done, begin="looking", stopped=STOPPED, fit=fit)

    def _take(self, label: str, analysis: Analysis, before: Analysis, found: DiagnosedSet) -> None:
        """Show a diagnosis of the model of `analysis`, started in the state `before`."""
        store, diagnosis = self.store, found.diagnosis
        if store.analysis.settings != before.settings:
            store.say("the settings have changed in the meantime: nothing was added; diagnose again", "bad")
            return
        if diagnosis.stopped and diagnosis.verdict != "missing" and not found.added:
            store.say(STOPPED)
            return
        if found.identification is not None:
            analysis = analysis.with_identification(found.identification, analysis.settings)
        if not found.added or not before.diagnosis_up_to_date:
            analysis = analysis.with_diagnosis(diagnosis)
            store.change(LOOKED if found.added else label, analysis)
        for index, added in enumerate(found.added, start=1):
            step = diagnosis.steps[index]
            following = tuple(s.added for s in diagnosis.steps[index + 1 : index + 2] if s.added is not None)
            answer = replace(diagnosis, verdict=step.verdict, findings=following, steps=(step,))
            analysis = replace(analysis, effects=added.effects)
            analysis = analysis.with_identification(added.identification, analysis.settings)
            analysis = analysis.with_diagnosis(answer)
            store.change(f"added {effect_text_name(added.effects[-1])}", analysis)
        self._select_joint()
        store.say(f"{label} in {number(diagnosis.seconds, 2)} s")

    def _select_joint(self) -> None:
        """Select the joint of the best finding."""
        diagnosis = self.store.analysis.diagnosis
        if diagnosis is not None and diagnosis.verdict == "missing" and diagnosis.findings:
            joint = diagnosis.findings[0].joint
            if joint:
                self.store.select(joint=self.store.measurements.joint_index(joint))
