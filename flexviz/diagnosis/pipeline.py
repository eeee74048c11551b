"""Diagnosis of a set: a search at two resolutions, and the description of what it has found."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from flexviz.diagnosis import so_far as stages
from flexviz.diagnosis.bandwidth_check import check_bandwidth
from flexviz.diagnosis.course import Course, Interrupted, SearchEnd
from flexviz.diagnosis.curve_step import why_no_curve, with_free_curve
from flexviz.diagnosis.curves import fit_free_curve
from flexviz.diagnosis.findings import Stair, effect_values, findings, staircase, steps
from flexviz.diagnosis.fit_context import Fit
from flexviz.diagnosis.model_family import without_curves
from flexviz.diagnosis.notes import notes, standstill_text, without_still_groups
from flexviz.diagnosis.prediction_errors import Known
from flexviz.diagnosis.result import Diagnosis, Finding, Move, Step
from flexviz.diagnosis.search import Tried
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.unknown_input import BesideUnknown, UnknownPlace, locate_unknown, unknown_place
from flexviz.effects import DECOYS, ChosenEffect
from flexviz.identification import parameter_estimates
from flexviz.measurements import MeasurementSet
from flexviz.noise import filtered_before_writing, noise_notes
from flexviz.parallel import existing_objects_kept, stopped_by
from flexviz.progress import ProgressCallback, StopCallback, never
from flexviz.results import Note, Verdict
from flexviz.wording import step_shares

Array = NDArray[np.float64]

LISTED_CANDIDATES = 8


def diagnose(
    measurements: MeasurementSet,
    *,
    apply: bool = False,
    start: object = None,
    guarded: bool | None = None,
    free_curve: bool | None = None,
    decoys: bool = False,
    progress: ProgressCallback | None = None,
    should_stop: StopCallback | None = None,
) -> Diagnosis:
    """Determine whether the set's model is complete, and if not, what is missing.

    One search, coarse to fine: effects are added, dropped and swapped while that describes fitted and
    held-out groups better by more than its cost and twice its standard error, first in the band of the
    motion, then in units of the sensors' noise.

    Args:
        measurements: the measurement set.
        apply: whether the result describes the model with the effects that were found, step by step.
            Otherwise it describes the set's own model.
        start: not used any more: the search starts from the set's values.
        guarded: whether to check the parameters against the observer's bandwidth; default: only if the
            residual stays above the noise for no known reason.
        free_curve: with `apply`, after a last verdict of "unknown": whether the final model has a free curve
            of what no effect explains. Default: only if the effects were estimated beside one.
        decoys: whether candidates that cannot be right compete with the real ones: how many of them are
            accepted tells how often the search would accept an accident.
        progress: called between fits.
        should_stop: called between fits; True ends the diagnosis with the findings so far.
    """
    measurements, notes = without_still_groups(measurements)
    notes += noise_notes(measurements)
    with threadpool_limits(1, "blas"), stopped_by(should_stop or never), existing_objects_kept():
        course = Course(measurements, progress, should_stop)
        course.view.decoys = course.fine.decoys = decoys
        end = course.run()
        with stopped_by(never):
            result = _Description(course, end, apply, guarded, free_curve is not False).result()
        if apply and free_curve and not why_no_curve(result):
            result = with_curve(course, result)
        if result.stopped and not result.findings and (best := course.news.so_far) is not None:
            result = replace(result, notes=(*result.notes, Note("other", best.stopped)))
        if progress is not None and not result.stopped:
            progress(course.pace.done())
        del course, end  # before what they leave is collected
    return replace(result, notes=(*result.notes, *notes))


class _Description:
    """What a search has found, as a result.

    Args:
        course: the search.
        end: where it ended.
        apply: whether the result describes the model with what was found, or the set's own one.
        guarded: whether to check it against the observer's bandwidth; None: if the residual is puzzling.
        curves: whether the model ends with the free curves beside which it was estimated.
    """

    def __init__(
        self, course: Course, end: SearchEnd, apply: bool, guarded: bool | None, curves: bool
    ) -> None:
        self.course, self.end, self.view, self.fine = course, end, course.view, course.fine
        self.apply, self.guarded, self.curves = apply, guarded, curves
        self.own, self.measurements = course.own, course.measurements

    @property
    def at_noise(self) -> bool:
        """Whether the model is that of the fine resolution."""
        return self.end.resolution == "fine" and not self.end.curves

    def verdict(self) -> Verdict:
        """Whether the model is complete."""
        end = self.end
        if end.curves or end.changing is not None:
            return "unknown"
        complete = self.fine.complete(end.fine) if self.at_noise else not self.doubtful.any()
        return "nothing-missing" if complete else "unknown"

    @property
    def doubtful(self) -> NDArray[np.bool_]:
        """Joints with a model error that an effect may imitate, shape (n,)."""
        found = self.view.significant(self.end.coarse)
        return found & False if self.at_noise else found

    def result(self) -> Diagnosis:
        """The result."""
        self.course.tell(stages.STAIRS)
        end, last, final = self.end, self.verdict(), self.final()
        stairs = staircase(self.view, end.coarse, final, self.course.band)
        gains = self.fine.gains(end.fine) if self.at_noise else self.view.gains(end.coarse)
        found = findings(self.view, end.coarse, gains, stairs, self.course.band, self.rivals(), self.doubtful)
        if not self.curves:
            found = [one for one in found if not one.stopgap]
        taken = list(steps(stairs, found, last))
        shares = step_shares(taken, self.measurements.torque_spread)[1:]
        found = [replace(one, share=share) for one, share in zip(found, shares, strict=True)]
        taken = list(steps(stairs, found, last))
        listed = sorted((f for f in found if not f.stopgap), key=lambda f: -(f.share or 0.0))
        shown = final if self.apply else stairs[0]
        made = taken if self.apply else [replace(taken[0], verdict="missing" if listed else last)]
        return self.described(shown, made, listed)

    def described(self, shown: Stair, made: list[Step], found: list[Finding]) -> Diagnosis:
        """The result that describes one model, `shown`."""
        self.course.tell(stages.LOCATION)
        fit = self.end.fine.fit if self.apply else self.fine.fit(shown.layout, shown.x, 0).fit
        context, layout, unknown = self.fine.context, shown.layout, made[-1].verdict == "unknown"
        place = self.place(fit) if unknown and self.apply else None
        beside = BesideUnknown.of(context, fit, place)
        where, maps, parts = locate_unknown(context, fit, beside, self.end.changing)
        for law in self.end.curves[:1]:
            where = tuple(sorted(where, key=lambda p: p.joint != layout.joint_name(law)))
        curve = guard = None
        if unknown and not self.course.stopped:
            curve = fit_free_curve(context, fit if beside is None else beside.fit, where[0], parts)
            curve = None if self.end.curves and not curve.certain else curve
        puzzling = unknown and self.at_noise and self.end.changing is None and beside is None
        if not self.course.stopped and (self.guarded or (self.guarded is None and puzzling)):
            self.course.tell(stages.BANDWIDTH)
            guard = check_bandwidth(self.measurements, layout, shown.x)
        start = self.view.context.start(layout)
        at_bound = (shown.x <= start.bounds.lower) | (shown.x >= start.bounds.upper)
        told = () if beside is None else tuple(beside.notes(context, parts, fit))
        more = notes(fit, made[-1].verdict, shown.errors, self.model_error(unknown), curve, guard)
        return Diagnosis(
            set_name=self.measurements.name,
            verdict=made[0].verdict,
            findings=tuple(found[:LISTED_CANDIDATES]),
            where=where,
            steps=tuple(made),
            effects=effect_values(shown, shown.covariance.standard_errors),
            parameters=parameter_estimates(
                layout, shown.x, start.prior.centre, shown.covariance, at_bound, start.prior
            ),
            seconds=time.perf_counter() - self.course.began,
            stopped=self.course.stopped,
            notes=(*self.notes_on_data(), *told, *more),
            model=layout.model(shown.x),
            maps=maps,
            free_curve=curve,
            guard=guard,
            torque_spread=self.measurements.torque_spread,
            trace=tuple(map(self.told, self.course.trace)),
            decoys=self.counted_decoys(),
        )

    def model_error(self, unknown: bool) -> Array | None:
        """Variance of the model error that the search allowed for, shape (n,) [Nm²]; None without one."""
        coarse = self.end.resolution == "coarse" and unknown
        return self.end.coarse.likelihood.deviation**2 if coarse else None

    def notes_on_data(self) -> Iterator[Note]:
        """What is said of the data whatever was found."""
        if self.end.changing is not None:
            yield Note("changing", self.end.changing.text)
        segments = [s for g in self.measurements.fit_groups for s in g.segments]
        if text := filtered_before_writing(segments).text:
            yield Note("filtered", text)
        if (phase := self.view.context.first_phase).any():
            yield Note("standstill", standstill_text(self.own.joints, phase))

    def counted_decoys(self) -> tuple[int, int] | None:
        """How many decoys the final model has, and how many competed; None if none did."""
        if not self.view.decoys:
            return None
        layout = self.end.coarse.layout
        accepted = sum(e.effect in DECOYS for e in layout.effects)
        return accepted, accepted + sum(e.effect in DECOYS for e in self.view.wanted(layout))

    def told(self, tried: Tried) -> Move:
        """A move of the search for the result."""
        added, removed = (
            tuple(sorted(_effect(key).text(self.own.joints) for key in keys))
            for keys in (tried.added, tried.removed)
        )
        found = tried.gain
        why = "" if tried.accepted else found.why or "it is not needed"
        accepted, resolution = tried.accepted, tried.resolution
        return Move(tried.kind, added, removed, found.delta, found.error, accepted, resolution, why)

    def place(self, fit: Fit) -> UnknownPlace | None:
        """The place of what the final model lacks: one law acts at one place."""
        end = self.end
        many = self.own.n > THRESHOLDS.search.unknown_places
        several = many and np.count_nonzero(self.view.significant(end.coarse)) > 1
        if self.course.stopped or end.curves or end.changing is not None or several:
            return None
        self.course.tell(stages.PLACE)
        ratio = end.coarse.likelihood.deviation / self.view.floor
        return unknown_place(self.fine.context, fit, lambda: None, [int(np.argmax(ratio))])

    def final(self) -> Stair:
        """The final model."""
        if self.at_noise:
            fit = self.end.fine.fit
            known = Known(fit.layout, fit.x)
            covariance = self.fine.context.covariance(fit)
        else:
            plain = without_curves(self.end.coarse.fit, () if self.curves else self.end.curves)
            known = Known(plain.layout, plain.x)
            covariance = plain.covariance(self.end.coarse.fit)
        added = [e for e in known.layout.effects if e not in self.own.effects]
        errors = self.course.band.errors(known, self.view.context.first_phase)
        return Stair(added[-1] if added else None, known.layout, known.x, covariance, errors)

    def rivals(self) -> Mapping[ChosenEffect, Sequence[str]]:
        """Effects → laws for which they were swapped without a clear gain or loss."""
        out: dict[ChosenEffect, list[str]] = {}
        for move in self.course.trace:
            if move.kind == "swap" and not move.gain.clear:
                for old in map(_effect, move.removed):
                    same = [new.effect for new in map(_effect, move.added) if new.joint == old.joint]
                    out.setdefault(old, []).extend(same)
        return out


def with_curve(course: Course, result: Diagnosis) -> Diagnosis:
    """The result with a free curve; without if the user stops it."""
    course.searching = True
    try:
        longer = with_free_curve(course.measurements, result, course.say)
    except Interrupted:
        return replace(result, stopped=True)
    return replace(longer, seconds=time.perf_counter() - course.began)


def _effect(key: object) -> ChosenEffect:
    assert isinstance(key, ChosenEffect)
    return key
