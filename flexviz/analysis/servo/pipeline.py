"""Identification and diagnosis of joints that follow goals, by their free motion."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from threadpoolctl import threadpool_limits

from flexviz.analysis.diagnosis.course import LEAST_SURE
from flexviz.analysis.diagnosis.result import Diagnosis, Finding, Step
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.estimation import PredictionErrors
from flexviz.analysis.identification.result import Identification, ResidualSeries
from flexviz.analysis.identification.settings import FitSettings
from flexviz.analysis.servo.estimate import ServoEstimate
from flexviz.analysis.servo.fit import FINE, fit_servos
from flexviz.analysis.servo.judge import TrajectoryJudge
from flexviz.analysis.servo.problem import REFINED, STEPS, Keys, ServoModel, ServoProblem, owners
from flexviz.base.arrays import Array
from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.base.progress import BestSoFar, Progress, ProgressCallback, StopCallback, ignore, never
from flexviz.base.search import Gain, Search, Tried
from flexviz.content.records import (
    CriterionNumbers,
    DetectionLimit,
    Move,
    ResidualSummary,
    Tie,
    Verdict,
    normalised,
    step_shares,
)
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS, ChosenEffect, choose_effects
from flexviz.model.servo import ABSENT, INDEX, RIVALS, SERVO_EFFECTS, SHARED, of_effect
from flexviz.model.servo.driven_motion import BAND
from flexviz.model.servo.model import servo_model
from flexviz.robot.model import FlexibleModel

OBSERVER = "butterworth-zero-phase"  # of the accelerations of the measured motion


LOADED = ("load_dependent_friction", "driving_friction")  # which differ by a scale of the torque, if at all
CLOSER = 0.9  # of a deviation, below which another search may find what it has hidden


class _Stopped(Exception):
    """Raised between simulations when the user stops."""


class ServoCourse:
    """One computation on a set."""

    def __init__(
        self,
        measurements: MeasurementSet,
        progress: ProgressCallback | None,
        should_stop: StopCallback | None,
    ) -> None:
        self.measurements, self.began = measurements, time.perf_counter()
        self.progress, self.should_stop = progress or ignore, should_stop or never
        self.stopped, self.searching = False, True
        self.news = Progress()
        self.given = given_effects(measurements)
        self.say(Fact("servo-stage", values={"stage": "masses"}))
        self.problem = ServoProblem(measurements, self.check, self.given)
        self.judge = TrajectoryJudge(measurements)

    def say(self, fact: Fact) -> None:
        """Report what is being done."""
        self.news = replace(self.news, text=fact.text)
        self.progress(self.news)

    def check(self) -> None:
        """Raise if the user has stopped it."""
        if self.searching and self.should_stop():
            self.stopped = True
            raise _Stopped
        self.progress(self.news)

    def finished(self, model: ServoModel, steps: int = REFINED) -> ServoEstimate:
        """A model, fitted until nothing changes."""
        problem = self.problem
        values = model.values(problem.data.owner)
        free = problem.free(model.keys)
        (fit,) = fit_servos(problem.data, [(free, values)], steps, problem.samples, turn=FINE)
        every = [one for key in model.keys for one in problem.of_joints(key)]
        order = sorted(every, key=lambda k: (k.joint, SERVO_EFFECTS.index(k.effect)))
        sure = problem.scale_determined(free, fit.values)
        for key in model.keys:
            if key.effect in LOADED and any(tie.effect in LOADED for tie in tied(problem, model, key)):
                sure[problem.data.owner == problem.data.owner[key.joint]] = False
        return ServoEstimate(
            self.measurements, problem.data, problem.samples, free, fit.values, tuple(order), sure
        )


def given_effects(measurements: MeasurementSet) -> Keys:
    """The effects of the set's own model, one for joints that have the same servo.

    Raises:
        InputError: an effect that a joint with goals cannot have.
    """
    chosen = choose_effects(measurements.effects, measurements.joints)
    for one in chosen:
        if one.effect not in SERVO_EFFECTS:
            known = ", ".join(SERVO_EFFECTS)
            text = one.text(measurements.joints)
            raise InputError(
                f'effect "{text}" is not known of joints that follow goals; expected one of {known}'
            )
    owner = owners(measurements)
    return frozenset(
        replace(one, joint=int(owner[one.joint])) if shared(one.effect) else one for one in chosen
    )


def shared(effect: str) -> bool:
    """Whether joints with the same servo have it alike."""
    return bool(SHARED[of_effect(effect)[0]])


def identify_servos(
    measurements: MeasurementSet,
    settings: FitSettings,
    progress: ProgressCallback | None = None,
    should_stop: StopCallback | None = None,
) -> Identification:
    """Estimate gain, inertia, friction and effects of every servo; arguments as of `identify`."""
    measurements = with_settings(measurements, settings)
    with threadpool_limits(1, "blas"):
        course = ServoCourse(measurements, progress, should_stop)
        course.say(Fact("servo-stage", values={"stage": "fit"}))
        course.searching = False  # a fit takes seconds, and half of one is of no use
        estimate = course.finished(course.problem.begin(), STEPS)
        return identification(course, estimate)


def identification(course: ServoCourse, estimate: ServoEstimate) -> Identification:
    """The result of a model."""
    set_, judge = course.measurements, course.judge.refreshed(estimate.values)
    errors, runs = judge.errors(estimate.values), judge.runs(estimate.values)
    parameters, noise = estimate.parameters(), np.array(judge.noise)
    names = tuple(p.label for p in parameters)
    gain = estimate.values[INDEX["gain"]]
    series = {
        g.name: ResidualSeries(
            runs[g.name].time, runs[g.name].error, gain * g.joined("tau"), runs[g.name].theta, noise
        )
        for g in set_.groups
    }
    std = np.array([p.std for p in parameters])
    summary = ResidualSummary(
        set_.joints, errors.rms, errors.rms_validation, errors.noise_floor, errors.spread,
        noise_share=tuple(np.nan_to_num(normalised(errors.noise_floor, errors.spread)).tolist()),
        units=set_.torque_units,
    )  # fmt: skip
    facts = (Fact("servo-fitted"), *notes(estimate))
    return Identification(
        set_name=set_.name, observer_name=OBSERVER, bandwidth=float(2 * np.pi * BAND),
        groups=tuple(g.name for g in set_.fit_groups),
        validation_groups=tuple(g.name for g in set_.validation_groups),
        iterations=(), seconds=time.perf_counter() - course.began, parameters=parameters,
        combinations=estimate.ratios(), residual=summary, model=estimate.model(),
        covariance=np.diag(np.nan_to_num(std) ** 2), parameter_names=names, residuals=series, facts=facts,
        stopped=course.stopped,
    )  # fmt: skip


def notes(estimate: ServoEstimate) -> Iterator[Fact]:
    """What a user has to know of the parameters."""
    joints = estimate.measurements.joints
    unknown = tuple(j for j, sure in zip(joints, estimate.determined, strict=True) if not sure)
    if unknown:
        yield Fact("no-scale", "odd", joints=unknown)


def with_settings(measurements: MeasurementSet, settings: FitSettings) -> MeasurementSet:
    """The set with the groups and effects of settings."""
    if settings.groups is not None:
        fitted, held_out = measurements.select(settings.groups)
        chosen = tuple(group for group in measurements.groups if group in (*fitted, *held_out))
        measurements = replace(measurements, groups=chosen)
    return replace(measurements, effects=(*measurements.effects, *settings.effects))


@dataclass(frozen=True, eq=False)
class _Stair:
    added: ChosenEffect | None
    values: Array
    errors: PredictionErrors
    estimate: ServoEstimate | None = None


def diagnose_servos(
    measurements: MeasurementSet,
    *,
    apply: bool = False,
    progress: ProgressCallback | None = None,
    should_stop: StopCallback | None = None,
) -> Diagnosis:
    """Which effects the servos have; arguments as of `diagnose`."""
    with threadpool_limits(1, "blas"):
        course = ServoCourse(measurements, progress, should_stop)
        trace: list[Tried] = []
        course.say(Fact("servo-stage", values={"stage": "own"}))
        course.searching = False
        first = course.problem.begin()
        course.searching = True
        best = [first]
        course.say(Fact("servo-stage", values={"stage": "search"}))

        def made(model: ServoModel) -> None:
            best[0] = model
            course.news = replace(course.news, so_far=so_far(course, first, model))

        try:
            end = concluded(course, Search(course.problem, made, trace), first)
        except _Stopped:
            end = best[0]
        course.searching = False
        return _Description(course, first, end, trace, apply).result()


def concluded(course: ServoCourse, search: Search[ServoModel], model: ServoModel) -> ServoModel:
    """The end of a search, without effects that are less likely right than wrong."""
    problem, first = course.problem, True
    while True:
        model = search.run(model)
        if first:
            first = False
            before = problem.score(model).deviation
            model = again(problem, model)
            if np.any(problem.score(model).deviation < CLOSER * before):
                continue
        sure = {key: problem.certainty(model, need) for key, need in needs(course, model).items()}
        weakest = min(sure, key=lambda key: sure[key], default=None)
        if weakest is None or sure[weakest] >= LEAST_SURE:
            return model
        problem.banned |= {weakest}
        less = reduced(course, model, weakest)
        search.told("drop", model, less, True)
        model = less


def again(problem: ServoProblem, model: ServoModel) -> ServoModel:
    """A model, fitted once more with what its free motion says of the other joints."""
    values = model.values(problem.data.owner)
    problem.refresh(values)
    owners = sorted(model.states)
    problem.fitted([(o, problem.own(model.keys, o), values) for o in owners], REFINED)
    return problem.model(model.keys)


def reduced(course: ServoCourse, model: ServoModel, key: ChosenEffect) -> ServoModel:
    """A model without an effect, and what only stands beside it."""
    problem = course.problem
    owner = int(problem.data.owner[key.joint])
    rest = model.keys - {key}
    rest -= {k for k in problem.own(rest, owner) if EFFECTS[k.effect].beside == key.effect} - course.given
    place = owner, problem.own(rest, owner)
    if place not in problem.known:
        problem.fitted([(*place, model.states[owner].values)], REFINED)
    return problem.model(rest)


def needs(course: ServoCourse, model: ServoModel) -> dict[ChosenEffect, Gain]:
    """What each effect that was added gains given the others."""
    search = Search(course.problem)
    added = model.keys - course.given
    return {key: search.gain(reduced(course, model, key), model) for key in added}


def tied(problem: ServoProblem, model: ServoModel, key: ChosenEffect) -> list[Tie]:
    """Effects that explain the motion as well as one of a model in its place."""
    owner = int(problem.data.owner[key.joint])
    own = problem.own(model.keys, owner)
    rivals = next(names for names in RIVALS if key.effect in names)
    others = [
        one for one in problem.candidates(model, owner)
        if one.effect in rivals and EFFECTS[one.effect].beside != key.effect
    ]  # fmt: skip
    asked = [(owner, (own - {key}) | {one}, model.states[owner].values) for one in others]
    fresh = [one for one in asked if one[:2] not in problem.known]
    problem.fitted(problem.placed(model, fresh), REFINED)
    out, mine = [], problem.data.owner == owner
    best = problem.nats(model.states[owner])[mine].sum()
    for other, (_, keys, _) in zip(others, asked, strict=True):
        loss = float(problem.nats(problem.known[owner, keys])[mine].sum() - best)
        if abs(loss) < THRESHOLDS.criterion.temperature:
            out.append(Tie(other.effect, problem.measurements.joints[key.joint or 0], 1.0))
    return out


def so_far(course: ServoCourse, first: ServoModel, model: ServoModel) -> BestSoFar:
    """The best model of a search that goes on."""
    problem, joints = course.problem, course.measurements.joints
    held = bool(course.measurements.validation_groups)
    now, before = (
        problem.score(one).held_out if held else problem.score(one).deviation for one in (model, first)
    )
    added = tuple(sorted(k.text(joints) for k in model.keys - course.given))
    values = {
        "added": added, "held_out": held, "rms": tuple(map(float, now)), "spread": course.judge.spread,
        "units": course.measurements.torque_units, "before": tuple(map(float, before)),
    }  # fmt: skip
    return BestSoFar(joints, values)


class _Description:
    """What a search has found, as a result."""

    def __init__(
        self, course: ServoCourse, first: ServoModel, end: ServoModel, trace: Sequence[Tried], apply: bool
    ) -> None:
        self.course, self.first, self.end, self.trace, self.apply = course, first, end, trace, apply
        self.problem, self.joints = course.problem, course.measurements.joints
        self.judge = course.judge.refreshed(end.values(self.problem.data.owner))
        self.gains = needs(course, end)

    def result(self) -> Diagnosis:
        """The result."""
        course = self.course
        course.say(Fact("servo-stage", values={"stage": "stairs"}))
        stairs = self.staircase()
        last: Verdict = "unknown" if self.problem.errs(self.end).any() else "nothing-missing"
        found = self.findings(stairs)
        taken = [
            Step(
                finding, stair.errors.rms, stair.errors.rms_validation, stair.errors.groups,
                stair.errors.noise_floor, self.model_of(stair),
                verdict="missing" if k < len(found) else last, units=stair.errors.units,
            )
            for k, (finding, stair) in enumerate(zip((None, *found), stairs, strict=True))
        ]  # fmt: skip
        shown = stairs[-1] if self.apply else stairs[0]
        if not self.apply:
            taken = [replace(taken[0], verdict="missing" if found else last)]
        estimate = shown.estimate
        assert estimate is not None
        verdict: Verdict = "missing" if found else last
        if course.stopped and not self.trace:
            verdict = "not-searched"
        told = list(notes(estimate))
        if last == "unknown":
            told.append(Fact("servo-left", "odd", joints=self.joints_left()))
        return Diagnosis(
            set_name=course.measurements.name, verdict=verdict,
            findings=tuple(sorted(found, key=lambda f: -(f.share or 0.0))), steps=tuple(taken),
            effects=estimate.entries(), parameters=estimate.parameters(),
            seconds=time.perf_counter() - course.began, stopped=course.stopped, notes=tuple(told),
            model=estimate.model(), torque_spread=course.judge.spread,
            trace=tuple(map(self.told, self.trace)), criterion=self.criterion(),
            limit=self.limit(last, shown),
        )  # fmt: skip

    def staircase(self) -> list[_Stair]:
        """The set's own model, then one effect more at a time, the weightiest first."""
        problem, owner = self.problem, self.problem.data.owner
        gains = self.gains
        order = sorted(gains, key=lambda key: -gains[key].delta)
        order.sort(key=lambda key: EFFECTS[key.effect].beside is not None)
        models = [self.first]
        for k in range(1, len(order)):
            keys = self.course.given | frozenset(order[:k])
            asked = [
                (o, own, self.end.states[o].values)
                for o in self.end.states
                if (o, own := problem.own(keys, o)) not in problem.known
            ]
            if asked:
                problem.fitted(asked, REFINED)
            models.append(problem.model(keys))
        if order:
            models.append(self.end)
        ends = [self.course.finished(one) for one in (models[0], models[-1])]
        values = [ends[0].values, *(m.values(owner) for m in models[1:-1])]
        values += [ends[1].values] if order else []
        errors = self.judge.many(values)
        estimates = [ends[0], *(None for _ in models[1:-1]), *([ends[1]] if order else [])]
        stairs = [_Stair(None, values[0], errors[0], estimates[0])]
        for key, *rest in zip(order, values[1:], errors[1:], estimates[1:], strict=True):
            stairs += [_Stair(one, *rest) for one in problem.of_joints(key)]
        return stairs

    def findings(self, stairs: Sequence[_Stair]) -> list[Finding]:
        """One per added effect, in the order of the staircase."""
        gains, last, out = self.gains, stairs[-1], []
        spread = self.course.judge.spread
        shares = step_shares([stair.errors for stair in stairs], spread)[1:]
        for (before, after), share in zip(pairwise(stairs), shares, strict=True):
            key = after.added
            assert key is not None and last.estimate is not None
            need = gains[self.problem.of_servo(key)]
            sure = self.problem.certainty(self.end, need)
            old, new = (np.square(one.errors.stated).sum() for one in (before, after))
            out.append(
                Finding(
                    key.effect, self.joints[key.joint or 0], score=float(np.clip(1 - new / old, 0.0, 1.0)),
                    confidence=sure, parameters=last.estimate.of_effect(key), gain=float(need.delta),
                    share=share, inseparable_from=tuple(self.ties(key)),
                )
            )  # fmt: skip
        return out

    def ties(self, key: ChosenEffect) -> list[Tie]:
        """Effects of the joint that explain its motion as well."""
        own = self.joints[key.joint or 0]
        return [replace(tie, joint=own) for tie in tied(self.problem, self.end, self.problem.of_servo(key))]

    def joints_left(self) -> tuple[str, ...]:
        return tuple(j for j, left in zip(self.joints, self.problem.errs(self.end), strict=True) if left)

    def model_of(self, stair: _Stair) -> FlexibleModel:
        """Its model."""
        order = tuple(
            k for k in sorted(self.end.keys, key=lambda k: (k.joint, k.effect)) if self.has(stair, k)
        )
        return servo_model(self.course.measurements.robot, stair.values, order)

    def has(self, stair: _Stair, key: ChosenEffect) -> bool:
        return any(stair.values[p, key.joint] != ABSENT[p] for p in of_effect(key.effect))

    def told(self, tried: Tried) -> Move:
        """A move of the search for the result."""
        added, removed = (
            tuple(sorted(e.text(self.joints) for e in es)) for es in (tried.added, tried.removed)
        )
        why = "" if tried.accepted else Fact("move-refused", values={"why": tried.gain.why})
        return Move(tried.kind, added, removed, tried.gain.delta, 0.0, tried.accepted, "coarse", why)

    def criterion(self) -> CriterionNumbers:
        """The numbers of J."""
        found = self.problem.criterion
        samples, least = (tuple(map(float, values)) for values in (found.samples, found.least))
        return CriterionNumbers("coarse", self.joints, samples, least, found.of_parameter, found.of_effect)

    def limit(self, last: Verdict, shown: _Stair) -> DetectionLimit | None:
        """Down to what nothing is missing."""
        if last != "nothing-missing" or self.course.stopped:
            return None
        spread = np.array(self.course.judge.spread)
        share = np.maximum(self.problem.least, shown.errors.stated) / np.maximum(spread, 1e-12)
        return DetectionLimit(float(share.max()), "noise")
