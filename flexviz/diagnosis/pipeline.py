"""Diagnosis of a set: score, refit and accept candidate effects one by one, then describe the final model."""

from __future__ import annotations

import contextlib
import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from flexviz.diagnosis import evidence, stages
from flexviz.diagnosis.acceptance import quiet, verdict
from flexviz.diagnosis.bandwidth_check import check_bandwidth
from flexviz.diagnosis.beside_unknown import BesideUnknown, locate_unknown
from flexviz.diagnosis.conclusion import Conclusion
from flexviz.diagnosis.constancy import changing_size
from flexviz.diagnosis.curve_step import why_no_curve, with_free_curve
from flexviz.diagnosis.final_refit import EarlyRefit
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.forward_search import ForwardSearch
from flexviz.diagnosis.free_curve import fit_free_curve
from flexviz.diagnosis.many_effects import ManyEffects
from flexviz.diagnosis.model_family import RichModel
from flexviz.diagnosis.own_start import GivenStart, OwnStart
from flexviz.diagnosis.prediction_errors import PredictionErrorBand
from flexviz.diagnosis.result import Diagnosis
from flexviz.diagnosis.rich_result import just_incomplete, leaves_only_noise
from flexviz.diagnosis.so_far import Standing
from flexviz.diagnosis.still_groups import without_still_groups
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.equation import layout_of
from flexviz.identification import parameter_estimates
from flexviz.measurements import MeasurementSet
from flexviz.noise import noise_notes
from flexviz.parallel import existing_objects_kept, stopped_by
from flexviz.progress import BestSoFar, Progress, ProgressCallback, StopCallback, never
from flexviz.results import Note, Verdict

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.search


class Interrupted(Exception):
    """Raised between steps when the user stops the diagnosis."""


def diagnose(
    measurements: MeasurementSet,
    *,
    apply: bool = False,
    start: GivenStart = None,
    guarded: bool | None = None,
    free_curve: bool | None = None,
    progress: ProgressCallback | None = None,
    should_stop: StopCallback | None = None,
) -> Diagnosis:
    """Determine whether the set's model is complete, and if not, what is missing.

    Args:
        measurements: the measurement set.
        apply: add the effects found one by one and refit after each. Otherwise only the first missing effect
            is named and the result describes the set's own model.
        start: start values, or a function that finds them when needed; default: a plain identification.
        guarded: whether to check the parameters against the observer's bandwidth; default: only if the
            residual stays above the noise for no known reason.
        free_curve: with `apply`, after a last verdict of "unknown": whether the final model has a free curve
            of what no effect explains. Default: only if the effects were estimated beside one.
        progress: called between fits.
        should_stop: called between fits; True ends the diagnosis with the findings so far.
    """
    measurements, notes = without_still_groups(measurements)
    notes += noise_notes(measurements)
    with threadpool_limits(1, "blas"), stopped_by(should_stop or never), existing_objects_kept():
        pipeline = _Pipeline(measurements, apply, start, progress, should_stop)
        with pipeline.beside:
            result = pipeline.run(guarded, free_curve is not False)
        if apply and free_curve and not why_no_curve(result):
            result = pipeline.with_curve(result)
        if result.stopped and not result.findings and (best := pipeline.news.so_far) is not None:
            result = replace(result, notes=(*result.notes, Note("other", best.stopped)))
        if progress is not None and not result.stopped:
            progress(pipeline.pace.done())
        del pipeline  # before what it leaves is collected
    return replace(result, notes=(*result.notes, *notes))


