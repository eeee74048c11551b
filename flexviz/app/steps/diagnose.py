"""Step 4, Diagnose: find what the model lacks, add it, diagnose again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from flexviz.app.page import SHIFT, Page, dim, off
from flexviz.app.state import Changed, FitProgress, Turn
from flexviz.app.steps.step import WorkflowStep
from flexviz.app.tasks import Diagnose, DiagnosedSet
from flexviz.app.uplot import ChartColumn
from flexviz.diagnosis import Finding
from flexviz.errors import InputError
from flexviz.session import Analysis
from flexviz.view import (
    card_html,
    evidence_chart,
    finding_html,
    free_chart,
    free_html,
    heading_html,
    verdict_html,
)
from flexviz.wording import effect_text_name, escape, number

LOOKED = "looked for the missing effect"
STOPPED = "stopped early; the model is unchanged"
MAX_FINDINGS = 8
MAX_EFFECTS = 12  # in the list of the model's
HEIGHT = 170  # [pixels] of the evidence


class DiagnoseStep(WorkflowStep):
    """The verdict, the findings, and the added effects."""

    title = "Diagnose"

    def build(self) -> None:
        page, gui = self.page, self.page.gui
        self._find = page.button("Find the missing effect", self._look, color="blue")
        self._why = gui.add_html("")
        self._verdict = gui.add_html("")
        self._stopgap = gui.add_html("")
        self._curve = ChartColumn(page.server, gui.add_folder(None, visible=False))
        self._all = page.button("Add all found", self._add_all, visible=False)
        self._heading = gui.add_html("")
        self._findings: tuple[Finding, ...] = ()
        self.findings = [FindingEntry(page, index, self._add) for index in range(MAX_FINDINGS)]
        self.model = ModelList(page, self._remove)
        self.next_buttons = {"find": self._find, "add": self.findings[0].add}
        page.command("Find what is missing in the model", self._look, "enter", SHIFT)
        page.command("Add the best finding and refit", lambda: self._add(0))
        page.command("Add all that is found", self._add_all)
        self.store.subscribe(Changed.GROUP, self._show_findings, Turn.CONTROLS)

    def refresh(self) -> None:
        store, analysis, why = self.store, self.store.analysis, self.store.why_not
        self._verdict.content = verdict_html(analysis.diagnosis, analysis.diagnosis_up_to_date)
        current, curve = analysis.current_diagnosis, store.free_curve
        self._stopgap.content = free_html(curve)
        self._curve.folder.visible = curve is not None
        self._curve.show((free_chart(curve, height=HEIGHT),))
        self._heading.content = heading_html(current)
        self._show_findings()
        self.model.show(store.measurements.effects, analysis.effects, why)
        self._all.visible = current is not None and current.verdict == "missing" and bool(current.findings)
        off(self._all, why, "adds the best finding and diagnoses again, until nothing is missing")
        self._why.content = dim(f"Off: {why}." if why else "")
        off(self._find, why, "identifies if needed, then tries every effect of the library on the residual")

    def _show_findings(self) -> None:
        """Show the findings; of new ones the first is open."""
        store, diagnosis = self.store, self.store.analysis.current_diagnosis
        before, self._findings = self._findings, diagnosis.findings if diagnosis else ()
        shown = (*self._findings, *[None] * MAX_FINDINGS)
        for index, entry in enumerate(self.findings):
            if self._findings != before:
                entry.opened = index == 0
            entry.show(shown[index], store.why_not, store.group.name)

    def _look(self) -> None:
        self._start(LOOKED, self.store.analysis)

    def _add(self, index: int) -> None:
        """Add finding `index`, refit, diagnose again."""
        if index >= len(self._findings):
            raise InputError("there are no findings for the current model: press Find the missing effect")
        text = self._findings[index].text
        self._start(f"added {effect_text_name(text)}", self.store.analysis.with_effect(text, True))

    def _add_all(self) -> None:
        self._start("added all found", self.store.analysis, apply=True)

    def _remove(self, effect: str) -> None:
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
        steps = diagnosis.steps[1:]
        for index, (step, identification) in enumerate(zip(steps, found.added, strict=False)):
            assert step.added is not None
            following = tuple(s.added for s in steps[index + 1 : index + 2] if s.added is not None)
            answer = replace(diagnosis, verdict=step.verdict, findings=following, steps=(step,))
            analysis = analysis.with_effect(step.added.text, True)
            analysis = analysis.with_identification(identification, analysis.settings).with_diagnosis(answer)
            store.change(f"added {effect_text_name(step.added.text)}", analysis)
        self._select_joint()
        store.say(f"{label} in {number(diagnosis.seconds, 2)} s")

    def _select_joint(self) -> None:
        """Select the joint of the best finding."""
        diagnosis = self.store.analysis.diagnosis
        findings = diagnosis.findings if diagnosis and diagnosis.verdict == "missing" else ()
        if findings and findings[0].joint:
            self.store.select(joint=self.store.measurements.joint_index(findings[0].joint))


class FindingEntry:
    """One finding's text, chart, explanation and buttons."""

    def __init__(self, page: Page, index: int, add: Callable[[int], None]) -> None:
        self._index = index
        self._finding: Finding | None = None
        self._group = ""
        self.opened = index == 0  # whether its evidence is shown
        gui = page.gui
        self._text = gui.add_html("", visible=False)
        self._toggle = page.button("Show evidence", self._switch, visible=False)
        self.add = page.button(
            "Add and refit", partial(add, index), color="blue" if index == 0 else "gray", visible=False
        )
        self._folder = gui.add_folder(None, visible=False)
        self._chart = ChartColumn(page.server, self._folder)
        self._card = gui.add_html("", visible=False)
        page.row((self._toggle, self.add))

    def show(self, finding: Finding | None, why: str, group: str) -> None:
        """Show a finding with its evidence in a group; None hides the entry."""
        self._finding, self._group = finding, group
        for handle in (self._text, self._toggle, self.add, self._card):
            handle.visible = finding is not None
        if finding is None:
            self._folder.visible = False
            return
        self._text.content = finding_html(finding, self._index + 1, full=self._index == 0)
        self._card.content = card_html(finding.effect)
        off(self.add, why, "adds this effect, identifies and diagnoses again")
        self._show_evidence(finding)

    def _show_evidence(self, finding: Finding) -> None:
        there = finding.evidence is not None
        why = "" if there else "only screened briefly, so there is no evidence"
        off(self._toggle, why, "the residual with this effect's signature over it")
        shown = self.opened and there
        self._toggle.label = "Hide evidence" if shown else "Show evidence"
        self._folder.visible = shown
        if shown:
            self._chart.show((evidence_chart(finding, self._group, height=HEIGHT),))

    def _switch(self) -> None:
        self.opened = not self.opened
        if self._finding is not None:
            self._show_evidence(self._finding)


