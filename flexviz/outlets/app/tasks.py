"""Tasks on a measurement set: open, identify, check, sweep, diagnose, simulate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis import (
    BestModel,
    Diagnosis,
    PredictionErrors,
    diagnose,
    errors_along,
    maps_of,
    with_free_curve,
)
from flexviz.analysis.identification import Identification, SweepResult, identify, sweep
from flexviz.analysis.laws import LawThroughData, laws_of
from flexviz.base.errors import Cancelled
from flexviz.base.facts import Fact
from flexviz.base.iteration import Iteration
from flexviz.base.jobs import Result, Task
from flexviz.base.progress import BestSoFar, Progress, ProgressCallback, StopCallback, ignore, never
from flexviz.content.records import ResidualMap
from flexviz.content.session import (
    Analysis,
    Session,
    diagnosed_models,
)
from flexviz.content.view import solver_stages
from flexviz.data.measurements import MeasurementSet
from flexviz.model.simulation import Run, replay
from flexviz.outlets.app.sets import cached_set, chosen_set, open_set
from flexviz.outlets.app.state import Opened, SearchNews
from flexviz.robot.model import FlexibleModel

Bandwidth = float | tuple[float, ...]
WARM = ("flexviz.outlets.app.tasks",)  # with all that its tasks import


class SetTask(Task[Result]):
    """A task on the open measurement set, stopped when another one is opened."""


class IdleTask(SetTask[Result]):
    """A background task, stopped by a fit."""


@dataclass(frozen=True)
class Identify(SetTask["Identification"]):
    """Identify with these settings; when stopped, returns the result so far."""

    analysis: Analysis

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> Identification:
        return _identify(self.analysis, progress=progress, should_stop=should_stop)


@dataclass(frozen=True)
class CheckParameters(IdleTask["Identification"]):
    """Trial fit: what these groups and effects can identify."""

    analysis: Analysis

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> Identification:
        return _identify(self.analysis, refine=False, progress=progress, should_stop=should_stop)


def _identify(analysis: Analysis, **more: Any) -> Identification:
    """Identify with the settings of the analysis, but for those in `more`."""
    return identify(chosen_set(analysis), analysis.fit, **more)


@dataclass(frozen=True)
class Sweep(SetTask["SweepResult"]):
    """Identify at several bandwidths [rad/s]; when stopped, returns those that are done."""

    analysis: Analysis
    bandwidths: tuple[float, ...]

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> SweepResult:
        return sweep(
            chosen_set(self.analysis),
            self.analysis.fit.observer,
            self.bandwidths,
            effects=self.analysis.effects,
            gains=self.analysis.fit.gains,
            progress=progress,
            should_stop=should_stop,
        )


@dataclass(frozen=True, eq=False)
class DiagnosedSet:
    """Result of `Diagnose`."""

    diagnosis: Diagnosis  # of the initial model
    identification: Identification | None  # of the initial model; None if already known
    added: tuple[Identification, ...] = ()  # of the later `diagnosed_models`, with the diagnosis's values


class LeadingLaw:
    """Passes the news of a search on, with the law of the best model's leading effect through its data."""

    def __init__(self, measurements: MeasurementSet, progress: ProgressCallback) -> None:
        self._measurements, self._progress = measurements, progress
        self._best: BestSoFar | None = None
        self._law: LawThroughData | None = None

    def __call__(self, news: Progress) -> None:
        best = news.so_far
        if isinstance(best, BestModel) and best is not self._best:
            self._best, self._law = best, None
            if best.effects:
                leader = max(best.effects, key=lambda text: news.alone.get(text, 0.0))
                drawn = laws_of(self._measurements, best.parameters, best.effects, only=leader)
                self._law = drawn[0] if drawn else None
        self._progress(SearchNews(**vars(news), law=self._law))


@dataclass(frozen=True)
class Diagnose(SetTask[DiagnosedSet]):
    """Identify unless `known` is given, then diagnose; `apply` adds all findings.

    `known` is the bandwidth of the model that has been identified [rad/s]. Reports the stages of the
    diagnosis, then the iterations of the identification.
    """

    analysis: Analysis
    known: Bandwidth | None
    apply: bool

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> DiagnosedSet:
        analysis, identification, bandwidth = self.analysis, None, self.known
        measurements = chosen_set(analysis)
        measurements = replace(measurements, effects=(*measurements.effects, *analysis.effects))
        diagnosis = diagnose(
            measurements,
            apply=self.apply,
            free_curve=False,  # has a button of its own
            survey=True,
            progress=LeadingLaw(measurements, progress),
            should_stop=should_stop,
        )
        if bandwidth is None:
            if diagnosis.stopped and not diagnosis.findings:
                raise Cancelled
            if not diagnosis.stopped:
                identification = _identify(analysis, progress=progress, should_stop=should_stop)
            if identification is None or identification.stopped:
                # who stops does not wait for a fit: the diagnosis has one
                model = diagnosis.steps[0].model if diagnosis.steps else None
                identification = _identify(analysis, refine=False, model=model)
            bandwidth = bandwidth_of(identification)
        added: list[Identification] = []
        for found in diagnosed_models(diagnosis, measurements.joints)[1:] if self.apply else ():
            model = found.diagnosis.steps[0].model
            if model is None or should_stop():
                break
            analysis = analysis.with_effects(found.effects)
            added.append(_identify(analysis, bandwidth=bandwidth, refine=False, model=model))
        return DiagnosedSet(diagnosis, identification, tuple(added))