class _Pipeline:
    """State of one diagnosis.

    Attributes:
        forward: the search that adds effects one by one.
        beside: ends what was begun beside the search.
    """

    def __init__(
        self,
        measurements: MeasurementSet,
        apply: bool,
        start: GivenStart,
        progress: ProgressCallback | None,
        should_stop: StopCallback | None,
    ) -> None:
        self.measurements, self.apply = measurements, apply
        self.progress, self.should_stop = progress, should_stop
        self.began, self.stopped = time.perf_counter(), False
        self.pace, self.news = stages.pace(measurements.n), Progress()
        self.layout = layout_of(measurements)
        self.error_band = PredictionErrorBand(measurements)
        self.standing = Standing(self.layout, self.error_band, self.tell_best if progress else None)
        self.start = OwnStart(measurements, start, should_stop)
        self.refit = EarlyRefit(measurements, self.check_stop)
        self.beside = contextlib.ExitStack()
        self.beside.callback(self.start.close)
        self.beside.callback(self.refit.foreseen.close)

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

    def run(self, guarded: bool | None, curves: bool) -> Diagnosis:
        many = ManyEffects(self.measurements, self.layout, self.error_band, self.say, self.standing)
        rich, begun = None, False
        try:
            near = many.search.near_noise()
            if near is not None:
                many.search.forget()
                self.refit.begin(near)
                self.forward = self.prepared(LIMITS.short_refit if near.rivals else LIMITS.first_iterations)
            if begun := near is not None or self.near_noise_beside_reversals(many):
                self.forward.add_effects(near)
            if not begun or self.forward.unexplained:
                rich = many.find()
        except Interrupted:
            if (best := many.search.best) is not None:
                rich = many.worth_showing(best)
                self.start.use(best.fit.layout.model(best.fit.x))
        if rich is not None and not self.stopped and self.few_explain(rich, begun):
            del many, rich
            return self.result(guarded)
        if rich is not None:
            guard = bool(guarded) and not self.stopped
            result = many.result(rich, self.apply, curves, guard, self.tell)
            return replace(result, seconds=time.perf_counter() - self.began, stopped=self.stopped)
        if not begun:
            few = many.search.few
            del many  # its fits take as much memory as what follows
            self.forward = self.prepared(0 if self.stopped else LIMITS.first_iterations)
            self.forward.search.expected = few
        try:
            self.check_stop()
            if not begun and (few or not self.forward.look_at_place_first()):
                self.forward.add_effects()
            if self.forward.unexplained:
                self.forward.explain_the_rest()
        except Interrupted:
            pass  # the result contains the findings so far
        return self.result(guarded)

    def few_explain(self, rich: RichModel, begun: bool) -> bool:
        """Whether a search forwards explains more than the few effects that a search backwards found.

        One law of no library may explain all of them: an arbitrary torque at its place leaves only noise, or
        effects elsewhere imitate it. Or effects added one at a time leave only noise where those leave more.
        """
        added = rich.added(self.layout)
        if leaves_only_noise(rich) or len(added) > THRESHOLDS.unknown_place.imitations:
            return False
        weighty = {e.joint for e in added if rich.needed[e].share > THRESHOLDS.motion.weighty_share}
        if len(weighty - {None}) >= THRESHOLDS.unknown_place.imitated:
            return False
        with contextlib.suppress(Interrupted):
            search = self.forward if begun else self.prepared()
            place = search.place_of_base()
            if place is not None:
                elsewhere = any(e.joint != place.unknown.joint for e in added)
                if elsewhere or place.complete or not added:
                    self.forward = search
                    search.find_place()
                    return True
            if not begun and just_incomplete(rich):
                search.add_effects(most=THRESHOLDS.motion.few_instead)
                self.forward = search
                return search.complete
        return False

    def with_curve(self, result: Diagnosis) -> Diagnosis:
        """The result with a free curve; without if the user stops it."""
        try:
            longer = with_free_curve(self.measurements, result, self.say)
        except Interrupted:
            return replace(result, stopped=True)
        return replace(longer, seconds=time.perf_counter() - self.began)

    def prepared(self, iterations: int = LIMITS.first_iterations) -> ForwardSearch:
        """A search forwards from the set's own model, fitted in units of the noise."""
        context = FitContext(self.measurements, self.layout)
        model, steps = self.start.model()
        base = context.fit(self.layout, self.layout.vector(model), iterations=max(iterations - steps, 0))
        search = ForwardSearch(context, base, self.say, self.standing.fitted, self.refit.begin, self.apply)
        self.beside.callback(search.search.restart.foreseen.close)
        return search

    def near_noise_beside_reversals(self, many: ManyEffects) -> bool:
        """Prepare the search on a model with friction if its fit, which knows reversals, is near noise."""
        if not self.layout.has_reversals:
            return False
        self.say(stages.OWN_MODEL)
        search = self.prepared()
        if near := quiet(search.base):
            many.search.forget()
            self.forward = search
        else:
            self.start.use(self.layout.model(search.base.x), LIMITS.first_iterations)
        return near

    def check_stop(self) -> None:
        self.say("")

    # -- the result -------------------------------------------------------------------------------------

    def result(self, guarded: bool | None) -> Diagnosis:
        """Findings, final model and residuals."""
        search = self.forward
        context, base, steps = search.context, search.base, search.steps
        fits = [base, *(step.after for step in steps)]
        errors = [self.error_band.errors(fit) for fit in fits]
        in_noise_units = search.final
        if search.model_error_variance is not None:
            in_noise_units = context.fit(search.final.layout, search.final.x, iterations=0)
        findings = [
            evidence.explain(
                context,
                step,
                in_noise_units if step.adapted is None else search.final,
                evidence.explained_residual(
                    step.before.layout, step.chosen.effect.joint, self.error_band, before, after
                ),
            )
            for step, before, after in zip(steps, errors, errors[1:], strict=False)
        ]
        last = self.conclude(in_noise_units)
        findings = last.doubted(findings)
        if last.refined:
            fits[-1], errors[-1] = last.fit, self.error_band.errors(last.fit)
        added = [None, *findings] if self.apply else [None]
        verdicts: list[Verdict] = [*("missing" for _ in steps), last.verdict]
        taken = [evidence.made_step(*each) for each in zip(added, fits, errors, verdicts, strict=False)]
        final, layout = last.fit, last.fit.layout
        prior = context.start(layout).prior
        beside = BesideUnknown.of(context, final, search.place)
        where, maps, parts = locate_unknown(context, final, beside, last.changing)
        curve = bandwidths = None
        if not self.stopped and last.verdict == "unknown":
            curve = fit_free_curve(context, final if beside is None else beside.fit, where[0], parts)
        if not self.stopped and (guarded or (guarded is None and last.puzzling and beside is None)):
            self.tell(stages.BANDWIDTH)
            bandwidths = check_bandwidth(self.measurements, layout, final.x)
        return Diagnosis(
            set_name=self.measurements.name,
            verdict=taken[0].verdict,
            findings=tuple(evidence.ranked(context, base, search.tried, findings[:1])),
            where=where,
            steps=tuple(taken),
            effects=evidence.effect_values(final, last.covariance.standard_errors),
            parameters=parameter_estimates(
                layout, final.x, prior.centre, last.covariance, np.zeros(layout.size, bool), prior
            ),
            seconds=time.perf_counter() - self.began,
            stopped=self.stopped,
            notes=(
                *(beside.notes(context, parts, final) if beside is not None else ()),
                *last.notes(errors[-1], search.model_error_variance, curve, bandwidths),
            ),
            model=layout.model(final.x),
            maps=maps,
            free_curve=curve,
            guard=bandwidths,
            torque_spread=self.measurements.torque_spread,
        )  # fmt: skip

    def conclude(self, final: Fit) -> Conclusion:
        """The final model, refitted if complete; the set's own model if effects are not applied."""
        search = self.forward
        context = search.context
        changing = None if self.stopped else changing_size(context, final)
        place = search.place
        if changing is not None and place is not None and place.complete and place.joint != changing.named[1]:
            changing = None  # all joints agree with the noise beside a torque elsewhere, with a constant size
        if not self.apply and search.steps:
            return Conclusion(search.base, "missing", context.covariance(search.base), changing=changing)
        if changing is not None:
            return Conclusion(final, "unknown", context.covariance(final), changing=changing)
        last = verdict(final, search.reference)
        if last == "nothing-missing":
            closer = None
            with contextlib.suppress(Interrupted):
                self.say(stages.FINAL_REFIT)
                closer = self.refit.of(final)
            if closer is not None:
                fit = context.fit(final.layout, closer.x, iterations=0, near=final)
                return Conclusion(fit, last, closer.covariance, refined=True)
        return Conclusion(final, last, context.covariance(final))
