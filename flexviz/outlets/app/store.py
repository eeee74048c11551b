"""The store: the application's state and its change signal.

Steps, plots and the scene know only the store: they change it through its methods and draw its content when
notified. Only the loop's thread calls it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from flexviz.analysis.diagnosis import PredictionErrors
from flexviz.analysis.diagnosis import Step as DiagnosisStep
from flexviz.base.errors import InputError
from flexviz.base.jobs import InThread, Result, Task
from flexviz.base.progress import Progress, ProgressCallback
from flexviz.content.records import ResidualMap
from flexviz.content.scene import RobotMotion, nice_factor
from flexviz.content.session import Analysis, ModelStep, Session, model_chain
from flexviz.content.view import progress_text, shown_errors, worst_joint
from flexviz.data.measurements import MeasurementSet, require_unchanged
from flexviz.outlets.app.events import TaskRunner
from flexviz.outlets.app.playback import PlaybackClock, part_of
from flexviz.outlets.app.sets import open_set
from flexviz.outlets.app.state import (
    Activity,
    Changed,
    ChangeSignal,
    Derived,
    DerivedResults,
    FitProgress,
    Highlight,
    LiveTuning,
    Message,
    Opened,
    SearchSoFar,
    Tone,
    ViewSettings,
)
from flexviz.outlets.app.tasks import IdleTask, SetTask

PAUSE = 3.0  # [s] without a change that ends the dragging of a control


class Store(ChangeSignal):
    """The state of the application."""

    def __init__(self, opened: Opened, step: str, tasks: TaskRunner, alert: Callable[[str], None]) -> None:
        """`step` is the first step; `alert` shows a failure to the user."""
        super().__init__()
        self.tasks, self._alert = tasks, alert
        self.clock = PlaybackClock()  # the displayed instant
        self.step = step
        self.view = ViewSettings()
        self.activity: Activity | None = None  # the task that the user waits for
        self.saved: Session | None = None  # the session when last saved
        self.last_action = ""  # for a log
        self._changed = 0.0  # last change of the analysis [s, monotonic]
        self.news = Progress()  # of the activity, the latest
        self._begin(opened)

    def open(self, opened: Opened) -> None:
        """Show a set or session."""
        self.tasks.stop(SetTask)
        self._begin(opened)
        self.tell(Changed.OPENED)

    def _begin(self, opened: Opened) -> None:
        self.opened, self.folder = opened, opened.folder  # folder of the saved session, or None
        self.session = opened.session or Session.of(opened.measurements)
        self.joint, self.group = worst_joint(self.analysis.identification), opened.measurements.groups[0]
        self.view = replace(self.view, deflection=None, beside=None)
        self.fit, self.check, self.message = FitProgress(), "", Message()
        self.highlight: Highlight | None = None
        self.live: LiveTuning | None = None
        self.search = SearchSoFar()
        self.kept = DerivedResults()
        if opened.judged:
            self.derived.judge(opened.judged)
        self._span()
        self._choose_factor()

    @property
    def measurements(self) -> MeasurementSet:
        return self.opened.measurements

    @property
    def analysis(self) -> Analysis:
        return self.session.analysis

    def open_path(self, path: Path, what: str = "") -> None:
        """Open a set or session; `what` names it in the status line."""

        def failed(reason: str) -> None:
            self.fail(reason)
            self.tell(Changed.FOLDER)  # the selector returns to the open one

        self.say(f"opening {what or path.name}", "busy")
        self.tasks.start(InThread(open_set, path), self.open, failed=failed)

    def set_folder(self, folder: Path | None) -> None:
        """Set the folder of the session (None: a new one when saved)."""
        self.folder = folder
        self.tell(Changed.FOLDER)

    def mark_saved(self, session: Session, folder: Path) -> None:
        """Record that a session was saved."""
        self.saved, self.folder = session, folder
        self.tell(Changed.SAVED | Changed.FOLDER)

    def change(self, label: str, analysis: Analysis) -> None:
        """Set a new state of the analysis; changes with one label are one step until there is a pause."""
        before, self._changed = self._changed, time.monotonic()
        merge = self._changed - before < PAUSE
        self._go(label, self.session.then(label, analysis, merge=merge), Changed.NEW_STATE)

    def undo(self) -> None:
        self._go(f"undone: {self.session.present.label}", self.session.undo(), Changed.HISTORY)

    def redo(self) -> None:
        session = self.session.redo()
        self._go(f"redone: {session.present.label}", session, Changed.HISTORY)

    def _go(self, action: str, session: Session, change: Changed) -> None:
        before, self.session, self.search = self.analysis, session, SearchSoFar()
        after = self.analysis
        if after.same_as(before):
            return
        self.last_action = action
        if change & Changed.HISTORY:
            self.message = Message(action)
        change |= Changed.ANALYSIS | Changed.SEARCH
        if after.fit.tuning != before.fit.tuning:
            change |= Changed.OBSERVER
        if after.identification is not before.identification:
            change |= Changed.RESULT
            self._choose_factor()
        if after.diagnosis is not before.diagnosis or after.model_steps != before.model_steps:
            change |= Changed.DIAGNOSIS
        self.tell(change)

    @property
    def chain(self) -> list[tuple[ModelStep, Analysis | None]]:
        """The models of the staircase, also those beyond the present one, with the states that show them."""
        return model_chain(self.session)

    def show_model(self, index: int) -> None:
        """Show an earlier or later model of the staircase everywhere; its results are known."""
        chain = self.chain
        if self.may_start("Another model") and 0 <= index < len(chain):
            state = chain[index][1]
            if state is None:
                raise InputError("the results of this model are not kept: press Undo, or diagnose again")
            self.change(f"model {index} shown", state)

    def note_recording(self, file: Path) -> None:
        self.session = self.session.with_recording(file)

    @property
    def derived(self) -> Derived:
        """Derived data of the current result."""
        return self.kept.keep(self.analysis.identification, current=True)

    @property
    def motion(self) -> RobotMotion:
        """The motion of both robots in the selected group."""
        return self.derived.motion(self.measurements, self.group)

    @property
    def beside(self) -> tuple[ModelStep, Derived, RobotMotion] | None:
        """The model that is compared with the shown one, its derived data and its motion."""
        chain, at = self.chain if self.view.beside is not None else [], self.view.beside
        if at is None or not 0 <= at < len(chain):
            return None
        step, state = chain[at]
        if state is None or state.identification in (None, self.analysis.identification):
            return None
        derived = self.kept.keep(state.identification)
        return step, derived, derived.motion(self.measurements, self.group)

    def _choose_factor(self) -> None:
        """Choose the factor of the deflection as soon as there is one to draw; from then on it stays."""
        if self.view.deflection is None and (factor := nice_factor(self.motion)) is not None:
            self.view = replace(self.view, deflection=factor)

    @property
    def deflection(self) -> float:
        """Factor of the drawn deflection."""
        return 1.0 if self.view.deflection is None else self.view.deflection

    @property
    def maps(self) -> tuple[ResidualMap, ...]:
        """Residual maps of the current model, from the diagnosis or from idle work."""
        diagnosis = self.analysis.current_diagnosis
        return diagnosis.maps if diagnosis and diagnosis.maps else self.derived.maps

    @property
    def errors(self) -> PredictionErrors | DiagnosisStep | None:
        """Errors of the current model, from the diagnosis or from idle work; None while unknown."""
        return shown_errors(self.analysis, self.derived.errors)

    def select(self, *, joint: int | None = None, group: str | None = None) -> None:
        if joint is not None and joint != self.joint and 0 <= joint < self.measurements.n:
            self.joint = joint
            self.tell(Changed.JOINT)
        if group is not None and group != self.group.name:
            self.group = self.measurements.group(group)
            self._span()
            self.tell(Changed.GROUP)

    def set_span(self, first: float, last: float) -> None:
        """Play and draw only `first` … `last` [s] of the selected group; too short a span means all of it."""
        self._span(first, last)
        self.tell(Changed.SPAN)

    def _span(self, first: float = -math.inf, last: float = math.inf) -> None:
        segments = self.group.segments
        self.span = part_of((float(segments[0].time[0]), float(segments[-1].time[-1])), first, last)
        self.clock.span(*self.span)

    @property
    def joint_name(self) -> str:
        return self.measurements.joints[self.joint]

    def go(self, step: str) -> None:
        self.step = step
        self.tell(Changed.STEP)

    def set_view(self, view: ViewSettings) -> None:
        self.view = view
        self.tell(Changed.VIEW)

    def set_highlight(self, highlight: Highlight | None) -> None:
        """Highlight these instants; None for none."""
        if highlight is not None or self.highlight is not None:
            self.highlight = highlight
            self.tell(Changed.HIGHLIGHT)

    def set_live(self, live: LiveTuning | None) -> None:
        """Show the residual with the tuning that is tried; None: as it was fitted."""
        self.live = live
        self.tell(Changed.LIVE)

    def set_check(self, sentence: str) -> None:
        """Set the sentence on what can be identified (HTML)."""
        if sentence != self.check:
            self.check = sentence
            self.tell(Changed.CHECK)

    def say(self, text: str, tone: Tone = "") -> None:
        """Write the status line."""
        self.message = Message(text, tone)
        self.tell(Changed.MESSAGE)

    def fail(self, reason: str) -> None:
        """Show a failure in the status line and as an alert."""
        self.say(reason, "bad")
        self._alert(reason)

    def await_task(
        self,
        task: Task[Result],
        done: Callable[[Result], None],
        *,
        begin: str,
        stopped: str,
        progress: ProgressCallback | None = None,
        share: float = 0.0,
        fit: FitProgress | None = None,
    ) -> None:
        """Start a task that the user waits for, one at a time; see `TaskRunner.start`.

        `begin` and `stopped` are the status line at the start, and when stopped without a result; `share` is
        the initial progress; `fit` collects the iterations of a fit, which stops idle work. InputError if a
        `SetTask` is to read files of the set that have changed.
        """
        if isinstance(task, SetTask):
            require_unchanged(self.measurements)

        def end(act: Callable[[], None]) -> None:
            self.activity = None
            try:
                act()
            finally:
                self.tell(Changed.ACTIVITY)

        def finish(result: Result) -> None:
            if isinstance(task, SetTask):
                require_unchanged(self.measurements)
            done(result)

        if fit is not None:
            self.tasks.stop(IdleTask)
            self.fit, self.search = fit, SearchSoFar()
            self.tell(Changed.FIT)
        self.activity = Activity(task, share)
        self.say(begin, "busy")
        self.tasks.start(
            task,
            done=lambda result: end(lambda: finish(result)),
            progress=progress or self.report,
            failed=lambda reason: end(lambda: self.fail(reason)),
            stopped=lambda: end(lambda: self.say(stopped)),
        )
        self.tell(Changed.ACTIVITY | Changed.SEARCH)

    def report(self, news: Progress) -> None:
        """Show the progress of the activity."""
        if news.iteration is not None:
            self.fit.iterations.append(news.iteration)
            self.tell(Changed.FIT)
            self.say(progress_text(self.fit.iterations), "busy")
            return
        if self.activity is not None:
            self.activity.share, before = news.share or 0.0, self.search
            self.news, self.search = news, before.updated(news)
            self.tell(Changed.PROGRESS if self.search is before else Changed.PROGRESS | Changed.SEARCH)
        if self.activity is None or self.activity.stopped is None:
            self.say(news.line, "busy")

    def stop(self) -> None:
        """Stop the activity, which concludes what it has found however long that takes; again: at once."""
        if self.activity is not None and (grace := self.activity.stop()) is not None:
            self.tasks.stop(type(self.activity.task), grace)
            self.say("stopping: what was found is kept; Stop again ends it at once", "busy")

    @property
    def running(self) -> bool:
        return self.activity is not None

    def runs(self, kind: type[Task[Any]]) -> bool:
        """Whether the user waits for a task of this class."""
        return self.activity is not None and isinstance(self.activity.task, kind)

    @property
    def why_not(self) -> str:
        """Why no fit can be started now, or ""."""
        if self.running:
            return "a computation is running (Stop ends it)"
        return "" if self.analysis.groups_with("fit") else "no group is set to Fit in step Data"

    def may_start(self, what: str) -> bool:
        """Whether a fit can be started now; otherwise the status line says why not."""
        if self.why_not:
            self.say(f"{what} is off: {self.why_not}", "bad")
        return not self.why_not
