"""`design`: the motions and payloads from which parameters, or an effect, are learned best."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from flexviz.analysis.designing.criterion import BestSeparation, DesignCriterion, least_errors
from flexviz.analysis.designing.information import Columns
from flexviz.analysis.designing.motion import MotionSpace, Reached, shrunk
from flexviz.analysis.designing.prediction import PredictedError, predict_errors
from flexviz.analysis.designing.search import GroupSearch
from flexviz.analysis.designing.settings import DesignSettings, check_band, choose_payloads, limits_of
from flexviz.analysis.designing.subject import Planned, Subject, subject_of
from flexviz.base.arrays import Array
from flexviz.base.errors import Cancelled, InputError
from flexviz.base.facts import Fact
from flexviz.base.names import names_of
from flexviz.base.progress import Progress, ProgressCallback, StopCallback, ignore, never
from flexviz.data.measurements import MeasurementSet
from flexviz.model.simulation import Plan

STEP = 0.02  # [s] of predicted motions in the search
STEP_WITH_EFFECTS = 0.004  # … where effects need the reversals of the velocity
FINE_STEP = 0.002  # [s] at which the limits of the result are checked
FINE_SHRINK, MOST_FINE_SHRINKS = 0.98, 40
NOISE_SEED = 1  # of the predicted record of which the errors are computed


@dataclass(frozen=True, eq=False)
class DesignedGroup:
    """A group to record.

    Attributes:
        planned: name, payload, reference and duration.
        used: what it uses of every limit, the most used first.
    """

    planned: Planned
    used: tuple[Reached, ...]


@dataclass(frozen=True, eq=False)
class Design:
    """Groups to record, and what they are expected to show.

    Attributes:
        subject: name of the robot or set.
        joints: names.
        groups: to record.
        criterion: what was minimised or maximised.
        unit: of `before` and `value`.
        before, value: the criterion of a random design, and of this one.
        separates: the two effects that it tells apart; empty for least errors.
        gains: of each of the two effects over the other one, in log likelihood, recorded groups included.
        recorded_gains: by the recorded groups alone.
        errors: predicted standard errors, with these groups alone.
        beside: names of the recorded groups that count as well.
        step: of the record that was assumed [s].
        seed, evaluations, seconds: of the search.
        stopped: it was stopped; the best design so far.
    """

    subject: str
    joints: tuple[str, ...]
    groups: tuple[DesignedGroup, ...]
    criterion: Fact
    unit: str
    before: float
    value: float
    separates: tuple[str, ...]
    gains: tuple[float, ...]
    recorded_gains: tuple[float, ...]
    errors: tuple[PredictedError, ...]
    beside: tuple[str, ...]
    step: float
    seed: int
    evaluations: int
    seconds: float
    stopped: bool = False


def design(
    source: str | Path | Plan | MeasurementSet,
    *,
    parameters: str | Iterable[str] = (),
    separate: Sequence[str] = (),
    effects: str | Iterable[str] = (),
    settings: DesignSettings | None = None,
    beside: bool | None = None,
    seed: int = 0,
    settings_file: str | Path | None = None,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
) -> Design:
    """Choose trajectory–payload groups within the robot's limits.

    A motion is a finite Fourier series per joint. With the equation's Jacobian J along the predicted run and
    the spectrum S of its noise, a group's information is Σ Jᴴ S⁻¹ J; it adds up over groups. Minimised is the
    trace or log det of the parameters' covariance, or maximised the gain that decides between two effects.

    Args:
        source: a measurement set, its folder, a preset of the simulator, a `.urdf`, or a plan. A set is
            identified first; the model of the others is that of their simulation.
        parameters: whose standard errors are minimised, "stiffness" or "stiffness:joint1"; default:
            stiffness, motor inertia and viscous friction of all joints.
        separate: two effects to tell apart instead, "backlash:joint2".
        effects: further effects of the model.
        settings: number and length of the groups, limits, effort; default: `DesignSettings()`.
        beside: count the groups that a set has already; default: where effects are to be told apart.
        seed: of the search.
        settings_file: what errors call the settings.
        progress: called during the search.
        should_stop: asked after every evaluation; the best design so far is returned.

    Raises:
        InputError: names that do not exist, limits within which the robot cannot move, a set that cannot be
            identified.
    """
    began = time.perf_counter()
    separate = tuple(separate)
    if len(separate) not in (0, 2) or len(set(separate)) != len(separate):
        raise InputError(f"effects to tell apart: found {', '.join(separate)}; expected two different ones")
    settings = settings or DesignSettings()
    check_band(settings, settings_file)
    with threadpool_limits(1, "blas"):
        subject = subject_of(source, names_of(effects), separate, progress=progress, should_stop=should_stop)
        limits = limits_of(subject.robot, settings.limits, settings_file)
        space = MotionSpace(
            subject.robot, settings, limits, choose_payloads(settings, subject.payloads, settings_file)
        )
        counted = bool(separate) if beside is None else beside
        work = _Work(subject, space, names_of(parameters), counted, seed, progress, should_stop)
        found = work.run()
    return replace(found, seconds=time.perf_counter() - began)


@dataclass
class _Work:
    """One design."""

    subject: Subject
    space: MotionSpace
    parameters: tuple[str, ...]
    beside: bool
    seed: int
    progress: ProgressCallback
    should_stop: StopCallback

    def run(self) -> Design:
        subject, settings = self.subject, self.space.settings
        recorded = subject.recorded if self.beside else None
        # random motions, from which identification would take its prior
        rng = np.random.default_rng(self.seed)
        planned = [self.space.planned(rng.random(self.space.size), f"d{k}") for k in range(2)]
        example = subject.predicted(planned, STEP)
        columns = Columns(example, subject.models, subject.noise, subject.step)
        known = np.zeros((columns.size, columns.size))
        if recorded is not None:
            known = columns.gram(recorded, recorded.fit_groups)
        criterion = self._criterion(columns, columns.prior(recorded or example), example)
        slow = not any(model.effects for model in subject.models)
        step = STEP if slow else STEP_WITH_EFFECTS
        total = settings.passes * settings.groups * settings.evaluations
        tell = _Teller(total, criterion, self.progress, self.should_stop)
        search = GroupSearch(subject, self.space, columns.gram, criterion, known, step, self.seed, tell)
        before, stopped = search.start(), False
        tell.patient = False  # there is a design to keep
        try:
            for _ in range(settings.passes):
                for k in range(settings.groups):
                    search.improve(k, settings.evaluations)
        except Cancelled:
            stopped = True
        return self._result(search, columns, before, recorded, stopped)

    def _criterion(self, columns: Columns, prior: Array, example: MeasurementSet) -> DesignCriterion:
        if columns.contenders:
            first, second = (
                np.array([columns.labels.index(label) for label in one.own], int)
                for one in columns.contenders
            )
            gram = columns.gram(example, example.fit_groups)
            return BestSeparation(prior, (first, second)).without_special_case(gram)
        geometric = self.space.settings.criterion == "log-det"
        return least_errors(columns.labels, columns.x, prior, self.parameters, geometric)

    def _result(
        self,
        search: GroupSearch,
        columns: Columns,
        before: float,
        recorded: MeasurementSet | None,
        stopped: bool,
    ) -> Design:
        subject, criterion, known = self.subject, search.criterion, search.known
        groups = [self._within(trial.planned) for trial in search.groups]
        record = subject.predicted([g.planned for g in groups], subject.step, NOISE_SEED)
        errors = predict_errors(record, subject.model)
        gains = recorded_gains = ()
        if isinstance(criterion, BestSeparation):
            gains = criterion.gains(known + sum(t.gram for t in search.groups))
            recorded_gains = criterion.gains(known) if recorded is not None else ()
        return Design(
            subject=subject.name,
            joints=subject.robot.joints,
            groups=tuple(groups),
            criterion=criterion.fact,
            unit=criterion.unit,
            before=criterion.shown(before),
            value=criterion.shown(search.value),
            separates=tuple(one.text for one in columns.contenders),
            gains=gains,
            recorded_gains=recorded_gains,
            errors=errors,
            beside=tuple(g.name for g in recorded.fit_groups) if recorded is not None else (),
            step=subject.step,
            seed=self.seed,
            evaluations=search.evaluations,
            seconds=0.0,
            stopped=stopped,
        )

    def _within(self, planned: Planned) -> DesignedGroup:
        """The group, with its amplitude reduced until it keeps the limits on a fine grid."""
        used: list[Reached] = []
        for _ in range(MOST_FINE_SHRINKS):
            (group,) = self.subject.predicted([planned], FINE_STEP).groups
            used = self.space.used(group)
            if used[0].share <= 1.0:
                break
            planned = shrunk(planned, FINE_SHRINK)
        return DesignedGroup(planned, tuple(used))


@dataclass
class _Teller:
    """Progress of the search; raises `Cancelled` when asked to stop, unless `patient`."""

    total: int
    criterion: DesignCriterion
    progress: ProgressCallback
    should_stop: StopCallback
    patient: bool = True

    def __call__(self, done: int, value: float) -> None:
        shown = f", {self.criterion.shown(value):.3g} {self.criterion.unit}" if np.isfinite(value) else ""
        self.progress(Progress(f"designing{shown}".rstrip(), min(done / self.total, 1.0)))
        if self.should_stop() and not self.patient:
            raise Cancelled
