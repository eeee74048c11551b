"""Diagnosis of a set: a search at two resolutions, and the description of what it has found."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Unpack

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from flexviz.analysis.diagnosis.bandwidth_check import check_bandwidth
from flexviz.analysis.diagnosis.candidates import without_curves
from flexviz.analysis.diagnosis.course import Course, Interrupted, SearchEnd
from flexviz.analysis.diagnosis.curve_step import why_no_curve, with_free_curve
from flexviz.analysis.diagnosis.curves import fit_free_curve
from flexviz.analysis.diagnosis.findings import Stair, effect_values, findings, stair_of, staircase, steps
from flexviz.analysis.diagnosis.fit_context import Fit
from flexviz.analysis.diagnosis.limit import detection_limit
from flexviz.analysis.diagnosis.notes import notes, standstill, without_still_groups
from flexviz.analysis.diagnosis.result import Diagnosis, Finding, Step
from flexviz.analysis.diagnosis.seen_limits import limit_findings
from flexviz.analysis.diagnosis.settings import diagnosed_set
from flexviz.analysis.diagnosis.stages import SearchStage
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.diagnosis.unknown_input import (
    UnknownInputFit,
    UnknownPlace,
    locate_unknown,
    unknown_place,
)
from flexviz.analysis.identification import (
    Estimate,
    FitOptions,
    FitSettings,
    by_free_motion,
    fit_settings,
    link_side_checks,
    of_samples,
    parameter_estimates,
)
from flexviz.base.facts import Fact
from flexviz.base.parallel import existing_objects_kept, stopped_by
from flexviz.base.progress import ProgressCallback, StopCallback, never
from flexviz.base.search import Tried
from flexviz.checks import filtered_before_writing, noise_notes, recording_entries
from flexviz.content.records import CriterionNumbers, Decoys, DetectionLimit, Move, Resolution, Verdict
from flexviz.data.measurements import MeasurementSet, set_of
from flexviz.model.effects import DECOYS

Array = NDArray[np.float64]


def diagnose(
    measurements: MeasurementSet | str | Path,
    settings: FitSettings | None = None,
    *,
    apply: bool = False,
    guard: bool | None = None,
    free_curve: bool | None = None,
    decoys: bool = False,
    survey: bool = False,
    progress: ProgressCallback | None = None,
    should_stop: StopCallback | None = None,
    guarded: bool | None = None,
    **options: Unpack[FitOptions],
) -> Diagnosis:
    """Determine whether the set's model is complete, and if not, what is missing.

    Effects are added, dropped and exchanged while that lowers J, what a model leaves of the recorded torque
    and what it costs (`criterion`), over fitted and held-out groups; first in the band of the motion, then in
    units of the sensors' noise. What no effect explains is called unknown.

    Args:
        measurements: the measurement set, or its folder.
        settings: groups and effects, of which `options` change some; None: those of the set.
        apply: whether the result describes the model with the effects that were found, step by step.
            Otherwise it describes the set's own model.
        guard: whether to check the parameters against the observer's bandwidth; default: only if the
            residual stays above the noise for no known reason.
        free_curve: with `apply`, after a last verdict of "unknown": whether the final model has a free curve
            of what no effect explains. Default: only if the effects were estimated together with one.
        decoys: whether candidates that cannot be right compete with the real ones: how many of them are
            accepted tells how often the search would accept an accident.
        survey: whether `progress` is told at the beginning what each effect alone would remove.
        progress: called between fits.
        should_stop: called between fits; True ends the diagnosis with the findings so far.
        guarded: the old name of `guard`.
        options: fields of `FitSettings`.

    Raises:
        InputError: unknown names, or a setting that a diagnosis chooses itself: observer, bandwidth, gains,
            refine, max_iterations.
    """
    if guarded is not None:
        warnings.warn("diagnose(guarded=…) is now diagnose(guard=…)", DeprecationWarning, stacklevel=2)
        guard = guarded
    measurements = diagnosed_set(set_of(measurements), fit_settings(settings, **options))
    if measurements.drive is not None:
        return by_free_motion("diagnose_servos")(measurements, apply, progress, should_stop)
    measurements, notes = without_still_groups(measurements)
    notes, should_stop = [*notes, *noise_notes(measurements)], should_stop or never
    with threadpool_limits(1, "blas"), stopped_by(should_stop), existing_objects_kept():
        course = Course(measurements, progress, should_stop, survey)
        course.view.decoys = course.fine.decoys = decoys
        result = _described(course, apply, guard, free_curve)
        if progress is not None and not result.stopped:
            progress(course.pace.done())
        del course  # before what it leaves is collected
    recording = recording_entries(measurements, should_stop)
    return replace(result, notes=(*result.notes, *notes), recording=recording)


def _described(course: Course, apply: bool, guard: bool | None, free_curve: bool | None) -> Diagnosis:
    """Run a search, and describe what it has found; arguments as of `diagnose`."""
    end = course.run()
    with stopped_by(never):
        end, found = course.concluded(end)
        if end.curves and free_curve is False:
            found = course.without_curves(found)
        result = _Description(course, end, found, apply, guard).result()
    if apply and free_curve and not why_no_curve(result):
        course.searching = True
        try:
            result = with_free_curve(course.measurements, result, course.say)
        except Interrupted:
            result = replace(result, stopped=True)
        result = replace(result, seconds=time.perf_counter() - course.began)
    if result.stopped and not result.findings and (best := course.news.so_far) is not None:
        result = replace(result, notes=(*result.notes, best.stopped))
    return result


@dataclass(frozen=True, eq=False)
class _Description:
    """What a search has found, as a result.

    Attributes:
        course, end: the search, and where it ended.
        estimate: of the final model.
        apply: whether the result describes the model with what was found, or the set's own one.
        guard: whether to check it against the observer's bandwidth; None: if the residual is puzzling.
    """

    course: Course
    end: SearchEnd
    estimate: Estimate
    apply: bool
    guard: bool | None

    def result(self) -> Diagnosis:
        """The result."""
        course, end = self.course, self.end
        final = stair_of(course, self.estimate)
        course.tell(SearchStage.STAIRS.fact)
        stairs = staircase(course, end, final)
        left = (
            course.errs(end.coarse, end.fine) if end.at_noise else course.view.significant(end.coarse).any()
        )
        complete = not (left or end.curves or end.changing or self.drowned(final))
        last: Verdict = "nothing-missing" if complete else "unknown"
        found = findings(course, end, stairs)
        taken = steps(stairs, found, last)
        listed = sorted((f for f in found if not f.stopgap), key=lambda f: -(f.share or 0.0))
        listed += limit_findings(course.measurements)
        if not self.apply:
            final, taken = stairs[0], [replace(taken[0], verdict="missing" if listed else last)]
        return self.described(final, taken, listed)

    def described(self, shown: Stair, made: list[Step], found: list[Finding]) -> Diagnosis:
        """The result that describes one model, `shown`."""
        course, end, layout = self.course, self.end, shown.layout
        course.tell(SearchStage.LOCATION.fact)
        plain = without_curves(shown)  # a curve is what no effect explains
        fit = course.fine.fit(plain.layout, plain.x, 0).fit
        context, unknown = course.fine.context, made[-1].verdict == "unknown"
        place = self.place(fit) if unknown and self.apply else None
        beside = UnknownInputFit.of(context, fit, place)
        where, maps, parts = locate_unknown(context, fit, beside, end.changing)
        for law in end.curves[:1]:
            where = tuple(sorted(where, key=lambda p: p.joint != layout.joint_name(law)))
        curve = guard = None
        if unknown and not course.stopped:
            curve = fit_free_curve(context, fit if beside is None else beside.fit, where[0], parts)
            curve = None if end.curves and not curve.certain else curve
        puzzling = unknown and end.at_noise and end.changing is None and beside is None
        if not course.stopped and (self.guard or (self.guard is None and puzzling)):
            course.tell(SearchStage.BANDWIDTH.fact)
            guard = check_bandwidth(course.measurements, layout, shown.x)
        told = () if beside is None else beside.notes(context, parts, fit)
        # variance of the model error that the search allowed for, shape (n,) [Nm²]
        error = None if end.at_noise or not unknown else end.coarse.score.deviation**2
        more = notes(fit, made[-1].verdict, shown.errors, error, curve, guard)
        known = shown.estimate
        assert known is not None
        parameters = parameter_estimates(
            layout, known.x, known.start, shown.covariance, known.at_bound, known.prior
        )
        links = layout.inertial
        return Diagnosis(
            set_name=course.measurements.name, verdict=self.verdict(made[0].verdict, found),
            findings=tuple(found), where=where,
            steps=tuple(made), effects=effect_values(shown), parameters=parameters,
            seconds=time.perf_counter() - course.began, stopped=course.stopped,
            limit=self.limit(shown, made[-1].verdict),
            notes=(*self.notes_on_data(shown), *told, *more), model=layout.model(shown.x), maps=maps,
            free_curve=curve, guard=guard, torque_spread=course.measurements.torque_spread,
            trace=tuple(map(self.told, course.trace)),
            decoys=self.counted_decoys() if course.view.decoys else None, criterion=self.criterion(),
            link_side=link_side_checks(
                course.measurements, shown.x[links].reshape(-1, 10),
                shown.covariance.matrix[links, links], parameters[layout.compliance],
            ),
        )  # fmt: skip

    def verdict(self, first: Verdict, found: Sequence[Finding]) -> Verdict:
        """On the set's own model."""
        if found:
            return "missing"
        return "not-searched" if self.course.stopped and not self.course.trace else first

    def limit(self, shown: Stair, verdict: Verdict) -> DetectionLimit | None:
        """Down to what nothing is missing; None if something is, or was not looked for."""
        found = verdict == "nothing-missing" and not self.course.stopped
        return detection_limit(self.course.view.context, shown.errors.stated) if found else None

    def drowned(self, shown: Stair) -> list[str]:
        """Joints whose noise, as it is estimated, is larger than their torque: any residual looks like it."""
        pairs = zip(shown.errors.noise_floor, self.course.measurements.torque_spread, strict=True)
        return [
            j for j, (noise, torque) in zip(self.course.own.joints, pairs, strict=True) if noise > torque > 0
        ]

    def notes_on_data(self, shown: Stair) -> Iterator[Fact]:
        """What holds of the data whatever was found."""
        if drowned := self.drowned(shown):
            yield Fact("drowned", "wrong", tuple(drowned))
        yield from of_samples(self.course.measurements)
        if self.end.changing is not None:
            yield self.end.changing.fact
        segments = [s for g in self.course.measurements.fit_groups for s in g.segments]
        if (hertz := filtered_before_writing(segments).hertz) is not None:
            yield Fact("filtered", "odd", values={"hertz": hertz})
        if (phase := self.course.view.context.first_phase).any():
            yield standstill(self.course.own.joints, phase)

    def criterion(self) -> CriterionNumbers:
        """The numbers of J where the search ended."""
        resolution: Resolution = "fine" if self.end.at_noise else "coarse"
        found = (self.course.fine if self.end.at_noise else self.course.view).criterion
        samples, least = (tuple(map(float, values)) for values in (found.samples, found.least))
        joints, costs = self.course.own.joints, (found.of_parameter, found.of_effect)
        return CriterionNumbers(resolution, joints, samples, least, *costs)

    def counted_decoys(self) -> Decoys:
        """How many decoys the final model has, and how many competed."""
        layout = self.end.coarse.layout
        accepted = sum(e.effect in DECOYS for e in layout.effects)
        return Decoys(accepted, accepted + sum(e.effect in DECOYS for e in self.course.view.wanted(layout)))

    def told(self, tried: Tried) -> Move:
        """A move of the search for the result."""
        joints, found, accepted = self.course.own.joints, tried.gain, tried.accepted
        added, removed = (tuple(sorted(e.text(joints) for e in es)) for es in (tried.added, tried.removed))
        why = "" if accepted else Fact("move-refused", values={"why": found.why})
        return Move(tried.kind, added, removed, found.delta, 0.0, accepted, tried.resolution, why)

    def place(self, fit: Fit) -> UnknownPlace | None:
        """The place of what the final model lacks: one law acts at one place."""
        end, view = self.end, self.course.view
        many = view.own.n > THRESHOLDS.search.unknown_places
        several = many and np.count_nonzero(view.significant(end.coarse)) > 1
        if self.course.stopped or end.curves or end.changing is not None or several:
            return None
        self.course.tell(SearchStage.PLACE.fact)
        ratio = end.coarse.score.deviation / view.criterion.least
        return unknown_place(self.course.fine.context, fit, lambda: None, [int(np.argmax(ratio))])