@dataclass(frozen=True, eq=False)
class AddFreeCurve(SetTask[DiagnosedSet]):
    """Add the free curve of an "unknown" diagnosis to its model, and fit both together."""

    analysis: Analysis
    diagnosis: Diagnosis
    bandwidth: Bandwidth | None

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> DiagnosedSet:
        def tell(what: Fact | str) -> None:
            if should_stop():
                raise Cancelled
            if what:
                progress(Progress(str(what)))

        longer = with_free_curve(chosen_set(self.analysis), self.diagnosis, tell)
        last = longer.steps[-1]
        assert last.added is not None and last.model is not None
        effects = (*self.analysis.effects, last.added.text)
        identification = _identify(
            self.analysis, effects=effects, bandwidth=self.bandwidth, refine=False, model=last.model
        )
        return DiagnosedSet(replace(longer, findings=(), steps=(last,)), identification)


def bandwidth_of(result: Identification) -> Bandwidth:
    """One number, or one per joint [rad/s]."""
    return (
        result.bandwidth
        if isinstance(result.bandwidth, float)
        else tuple(np.ravel(result.bandwidth).tolist())
    )


def open_fitted(path: Path) -> Opened:
    """Read a measurement set, and identify its model: a session with nothing to undo."""
    opened = open_set(path)
    start = Session.of(opened.measurements)
    fitted = start.analysis.with_identification(_identify(start.analysis), start.analysis.settings)
    session = replace(start, present=replace(start.present, analysis=fitted))
    task = JudgeErrors.of(fitted)
    return replace(opened, session=session, judged=task.run() if task else ())


@dataclass(frozen=True)
class MapResiduals(IdleTask["tuple[ResidualMap, ...]"]):
    """Residual maps of a model: every joint against every variable."""

    analysis: Analysis
    model: FlexibleModel

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> tuple[ResidualMap, ...]:
        def check() -> None:
            if should_stop():
                raise Cancelled

        return maps_of(chosen_set(self.analysis), self.model, self.analysis.effects, check)


@dataclass(frozen=True)
class JudgeErrors(IdleTask["tuple[PredictionErrors, ...]"]):
    """Errors of a model, and at the `ends` of the stages that led to it, in the band for comparing models."""

    analysis: Analysis
    model: FlexibleModel
    ends: tuple[Iteration, ...] = ()

    @staticmethod
    def of(state: Analysis) -> JudgeErrors | None:
        """The task for the fit of an analysis; None without one."""
        fit, used = state.identification, state.fitted
        if fit is None or used is None:
            return None
        settings = replace(state.without_result().with_fit(effects=used.effects), roles=used.roles)
        ends = (fit.iterations[last] for _, _, last in solver_stages(fit.iterations))
        return JudgeErrors(settings, fit.model, (*fit.iterations[:1], *ends))

    def run(
        self, progress: ProgressCallback = ignore, should_stop: StopCallback = never
    ) -> tuple[PredictionErrors, ...]:
        analysis = self.analysis
        found = errors_along(chosen_set(analysis), self.model, analysis.effects, self.ends)
        return tuple(replace(errors, residual=errors.residual[:0]) for errors in found)


@dataclass(frozen=True, eq=False)
class DrawLaws(IdleTask["tuple[LawThroughData, ...]"]):
    """The laws of a model's effects through the data; covariance (P, P) of its parameters."""

    analysis: Analysis
    model: FlexibleModel
    covariance: NDArray[np.float64]

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> tuple[LawThroughData, ...]:
        return laws_of(chosen_set(self.analysis), self.model, self.analysis.effects, self.covariance)


@dataclass(frozen=True)
class Replay(IdleTask["Run"]):
    """Simulate the identified model along one group's recording."""

    path: Path
    model: FlexibleModel
    group: str

    def run(self, progress: ProgressCallback, should_stop: StopCallback) -> Run:
        measurements = cached_set(self.path)
        return replay(
            measurements.robot,
            self.model,
            measurements.group(self.group),
            measurements.kp,
            measurements.kd,
            torque_hold=measurements.torque_hold,
            progress=progress,
            should_stop=should_stop,
        )
