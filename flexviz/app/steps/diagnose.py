"""Step 4, Diagnose: what is missing in the model; add it, look again, watch the error fall."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from flexviz.app.charts import ChartColumn
from flexviz.app.controls import off
from flexviz.app.steps.findings import FindingList
from flexviz.app.steps.model import ModelList
from flexviz.app.steps.task import Task
from flexviz.app.work import Looked, diagnose_set
from flexviz.errors import InputError
from flexviz.jobs import JobEvent
from flexviz.progress import Progress
from flexviz.session import Analysis
from flexviz.view import free_html, free_plot, heading_html, verdict_html
from flexviz.wording import effect_text_name, number

if TYPE_CHECKING:
    from flexviz.app.application import Application


class DiagnoseStep:
    """The verdict, the findings, and what has been added."""

    def __init__(self, app: Application) -> None:
        self._app = app
        stopped = "stopped before an answer; the model is as it was"
        # of what the running search looks at
        self._task = Task(app, "diagnose", stopped, self._progress, self._take)
        self._before: Analysis | None = None  # the state it was started from
        self._label = ""
        gui = app.server.gui
        self.folder = gui.add_folder(None, visible=False)
        with self.folder:
            self._find = gui.add_button("Find the missing effect", color="blue")
            self._why = gui.add_html("")
            self._verdict = gui.add_html("")
            self._stopgap = gui.add_html("")
            self._curve = ChartColumn(app.server, gui.add_folder(None, visible=False))
            self._all = gui.add_button("Add all found", color="gray", visible=False)
            self._heading = gui.add_html("")
            self.findings = FindingList(app, self.add)
            self.model = ModelList(app, self.remove)
        app.press(self._find, "find", self.find)
        app.press(self._all, "add-all", self.add_all)
        app.dock.next_buttons["find"] = self._find
        app.dock.next_buttons["add"] = self.findings.first_button

    @property
    def running(self) -> bool:
        """True while a search runs or waits."""
        return self._task.running

    def opened(self) -> None:
        """A new set is shown."""
        self.findings.opened()
        self.refresh()

    def refresh(self) -> None:
        """Show the session's diagnosis, and what may be pressed."""
        analysis = self._app.session.analysis
        diagnosis, fresh = analysis.diagnosis, analysis.diagnosis_up_to_date
        why = self._app.why_not()
        off(
            self._find, why, "identifies where needed, then tries every effect of the library on what is left"
        )
        text = f"Off: {why}." if why else ""
        self._why.content = f'<div class="fv fv-dim">{text}</div>' if text else ""
        self._verdict.content = verdict_html(diagnosis, fresh)
        found = diagnosis.findings if diagnosis is not None else ()
        missing = fresh and diagnosis is not None and diagnosis.verdict == "missing" and bool(found)
        self._all.visible = missing
        off(self._all, why, "adds the best finding, looks again, adds the next, until nothing is missing")
        curve = self._app.show.free_curve
        self._stopgap.content = free_html(curve)
        self._curve.folder.visible = curve is not None
        self._curve.show((free_plot(curve, height=170),))
        self._heading.content = heading_html(diagnosis) if fresh else ""
        self.findings.show(found if fresh else (), why)
        self.model.show(self._app.measurements.effects, analysis.effects, why)

    def find(self) -> None:
        """Look for what is missing in the present model."""
        self._start("looked for the missing effect", self._app.session.analysis, apply=False)

    def add(self, index: int) -> None:
        """Add finding `index`, refit, look again."""
        analysis = self._app.session.analysis
        diagnosis = analysis.diagnosis
        if diagnosis is None or not analysis.diagnosis_up_to_date or index >= len(diagnosis.findings):
            raise InputError("nothing is found for the present model: press Find the missing effect")
        text = diagnosis.findings[index].text
        self._start(f"added {effect_text_name(text)}", analysis.with_effect(text, True), apply=False)

    def add_all(self) -> None:
        """Add what is found, one after the other."""
        self._start("added all found", self._app.session.analysis, apply=True)

    def remove(self, effect: str) -> None:
        """Take an effect out of the model, refit, look again."""
        analysis = self._app.session.analysis
        if effect in analysis.effects:
            self._start(
                f"removed {effect_text_name(effect)}", analysis.with_effect(effect, False), apply=False
            )

    def stop(self) -> None:
        """Stop the search; nothing is added."""
        self._task.stop()

    def heard(self, event: JobEvent) -> None:
        """What the search has to say."""
        self._task.heard(event)

    def _progress(self, news: Progress) -> None:
        if news.iteration is not None:
            self._app.identify.iterated(news)
            return
        self._app.dock.progress(news.share or 0.0)
        self._app.say(news.text, "busy")

    def _start(self, label: str, analysis: Analysis, apply: bool) -> None:
        if not self._app.may_start("Looking for what is missing"):
            return
        self._before, self._label = self._app.session.analysis, label
        self._app.identify.begin(analysis.effects, fits=not apply)
        result = analysis.identification if analysis.up_to_date else None
        model = None if result is None else result.model
        self._task.start(analysis, "looking", diagnose_set, analysis.without_result(), model, apply)

    def _take(self, analysis: Analysis, looked: Looked) -> None:
        app, before = self._app, self._before
        if before is None or app.session.analysis.settings != before.settings:
            app.say("the settings changed meanwhile: nothing was added; look again", "bad")
            return
        diagnosis = looked.diagnosis
        if diagnosis.stopped and diagnosis.verdict != "missing" and not looked.added:
            app.say("stopped before an answer; the model is as it was")
            return
        if looked.identification is not None:
            analysis = analysis.with_identification(looked.identification, analysis.settings)
        if not looked.added or not before.diagnosis_up_to_date:
            analysis = analysis.with_diagnosis(diagnosis)
            app.change("looked for the missing effect" if looked.added else self._label, analysis)
        for index, (effects, identification) in enumerate(looked.added, start=1):
            step = diagnosis.steps[index]
            following = tuple(s.added for s in diagnosis.steps[index + 1 : index + 2] if s.added is not None)
            answer = replace(diagnosis, verdict=step.verdict, findings=following, steps=(step,))
            analysis = replace(analysis, effects=effects)
            analysis = analysis.with_identification(identification, analysis.settings).with_diagnosis(answer)
            app.change(f"added {effect_text_name(effects[-1])}", analysis)
        found = app.session.analysis.diagnosis
        if found is not None and found.verdict == "missing" and found.findings and found.findings[0].joint:
            app.show.select(joint=app.measurements.joint_index(found.findings[0].joint))
        app.say(f"{self._label} in {number(diagnosis.seconds, 2)} s")
