"""Step 4, Diagnose: find what the model lacks, add it, diagnose again."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from flexviz.analysis.diagnosis import Finding, why_no_curve
from flexviz.base.errors import InputError
from flexviz.content.blocks import Details
from flexviz.content.records import found_shares
from flexviz.content.rendering import panel
from flexviz.content.session import Analysis, diagnosed_models
from flexviz.content.topics import heading, more_blocks, verdict_panel, why_blocks
from flexviz.content.view import (
    alone_html,
    free_chart,
    free_html,
    offered_curve,
    so_far_html,
    worst_joint_so_far,
    wrong_html,
)
from flexviz.content.wording import (
    TRACE_TITLE,
    MergedFinding,
    capitalised,
    merged_findings,
    number,
    text_names,
)
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import SHIFT, dim, off, put
from flexviz.outlets.app.state import Changed, FitProgress, Turn
from flexviz.outlets.app.steps.deciding import DecidingMotion
from flexviz.outlets.app.steps.findings import FindingEntry, ModelList
from flexviz.outlets.app.steps.step import WorkflowStep
from flexviz.outlets.app.tasks import AddFreeCurve, Diagnose, DiagnosedSet, bandwidth_of
from flexviz.outlets.app.uplot import ChartColumn

LOOKED = "looked for the missing effect"
STOPPED = "stopped early; the model is unchanged"
MAX_FINDINGS = 8
HEIGHT = 170  # [pixels] of the free curve


class DiagnoseStep(WorkflowStep):
    """The verdict, the findings, and the added effects."""

    title = "Diagnose"

    def build(self) -> None:
        page, gui = self.page, self.page.gui
        self._wrong = ExplainedHtml(gui)
        self._find = page.button("Find the missing effect", self._look, color="blue")
        self._why = ExplainedHtml(gui)
        self._so_far = ExplainedHtml(gui)
        self._alone = ExplainedHtml(gui)
        self._verdict = ExplainedHtml(gui)
        self._stopgap = ExplainedHtml(gui)
        self._curve = ChartColumn(page.server, gui.add_folder(None, visible=False))
        self._add_curve = page.button("Add the free curve", self._curve_pressed, visible=False)
        self._all = page.button("Add all found", self._add_all, visible=False)
        self._heading = ExplainedHtml(gui)
        self._merged: list[MergedFinding[Finding]] = []
        self._drawn: tuple[Any, ...] | None = None  # what the controls show
        self.findings = [FindingEntry(page, index, self._add) for index in range(MAX_FINDINGS)]
        self._tried, self.more = ExplainedHtml(gui), ExplainedHtml(gui)
        self.deciding = DecidingMotion(page, self.store)
        self.model = ModelList(page, self._remove)
        self.next_buttons = {"find": self._find, "add": self.findings[0].add}
        page.command("Find what is missing in the model", self._look, "enter", SHIFT)
        page.command("Add the best finding and refit", lambda: self._add(0))
        page.command("Add all that is found", self._add_all)
        page.command("Add the free curve of what is left", self._curve_pressed)
        self.store.subscribe(Changed.GROUP | Changed.JOINT, self._show_findings, Turn.CONTROLS)
        told = Changed.SEARCH | Changed.ACTIVITY | Changed.OPENED
        self.store.subscribe(told, self._show_so_far, Turn.CONTROLS)
        judged = Changed.OPENED | Changed.ANALYSIS | Changed.DERIVED
        self.store.subscribe(judged, self._show_wrong, Turn.CONTROLS)

    def _show_wrong(self) -> None:
        """How wrong the model is, before the first look why."""
        store = self.store
        joints, spread = store.measurements.joints, store.measurements.torque_spread
        put(self._wrong, content=wrong_html(store.analysis, store.errors, joints, spread))

    def _show_so_far(self) -> None:
        """Show what a search has told that runs or was stopped; it begins at the worst joint."""
        store, search = self.store, self.store.search
        first, best, joints = search.first, search.best, store.measurements.joints
        task = store.activity.task if store.activity else None
        adds = isinstance(task, Diagnose) and task.analysis.effects != store.analysis.effects
        if first is not None and first is best and not search.alone and not adds:  # its fall is looked at
            store.select(joint=worst_joint_so_far(first, store.measurements.torque_spread))
        self._so_far.content = so_far_html(best, store.running)
        self._verdict.visible = best is None
        self._alone.content = alone_html(search.alone, best.effects if best else (), joints)

    def refresh(self) -> None:
        store, analysis, why = self.store, self.store.analysis, self.store.why_not
        about = analysis.path, analysis.roles, analysis.effects, analysis.diagnosis_up_to_date
        shown = id(store.measurements), id(analysis.identification), analysis.diagnosis, about, why
        if shown == self._drawn:
            return  # a slider of another step is dragged
        self._drawn = shown
        joints, spread = store.measurements.joints, store.measurements.torque_spread
        verdict = verdict_panel(analysis.diagnosis, analysis.diagnosis_up_to_date, joints, spread)
        self._verdict.content = panel(verdict)
        current = analysis.current_diagnosis
        curve = offered_curve(current)
        self._stopgap.content = free_html(curve)
        self._curve.folder.visible = curve is not None
        self._curve.show((free_chart(curve, height=HEIGHT),))
        self._add_curve.visible = current is not None and not why_no_curve(current)
        off(self._add_curve, why, "not physics: lowers the error of this motion; undo takes it back")
        self._heading.content = panel(heading(current))
        self._show_findings()
        tried = list(why_blocks(current, joints)) if current is not None else []
        self._tried.content = panel([Details(TRACE_TITLE, tried)] if tried else [])
        self.more.content = panel(more_blocks(current or analysis.identification))
        self.deciding.refresh()
        families = dict(pair for one in analysis.model_steps for pair in one.families)
        goals = store.measurements.drive is not None
        self.model.show(store.measurements.effects, analysis.effects, joints, why, families, goals)
        self._all.visible = current is not None and current.verdict == "missing" and bool(current.findings)
        off(self._all, why, "adds the best finding and diagnoses again, until nothing is missing")
        self._why.content = dim(f"{capitalised(why)}." if why else "")
        tried = "that a servo may have" if goals else "of the library on the residual"
        off(self._find, why, f"identifies if needed, then tries every effect {tried}")

    def _show_findings(self) -> None:
        """Show the findings; of new ones the first is open."""
        store, diagnosis = self.store, self.store.analysis.current_diagnosis
        before = self._merged
        self._merged = merged_findings(diagnosis.findings, found_shares(diagnosis)) if diagnosis else []
        shown = (*self._merged, *[None] * MAX_FINDINGS)
        for index, entry in enumerate(self.findings):
            if self._merged != before:
                entry.opened = index == 0
            entry.show(shown[index], store)

    def _look(self) -> None:
        self._start(LOOKED, self.store.analysis)

    def _add(self, index: int) -> None:
        """Add finding `index` on all its joints, refit, diagnose again."""
        if index >= len(self._merged):
            raise InputError("there are no findings for the current model: press Find the missing effect")
        merged = self._merged[index]
        texts = [finding.text for finding in merged.members]
        name = merged.name(self.store.measurements.joints)
        self._start(f"added {name}", self.store.analysis.with_effects(texts))

    def _add_all(self) -> None:
        self._start("added all found", self.store.analysis, apply=True)

    def _curve_pressed(self) -> None:
        """Add the free curve of the diagnosis as a term of the model."""
        store = self.store
        analysis, diagnosis = store.analysis, store.analysis.current_diagnosis
        why = "nothing is diagnosed yet" if diagnosis is None else why_no_curve(diagnosis)
        if diagnosis is None or why:
            raise InputError(f"no free curve can be added: {why}")
        if not store.may_start("Adding the free curve"):
            return
        result = analysis.identification
        task = AddFreeCurve(analysis.without_result(), diagnosis, result and bandwidth_of(result))
        done = partial(self._take_curve, analysis)
        store.await_task(task, done, begin="adding the free curve", stopped=STOPPED, fit=FitProgress())

    def _take_curve(self, before: Analysis, found: DiagnosedSet) -> None:
        store, added, result = self.store, found.diagnosis.steps[-1].added, found.identification
        if store.analysis.settings != before.settings:
            store.say("the settings have changed in the meantime: nothing was added; diagnose again", "bad")
            return
        assert added is not None and result is not None
        analysis = before.with_effects([added.text])
        analysis = analysis.with_identification(result, analysis.settings).with_diagnosis(found.diagnosis)
        store.change(f"added {text_names([added.text], store.measurements.joints)[0]}", analysis)

    def _remove(self, effects: Sequence[str]) -> None:
        analysis = self.store.analysis
        if set(effects) <= set(analysis.effects):
            (name,) = text_names(effects, self.store.measurements.joints)
            self._start(f"removed {name}", analysis.without_effects(effects))

    def _start(self, label: str, analysis: Analysis, apply: bool = False) -> None:
        store = self.store
        if not store.may_start("Looking for what is missing"):
            return
        result = analysis.identification if analysis.up_to_date else None
        known = None if result is None else bandwidth_of(result)
        task = Diagnose(analysis.without_result(), known, apply)
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
        first, *later = diagnosed_models(diagnosis, store.measurements.joints)
        if not found.added or not before.diagnosis_up_to_date:
            own = first.diagnosis if found.added else diagnosis
            analysis = analysis.with_diagnosis(own)
            store.change(LOOKED if found.added else label, analysis)
        for model, identification in zip(later, found.added, strict=False):
            analysis = analysis.with_effects(model.effects)
            analysis = analysis.with_identification(identification, analysis.settings)
            analysis = analysis.with_diagnosis(model.diagnosis)
            store.change(model.label, analysis)
        self._select_joint()
        end = "stopped; " if diagnosis.stopped else ""
        store.say(f"{end}{label} in {number(diagnosis.seconds, 2)} s")

    def _select_joint(self) -> None:
        """Select the joint of the best finding."""
        diagnosis = self.store.analysis.diagnosis
        if diagnosis is None or diagnosis.verdict != "missing" or not diagnosis.findings:
            return
        joint = merged_findings(diagnosis.findings, found_shares(diagnosis))[0].members[0].joint
        if joint:
            self.store.select(joint=self.store.measurements.joint_index(joint))