class ModelList:
    """A fixed number of rows for effects."""

    def __init__(self, page: Page, remove: Callable[[str], None]) -> None:
        self._effects: tuple[str, ...] = ()
        self._remove = remove
        self._heading = page.gui.add_html("")
        self._rows = []
        for index in range(MAX_EFFECTS):
            text = page.gui.add_html("", visible=False)
            button = page.button("Remove", partial(self._pressed, index), visible=False)
            page.row((button,), share=0.3)
            self._rows.append((text, button))

    def show(self, own: Sequence[str], added: Sequence[str], why: str) -> None:
        """Show the set's own and the added effects; `why`: the reason that none can be removed now."""
        self._effects = tuple(added)
        names = ", ".join(effect_text_name(name) for name in own)
        text = f"the set's own: {names}" if own else ""
        if not own and not added:
            text = "stiffness, inertia and viscous friction only"
        more = f" and {len(added) - MAX_EFFECTS} more" if len(added) > MAX_EFFECTS else ""
        self._heading.content = (
            f'<div class="fv"><b>In the model</b>{": " if text else ""}{escape(text)}{more}</div>'
        )
        for index, (text, button) in enumerate(self._rows):
            text.visible = button.visible = index < len(added)
            off(button, why, "removes it, refits and diagnoses again")
            if index < len(added):
                text.content = f'<div class="fv fv-added">+ {escape(effect_text_name(added[index]))}</div>'

    def _pressed(self, index: int) -> None:
        if index < len(self._effects):
            self._remove(self._effects[index])
