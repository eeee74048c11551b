"""Diagnosis of a set: score, refit and accept candidate effects one by one, then describe the final model."""

from __future__ import annotations

import contextlib
import time
from dataclasses import replace
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from flexviz.diagnosis import evidence, stages
from flexviz.diagnosis.acceptance import excess, exhausted, quiet, verdict
from flexviz.diagnosis.bandwidth_check import check_bandwidth
from flexviz.diagnosis.candidates import ModelStart, NearNoise
from flexviz.diagnosis.comparison import RefittedCandidate, SearchStep
from flexviz.diagnosis.conclusion import Conclusion
from flexviz.diagnosis.constancy import changing_size, removed, unexplained
from flexviz.diagnosis.curve_step import why_no_curve, with_free_curve
from flexviz.diagnosis.final_refit import EarlyRefit
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.free_curve import fit_free_curve
from flexviz.diagnosis.many_effects import ManyEffects
from flexviz.diagnosis.model_error import ModelErrorSearch, imitates
from flexviz.diagnosis.own_start import GivenStart, OwnStart
from flexviz.diagnosis.prediction_errors import PredictionErrorBand
from flexviz.diagnosis.residual_location import locate_residual
from flexviz.diagnosis.result import Diagnosis
from flexviz.diagnosis.search import Search
from flexviz.diagnosis.so_far import Standing
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.equation import layout_of
from flexviz.identification import parameter_estimates
from flexviz.measurements import MeasurementSet
from flexviz.parallel import stopped_by
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
    free_curve: bool = False,
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
        free_curve: with `apply`, after a last verdict of "unknown": add the free curve of the residual.
        progress: called between fits.
        should_stop: called between fits; True ends the diagnosis with the findings so far.
    """
    with threadpool_limits(1, "blas"), stopped_by(should_stop or never):
        pipeline = _Pipeline(measurements, start, progress, should_stop)
        with pipeline.beside:
            result = pipeline.run(apply, guarded)
        if apply and free_curve and not why_no_curve(result):
            result = pipeline.with_curve(result)
        if result.stopped and not result.findings and (best := pipeline.news.so_far) is not None:
            result = replace(result, notes=(*result.notes, Note("other", best.stopped)))
        if progress is not None and not result.stopped:
            progress(pipeline.pace.done())
        return result


class _Pipeline:
    """State of one diagnosis.

    Attributes:
        base: fit of the set's own model.
        reference: the same parameters without any effects.
        steps: effects added so far.
        tried: candidates refitted for the base model.
        beside: ends what was begun beside the search.
        model_error_variance: shape (n,) [Nm²], allowed in the later steps; None if there is none.
    """

    def __init__(
        self,
        measurements: MeasurementSet,
        start: GivenStart,
        progress: ProgressCallback | None,
        should_stop: StopCallback | None,
    ) -> None:
        self.measurements, self.progress, self.should_stop = measurements, progress, should_stop
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
        self.steps: list[SearchStep] = []
        self.tried: list[RefittedCandidate] = []
        self.model_error_variance: Array | None = None

    @property
    def final(self) -> Fit:
        """The last model so far."""
        return self.steps[-1].after if self.steps else self.base

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

    def run(self, apply: bool, guarded: bool | None) -> Diagnosis:
        many = ManyEffects(self.measurements, self.layout, self.error_band, self.say, self.standing)
        rich, begun = None, False
        try:
            near = many.search.near_noise()
            if near is not None:
                many.search.forget()
                self.refit.begin(near)
                self.prepare(LIMITS.short_refit if near.rivals else LIMITS.first_iterations)
            if begun := near is not None or self.near_noise_beside_reversals(many):
                self.add_effects(apply, near)
            if not begun or unexplained(self.context, self.final, self.reference):
                rich = many.find()
        except Interrupted:
            if (best := many.search.best) is not None:
                rich = many.worth_showing(best)
                self.start.use(best.fit.layout.model(best.fit.x))
        if rich is not None:
            result = many.result(rich, apply, bool(guarded) and not self.stopped, self.tell)
            return replace(result, seconds=time.perf_counter() - self.began, stopped=self.stopped)
        if not begun:
            del many  # its fits take as much memory as what follows
            self.prepare(0 if self.stopped else LIMITS.first_iterations)
        try:
            self.check_stop()
            if not begun:
                self.add_effects(apply)
            if unexplained(self.context, self.final, self.reference):
                self.continue_beside_model_error(apply)
        except Interrupted:
            pass  # the result contains the findings so far
        return self.result(apply, guarded)

    def with_curve(self, result: Diagnosis) -> Diagnosis:
        """The result with a free curve; without if the user stops it."""
        try:
            longer = with_free_curve(self.measurements, result, self.say)
        except Interrupted:
            return replace(result, stopped=True)
        return replace(longer, seconds=time.perf_counter() - self.began)

    def prepare(self, iterations: int = LIMITS.first_iterations) -> None:
        """Fit the set's own model in units of the noise."""
        self.context = FitContext(self.measurements, self.layout)
        self.search = Search(self.context, self.say)
        self.beside.callback(self.search.restart.foreseen.close)
        x = self.layout.vector(self.start.model())
        self.base = self.context.fit(self.layout, x, iterations=iterations)
        self.reference = self.context.without_effects(self.base)

    def near_noise_beside_reversals(self, many: ManyEffects) -> bool:
        """Prepare the search on a model with friction if its fit, which knows reversals, is near noise."""
        if not self.layout.has_reversals:
            return False
        self.say(stages.OWN_MODEL)
        self.prepare()
        if near := quiet(self.base):
            many.search.forget()
        else:
            self.start.use(self.layout.model(self.base.x))
            del self.context, self.search, self.base, self.reference  # they take memory
        return near

    def check_stop(self) -> None:
        self.say("")

    # -- the search

    def add_effects(self, apply: bool, near: NearNoise | None = None) -> None:
        """Add effects until no candidate is acceptable; `near`: a model that may explain all."""
        for number in range(LIMITS.rounds):
            fit = self.final
            self.say("scoring candidate effects")
            if (apply or not self.steps) and verdict(fit, self.reference) == "nothing-missing":
                self.refit.begin(ModelStart(fit.layout, fit.x))
            gained = self.reference.objective - fit.objective
            if self.steps and exhausted(fit, gained):
                break
            scores, compared = self.search.compare(fit, gained, near if number == 0 else None)
            if number == 0:
                lower = (r for r in compared.refitted if r.fit.objective < fit.objective)
                self.tried = [r.reported(self.context.covariance(r.fit)) for r in lower]
            best = self.search.acceptable(fit, compared.refitted, gained)
            if best is None or changing_size(self.context, fit, removed(fit, best)):
                break
            if (again := self.search.restarted(fit, best, gained)) is not None:
                self.replace_final(again)
                continue
            self.steps.append(SearchStep(fit, best, compared.objectives, scores.shortened()))
            self.standing.fitted(best.fit)
            del fit, best, compared, scores  # the next round needs as much memory
            if not apply:
                break
            self.drop_superfluous()

    def replace_final(self, fit: Fit) -> None:
        """Replace the fit of the final model by a better one from other start values."""
        if self.steps:
            last = self.steps[-1]
            self.steps[-1] = replace(last, chosen=replace(last.chosen, fit=fit))
        else:
            self.base, self.reference = fit, self.context.without_effects(fit)

    def drop_superfluous(self) -> None:
        """Drop earlier effects that the newest one made superfluous, and refit the steps without them."""
        earlier = tuple(step.chosen.effect for step in self.steps[:-1])
        simpler = self.search.without_superfluous(self.final, earlier)
        dropped = set(self.final.layout.effects) - set(simpler.layout.effects)
        if not dropped:
            return
        *kept, last = (step for step in self.steps if step.chosen.effect not in dropped)
        before, steps = self.steps[0].before, []
        for step in kept:
            again = self.search.refit(before, step.chosen.scored, LIMITS.first_iterations)
            steps.append(replace(step, before=before, chosen=again))
            before = again.fit
        self.steps = [*steps, replace(last, before=before, chosen=replace(last.chosen, fit=simpler))]

    def continue_beside_model_error(self, apply: bool) -> None:
        """Withdraw imitations, then add effects that held-out groups confirm, allowing for a model error."""
        limits = THRESHOLDS.model_error
        self.steps = list(takewhile(lambda s: not imitates(self.search, s, self.final), self.steps))
        if excess(self.final) < limits.needed_excess or (not apply and self.steps):
            return
        search = ModelErrorSearch(self.search, limits.effects if apply else 1)
        if steps := search.run(self.final):
            self.steps += steps
            self.model_error_variance = search.variance

    # -- the result -------------------------------------------------------------------------------------

    def result(self, apply: bool, guarded: bool | None) -> Diagnosis:
        """Findings, final model and residuals."""
        fits = [self.base, *(step.after for step in self.steps)]
        errors = [self.error_band.errors(fit) for fit in fits]
        in_noise_units = self.final
        if self.model_error_variance is not None:
            in_noise_units = self.context.fit(self.final.layout, self.final.x, iterations=0)
        findings = [
            evidence.explain(
                self.context,
                step,
                in_noise_units if step.adapted is None else self.final,
                evidence.explained_residual(
                    step.before.layout, step.chosen.effect.joint, self.error_band, before, after
                ),
            )
            for step, before, after in zip(self.steps, errors, errors[1:], strict=False)
        ]
        last = self.conclude(in_noise_units, apply)
        findings = last.doubted(findings)
        if last.refined:
            fits[-1], errors[-1] = last.fit, self.error_band.errors(last.fit)
        added = [None, *findings] if apply else [None]
        verdicts: list[Verdict] = [*("missing" for _ in self.steps), last.verdict]
        taken = [evidence.made_step(*each) for each in zip(added, fits, errors, verdicts, strict=False)]
        final, layout = last.fit, last.fit.layout
        prior = self.context.start(layout).prior
        where, maps, parts = locate_residual(self.context, final)
        curve = bandwidths = None
        reached = last.verdict != "unknown"
        if not self.stopped:
            curve = None if reached else fit_free_curve(self.context, final, where[0], parts)
            if guarded or (guarded is None and not reached and last.changing is None):
                self.tell(stages.BANDWIDTH)
                bandwidths = check_bandwidth(self.measurements, layout, final.x)
        return Diagnosis(
            set_name=self.measurements.name,
            verdict=taken[0].verdict,
            findings=tuple(evidence.ranked(self.context, self.base, self.tried, findings[:1])),
            where=where,
            steps=tuple(taken),
            effects=evidence.effect_values(final, last.covariance.standard_errors),
            parameters=parameter_estimates(
                layout, final.x, prior.centre, last.covariance, np.zeros(layout.size, bool), prior
            ),
            seconds=time.perf_counter() - self.began,
            stopped=self.stopped,
            notes=last.notes(errors[-1], self.model_error_variance, curve, bandwidths),
            model=layout.model(final.x),
            maps=maps,
            free_curve=curve,
            guard=bandwidths,
            torque_spread=self.measurements.torque_spread,
        )  # fmt: skip

    def conclude(self, final: Fit, apply: bool) -> Conclusion:
        """The final model, refitted if complete; the set's own model if effects are not applied."""
        changing = None if self.stopped else changing_size(self.context, final)
        if not apply and self.steps:
            return Conclusion(self.base, "missing", self.context.covariance(self.base), changing=changing)
        if changing is not None:
            return Conclusion(final, "unknown", self.context.covariance(final), changing=changing)
        last = verdict(final, self.reference)
        if last == "nothing-missing":
            closer = None
            with contextlib.suppress(Interrupted):
                self.say(stages.FINAL_REFIT)
                closer = self.refit.of(final)
            if closer is not None:
                fit = self.context.fit(final.layout, closer.x, iterations=0, near=final)
                return Conclusion(fit, last, closer.covariance, refined=True)
        return Conclusion(final, last, self.context.covariance(final))
