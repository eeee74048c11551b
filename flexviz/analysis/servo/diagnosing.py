"""Diagnosis of joints that follow goals: the search, and what it has found as a result."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from threadpoolctl import threadpool_limits

from flexviz.analysis.diagnosis import Diagnosis, Finding, Step
from flexviz.analysis.estimation import PredictionErrors, Stopped
from flexviz.analysis.servo.conclusion import concluded, needs, tied
from flexviz.analysis.servo.course import ServoCourse
from flexviz.analysis.servo.estimate import ServoEstimate
from flexviz.analysis.servo.fits import REFINED, ServoModel
from flexviz.analysis.servo.identifying import notes
from flexviz.base.arrays import Array
from flexviz.base.facts import Fact
from flexviz.base.progress import BestSoFar, ProgressCallback, StopCallback
from flexviz.base.search import Search, Tried
from flexviz.content.records import CriterionNumbers, DetectionLimit, Move, Tie, Verdict, step_shares
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS, ChosenEffect
from flexviz.model.servo import ABSENT, of_effect, servo_model
from flexviz.robot.model import FlexibleModel


def diagnose_servos(
    measurements: MeasurementSet,
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
            end = concluded(course.problem, Search(course.problem, made, trace), first)
        except Stopped:
            end = best[0]
        course.searching = False
        return _Description(course, first, end, trace, apply).result()


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


@dataclass(frozen=True, eq=False)
class _Stair:
    added: ChosenEffect | None
    values: Array
    errors: PredictionErrors
    estimate: ServoEstimate | None = None


class _Description:
    """What a search has found, as a result."""

    def __init__(
        self, course: ServoCourse, first: ServoModel, end: ServoModel, trace: Sequence[Tried], apply: bool
    ) -> None:
        self.course, self.first, self.end, self.trace, self.apply = course, first, end, trace, apply
        self.problem, self.joints = course.problem, course.measurements.joints
        self.judge = course.judge.refreshed(end.values(self.problem.data.owner))
        self.gains = needs(course.problem, end)

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
        for key, own, error, estimate in zip(order, values[1:], errors[1:], estimates[1:], strict=True):
            stairs += [_Stair(one, own, error, estimate) for one in problem.of_joints(key)]
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
