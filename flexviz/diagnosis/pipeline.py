"""Diagnosis of a set: search at two resolutions, then describe what was found and what is left."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from flexviz.diagnosis import stages
from flexviz.diagnosis.bandwidth_check import check_bandwidth
from flexviz.diagnosis.beside_unknown import BesideUnknown, locate_unknown
from flexviz.diagnosis.coarse import Coarse, CoarseModel
from flexviz.diagnosis.criterion import gain
from flexviz.diagnosis.curve_step import why_no_curve, with_free_curve
from flexviz.diagnosis.findings import Stair, effect_values, findings, staircase, steps
from flexviz.diagnosis.fine import Fine, FineModel
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.free_curve import fit_free_curve
from flexviz.diagnosis.model_family import without_curves
from flexviz.diagnosis.motion_fit import MotionContext
from flexviz.diagnosis.notes import notes, standstill_text
from flexviz.diagnosis.prediction_errors import PredictionErrorBand
from flexviz.diagnosis.result import Diagnosis, Finding, Move
from flexviz.diagnosis.search import Search, Tried
from flexviz.diagnosis.so_far import Standing
from flexviz.diagnosis.still_groups import without_still_groups
from flexviz.diagnosis.unknown_curve import is_curve
from flexviz.diagnosis.unknown_input import UnknownPlace, unknown_place
from flexviz.diagnosis.varying_size import ChangingSize, changing_size
from flexviz.effects import DECOYS, ChosenEffect
from flexviz.equation import Layout, layout_of
from flexviz.identification import parameter_estimates
from flexviz.measurements import MeasurementSet
from flexviz.noise import filtered_before_writing, noise_notes
from flexviz.parallel import existing_objects_kept, stopped_by
from flexviz.progress import BestSoFar, Progress, ProgressCallback, StopCallback, never
from flexviz.results import Note, Verdict

Array = NDArray[np.float64]

LISTED_CANDIDATES = 8
FINE_ITERATIONS = 14


class Interrupted(Exception):
    """Raised between steps when the user stops the diagnosis."""


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
        work = _Diagnosis(measurements, progress, should_stop)
        work.view.decoys = work.fine.decoys = decoys
        result = work.run(apply, guarded, free_curve is not False)
        if apply and free_curve and not why_no_curve(result):
            result = work.with_curve(result)
        if result.stopped and not result.findings and (best := work.news.so_far) is not None:
            result = replace(result, notes=(*result.notes, Note("other", best.stopped)))
        if progress is not None and not result.stopped:
            progress(work.pace.done())
        del work  # before what it leaves is collected
    return replace(result, notes=(*result.notes, *notes))


@dataclass(frozen=True, eq=False)
class _End:
    """Where the search ended.

    Attributes:
        coarse: the model at the coarse resolution.
        fine: at the fine one, without free curves.
        resolution: the one that decided: "coarse" where a model error is left.
        curves: free curves beside which the model was estimated.
        changing: a size that changes during the recordings.
    """

    coarse: CoarseModel
    fine: FineModel
    resolution: str
    curves: tuple[ChosenEffect, ...]
    changing: ChangingSize | None = None


class _Diagnosis:
    """State of one diagnosis."""

    def __init__(
        self,
        measurements: MeasurementSet,
        progress: ProgressCallback | None,
        should_stop: StopCallback | None,
    ) -> None:
        self.measurements, self.progress, self.should_stop = measurements, progress, should_stop
        self.began, self.stopped = time.perf_counter(), False
        self.pace, self.news = stages.pace(measurements.n), Progress()
        self.own = layout_of(measurements)
        self.band = PredictionErrorBand(measurements)
        self.standing = Standing(self.own, self.band, self.tell_best if progress else None)
        self.view = Coarse(MotionContext(measurements, self.own.joints, stand_ins=True), self.own, self.say)
        self.fine = Fine(FitContext(measurements, self.own), self.own, self.say)
        self.trace: list[Tried] = []
        self.best: CoarseModel | None = None

    def say(self, text: str) -> None:
        """Report progress; raise `Interrupted` if the user has stopped the diagnosis."""
        self.stopped = self.stopped or (self.should_stop is not None and self.should_stop())
        if self.stopped:
            raise Interrupted
        self.tell(text)

    def tell(self, text: str) -> None:
        if text and self.progress is not None:
            self.news = replace(self.pace.news(text), so_far=self.news.so_far)
            self.progress(self.news)

    def tell_best(self, best: BestSoFar) -> None:
        """Report the best model so far."""
        self.news = replace(self.news, so_far=best)
        if self.progress is not None:
            self.progress(self.news)

    # -- the search

    def run(self, apply: bool, guarded: bool | None, curves: bool) -> Diagnosis:
        try:
            end = self.searched()
        except Interrupted:
            end = self.interrupted()
        with stopped_by(never):
            return self.result(end, apply, guarded, curves)

    def searched(self) -> _End:
        """The end of the search at both resolutions."""
        coarse = self.coarse_search()
        view = self.view
        if view.significant(coarse).any():
            return self.ended(coarse, "coarse")
        end = self.ended(coarse, "fine")
        if end.curves:
            return end
        self.tell(stages.FINE)
        assert view.reference is not None
        self.fine.reference = end.fine.likelihood
        self.fine.explained = np.maximum(gain(view.reference, coarse.likelihood).by_joint, 0.0)
        search = Search(self.fine, trace=self.trace)
        found = search.run(end.fine)
        model = end.coarse
        if found.layout != end.coarse.layout:
            model = view.fit(found.layout, found.fit.x, iterations=5)
        return _End(model, found, "fine", (), changing_size(self.fine, found))

    def coarse_search(self) -> CoarseModel:
        """The end of the search at the coarse resolution."""
        view = self.view
        self.say(stages.OWN_MODEL)
        bare = self.best = view.bare()
        view.reference = bare.likelihood
        self.standing.own_model(bare.fit)
        if view.at_noise(bare):
            return bare
        self.say(stages.USUAL)
        rich = view.pruned(view.rich())
        if view.context.set_standstill_apart(rich.fit):
            rich = view.rich()
        search = Search(view, self.made, self.trace)
        return view.with_first_movements(view.with_rest_angles(search.run(rich)))

    def made(self, model: CoarseModel) -> None:
        """A model is accepted."""
        self.best = model
        self.standing.fitted(
            without_curves(model.fit, [*filter(is_curve, model.layout.effects)]),
            self.view.context.first_phase,
        )

    def ended(self, coarse: CoarseModel, resolution: str) -> _End:
        curves = tuple(filter(is_curve, coarse.layout.effects))
        plain = without_curves(coarse.fit, curves)
        iterations = FINE_ITERATIONS if resolution == "fine" and not curves else 0
        return _End(coarse, self.fine.fit(plain.layout, plain.x, iterations), resolution, curves)

    def interrupted(self) -> _End:
        """The end of a search that was stopped."""
        with stopped_by(never):
            self.stopped, stop = False, self.stopped
            self.should_stop = None
            best = self.best if self.best is not None else self.view.bare()
            end = self.ended(best, "coarse")
            self.stopped = stop
        return end

    # -- the result

    def verdict(self, end: _End) -> Verdict:
        """Whether the model is complete."""
        if end.curves or end.changing is not None or self.view.significant(end.coarse).any():
            return "unknown"
        return (
            "unknown" if end.resolution == "fine" and not self.fine.complete(end.fine) else "nothing-missing"
        )

    def result(self, end: _End, apply: bool, guarded: bool | None, curves: bool) -> Diagnosis:
        self.tell(stages.STAIRS)
        last, view = self.verdict(end), self.view
        final = self.final(end, curves)
        model = end.coarse
        stairs = staircase(view, model, final, self.band)
        gains = (
            self.fine.gains(end.fine) if end.resolution == "fine" and not end.curves else view.gains(model)
        )
        found = findings(view, model, gains, stairs, self.band, self.rivals())
        if not curves:
            found = [one for one in found if not one.stopgap]
        shown, verdict = (
            (final, last) if apply else (stairs[0], "missing" if any(not f.stopgap for f in found) else last)
        )
        made = list(steps(stairs if apply else stairs[:1], found if apply else (), verdict))
        self.tell(stages.LOCATION)
        return self.described(end, shown, verdict, made, found, apply, guarded)

    def described(
        self,
        end: _End,
        shown: Stair,
        verdict: Verdict,
        made: list,
        found: list[Finding],
        apply: bool,
        guarded: bool | None,
    ) -> Diagnosis:
        fit = end.fine.fit if apply else self.fine.fit(shown.layout, shown.x, 0).fit
        context, layout = self.fine.context, shown.layout
        place = None
        one_place = np.count_nonzero(self.view.significant(end.coarse)) < 2  # one law acts at one place
        searched = apply and not self.stopped and not end.curves and end.changing is None
        if searched and verdict == "unknown" and one_place:
            place = self.place(end, fit)
        beside = BesideUnknown.of(context, fit, place)
        likely = [e.joint for e in end.curves]
        where, maps, parts = locate_unknown(context, fit, beside, end.changing)
        if likely:
            joint = layout.joints[likely[0] or 0]
            where = tuple(sorted(where, key=lambda p: p.joint != joint))
        curve = bandwidths = None
        if verdict == "unknown" and not self.stopped:
            curve = fit_free_curve(context, fit if beside is None else beside.fit, where[0], parts)
        if end.curves and curve is not None and not curve.certain:
            curve = None
        puzzling = verdict == "unknown" and end.changing is None and beside is None and not end.curves
        if not self.stopped and (guarded or (guarded is None and puzzling and end.resolution == "fine")):
            self.tell(stages.BANDWIDTH)
            bandwidths = check_bandwidth(self.measurements, layout, shown.x)
        prior = self.view.context.start(layout).prior
        variance = (
            end.coarse.likelihood.deviation**2
            if end.resolution == "coarse" and verdict == "unknown"
            else None
        )
        first = () if end.changing is None else (Note("changing", end.changing.text),)
        filtered = filtered_before_writing([s for g in self.measurements.fit_groups for s in g.segments]).text
        first += (Note("filtered", filtered),) if filtered else ()
        more = notes(fit, verdict, shown.errors, variance, curve, bandwidths)
        told = () if beside is None else tuple(beside.notes(context, parts, fit))
        phase = self.view.context.first_phase
        still = (Note("standstill", standstill_text(layout.joints, phase)),) if phase.any() else ()
        return Diagnosis(
            set_name=self.measurements.name,
            verdict=made[0].verdict,
            findings=tuple(f for f in found if not f.stopgap)[:LISTED_CANDIDATES],
            where=where,
            steps=tuple(made),
            effects=effect_values(shown, shown.covariance.standard_errors),
            parameters=parameter_estimates(
                layout, shown.x, prior.centre, shown.covariance, np.zeros(layout.size, bool), prior
            ),
            seconds=time.perf_counter() - self.began,
            stopped=self.stopped,
            notes=(*first, *still, *told, *more),
            model=layout.model(shown.x),
            maps=maps,
            free_curve=curve,
            guard=bandwidths,
            torque_spread=self.measurements.torque_spread,
            trace=tuple(map(self.told, self.trace)),
            decoys=self.counted_decoys(end),
        )

    def counted_decoys(self, end: _End) -> tuple[int, int] | None:
        """How many decoys the final model has, and how many competed; None if none did."""
        if not self.view.decoys:
            return None
        accepted = sum(e.effect in DECOYS for e in end.coarse.layout.effects)
        return accepted, accepted + sum(e.effect in DECOYS for e in self.view.wanted(end.coarse.layout))

    def told(self, tried: Tried) -> Move:
        """A move of the search for the result."""
        added, removed = (
            tuple(sorted(_effect(key).text(self.own.joints) for key in keys))
            for keys in (tried.added, tried.removed)
        )
        gain = tried.gain
        why = "" if tried.accepted else gain.why or "it is not needed"
        return Move(tried.kind, added, removed, gain.delta, gain.error, tried.accepted, tried.resolution, why)

    def place(self, end: _End, fit: Fit) -> UnknownPlace | None:
        """The place of what the final model lacks."""
        self.tell(stages.PLACE)
        ratio = end.coarse.likelihood.deviation / self.view.floor
        return unknown_place(self.fine.context, fit, lambda: None, [int(j) for j in np.argsort(-ratio)[:1]])

    def final(self, end: _End, curves: bool) -> Stair:
        """The final model."""
        phase, last = self.view.context.first_phase, None
        if end.resolution == "fine" and not end.curves:
            fit = end.fine.fit
            covariance = self.fine.context.covariance(fit)
            layout, x = fit.layout, fit.x
        else:
            kept = () if curves else end.curves
            plain = without_curves(end.coarse.fit, kept)
            layout, x, covariance = plain.layout, plain.x, plain.covariance(end.coarse.fit)
        added = [e for e in layout.effects if e not in self.own.effects]
        known = _Known(layout, x)
        return Stair(added[-1] if added else last, layout, x, covariance, self.band.errors(known, phase))

    def rivals(self) -> Mapping[ChosenEffect, Sequence[str]]:
        """Effects → laws for which they were swapped without a clear gain or loss."""
        out: dict[ChosenEffect, list[str]] = {}
        for move in self.trace:
            if move.kind == "swap" and abs(move.gain.delta) < max(2 * move.gain.error, 10.0):
                for old in map(_effect, move.removed):
                    same = [new.effect for new in map(_effect, move.added) if new.joint == old.joint]
                    out.setdefault(old, []).extend(same)
        return out

    def with_curve(self, result: Diagnosis) -> Diagnosis:
        """The result with a free curve; without if the user stops it."""
        try:
            longer = with_free_curve(self.measurements, result, self.say)
        except Interrupted:
            return replace(result, stopped=True)
        return replace(longer, seconds=time.perf_counter() - self.began)


def _effect(key: object) -> ChosenEffect:
    assert isinstance(key, ChosenEffect)
    return key


@dataclass(frozen=True, eq=False)
class _Known:
    layout: Layout
    x: Array
