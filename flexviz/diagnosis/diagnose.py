"""Find what is missing: score, refit, decide, add, look again."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from flexviz.diagnosis.acceptance import BEYOND, excess, verdict
from flexviz.diagnosis.bandwidth_check import check_bandwidth
from flexviz.diagnosis.evidence import explain, fit_covariance
from flexviz.diagnosis.final_refit import final_refit
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.free_curve import fit_free_curve
from flexviz.diagnosis.free_curve_test import FreeCurveTest
from flexviz.diagnosis.model_error import STEPS, ModelErrorSearch
from flexviz.diagnosis.notes import notes
from flexviz.diagnosis.prediction_errors import PredictionErrorBand, PredictionErrors
from flexviz.diagnosis.residual_location import where_it_fails
from flexviz.diagnosis.result import Diagnosis, Finding, Step
from flexviz.diagnosis.search import Scores, Search, Tried
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import layout_of
from flexviz.estimation import Covariance
from flexviz.identification import identify, parameter_estimates
from flexviz.measurements import MeasurementSet
from flexviz.model import FlexibleModel
from flexviz.progress import Progress, ProgressCallback, StopCallback
from flexviz.results import Verdict

Array = NDArray[np.float64]

ROUNDS = 5
FIRST = 12  # iterations of the fit that everything begins with


class Interrupted(Exception):
    """Raised between steps when the user stops the diagnosis."""


@dataclass(frozen=True, eq=False)
class SearchStep:
    """One step of the chain: what was added to which fit, how all that was tried did, and where it ended."""

    before: Fit
    chosen: Tried
    objectives: Mapping[ChosenEffect, float]
    scores: Scores
    settled: Fit | None = None  # under another model error than `chosen`

    @property
    def after(self) -> Fit:
        return self.settled or self.chosen.fit


def diagnose(
    measurements: MeasurementSet,
    *,
    apply: bool = True,
    start: FlexibleModel | None = None,
    guarded: bool | None = None,
    progress: ProgressCallback | None = None,
    should_stop: StopCallback | None = None,
) -> Diagnosis:
    """Say whether the set's model is complete, and if not, what is missing.

    Args:
        measurements: the set.
        apply: add the found effects one by one and refit after each. Without it, what is missing first is
            named, and everything else describes the model as it is.
        start: values to start from; a plain identification where None.
        guarded: also look at what moves with the observer's bandwidth; only where the noise is not reached
            where None.
        progress: called between fits.
        should_stop: asked between steps; what was found so far is returned.
    """
    with threadpool_limits(1, "blas"):
        return _Diagnosing(measurements, start, progress, should_stop).run(apply, guarded)


class _Diagnosing:
    def __init__(
        self,
        measurements: MeasurementSet,
        start: FlexibleModel | None,
        progress: ProgressCallback | None,
        should_stop: StopCallback | None,
    ) -> None:
        self.measurements, self.start = measurements, start
        self.progress, self.should_stop = progress, should_stop
        self.layout = layout_of(measurements)
        self.context = FitContext(measurements, self.layout)
        self.search = Search(self.context, self.say)
        self.band = PredictionErrorBand(measurements)
        self.share, self.stopped = 0.0, False
        self.chain: list[SearchStep] = []
        self.tolerance: Array | None = None  # of a model error, where there was one
        self.first: list[Tried] = []  # what was tried for the model the set starts with

    def say(self, text: str) -> None:
        if self.should_stop is not None and self.should_stop():
            self.stopped = True
            raise Interrupted
        self.progressed(text)

    def progressed(self, text: str) -> None:
        """Tell how far it is."""
        if text and self.progress is not None:
            # a share that creeps up: how many steps there will be is not known
            self.share += 0.06 * (1 - self.share)
            self.progress(Progress(text, self.share))

    def run(self, apply: bool, guarded: bool | None) -> Diagnosis:
        began = time.perf_counter()
        base = self.fitted()
        final, self.reference = base, self.context.without_effects(base)
        try:
            base, final = self.rounds(base, apply)
            if verdict(final, self.reference) == "unknown":
                final = self.beyond(base, final, apply)
        except Interrupted:
            final = self.chain[-1].after if self.chain else base
        return self.answer(base, final, began, apply, guarded)

    def fitted(self) -> Fit:
        """The model the set starts with."""
        if self.start is not None:
            x = self.layout.vector(self.start)
        else:
            first = identify(self.measurements, should_stop=self.should_stop)
            x = self.layout.vector(first.model)
        return self.context.fit(self.layout, x, iterations=FIRST)

    def rounds(self, base: Fit, apply: bool) -> tuple[Fit, Fit]:
        """Effects that explain the residual down to the noise, or nearly: the first fit and the last one."""
        fit = base
        for number in range(ROUNDS):
            self.say("looking at what is left")
            scores = self.search.scores(fit)
            gained = self.reference.objective - fit.objective
            tried = self.search.refits(fit, scores, gained)
            if number == 0:
                self.first = tried
            best = self.search.acceptable(fit, tried, gained)
            if best is None:
                break
            if (again := self.search.restarted(fit, best, gained)) is not None:
                fit = again
                if self.chain:
                    last = self.chain[-1]
                    self.chain[-1] = replace(last, chosen=replace(last.chosen, fit=again))
                else:
                    base, self.reference = again, self.context.without_effects(again)
                continue
            link = SearchStep(fit, best, objectives(tried), scores.shortened())
            self.chain.append(link)
            fit = best.fit
            if not apply:
                break
            fit = self.simplified(fit)
        return base, fit

    def simplified(self, fit: Fit) -> Fit:
        """The newest model without what has become superfluous; then the chain is made anew."""
        earlier = tuple(link.chosen.effect for link in self.chain[:-1])
        if not earlier:
            return fit
        simpler, dropped = self.search.simplified(fit, earlier)
        if not dropped:
            return fit
        kept = [link for link in self.chain if link.chosen.effect not in dropped]
        before = self.chain[0].before
        self.chain = []
        for link in kept[:-1]:
            again = self.search.refit(before, link.chosen.scored, FIRST)
            self.chain.append(SearchStep(before, again, link.objectives, link.scores))
            before = again.fit
        last = kept[-1]
        self.chain.append(SearchStep(before, replace(last.chosen, fit=simpler), last.objectives, last.scores))
        return simpler

    def beyond(self, base: Fit, final: Fit, apply: bool) -> Fit:
        """Where the noise is not reached: take back imitations, then add what held-out groups confirm."""
        for k, link in enumerate(self.chain):
            if not self.named(link):
                del self.chain[k:]
                final = link.before
                break
        if excess(final) < BEYOND or (not apply and self.chain):
            return final
        beyond = ModelErrorSearch(self.search, longest=STEPS if apply else 1)
        steps = beyond.run(final)
        self.tolerance = beyond.tolerance if steps else None
        for added in steps:
            self.chain.append(
                SearchStep(
                    added.before,
                    added.tried,
                    objectives([added.tried]),
                    added.scores.shortened(),
                    added.after,
                )
            )
        return steps[-1].after if steps else final

    def named(self, link: SearchStep) -> bool:
        """Whether an effect takes a share of what a free curve on its joint would."""
        effect = link.chosen.effect
        return effect.joint is None or FreeCurveTest(self.search, link.before, link.scores)(effect)

    # -- the answer -------------------------------------------------------------------------------------

    def answer(self, base: Fit, final: Fit, began: float, apply: bool, guarded: bool | None) -> Diagnosis:
        fits = [base, *(link.after for link in self.chain)]
        errors = [self.band.errors(fit) for fit in fits]
        beside = final  # in units of the model error, where there was one
        if self.tolerance is not None:  # judged in units of the noise all the same
            final = self.context.fit(final.layout, final.x, iterations=0)
        found = []
        for a, old, new in zip(self.chain, errors, errors[1:], strict=False):
            ended = final if a.settled is None else beside
            three = (self.band, old, new)
            found.append(explain(self.context, a.before, a.chosen, a.objectives, a.scores, ended, three))
        if not apply and found:  # only looked at: the model stays what it is
            final, last = base, "missing"
        else:
            last = verdict(final, self.reference)
        if last == "nothing-missing" and (closer := self.final_refit(final)) is not None:
            final, covariance = closer
            fits[-1], errors[-1] = final, self.band.errors(final)
        else:
            covariance = fit_covariance(self.context, final)
        added = [None, *found] if apply else [None]
        steps = [
            self.step(finding, fit, error, "missing" if k + 1 < len(fits) else last)
            for k, (finding, fit, error) in enumerate(zip(added, fits, errors, strict=False))
        ]
        prior, _ = self.context.prior_and_bounds(final.layout)
        estimates = parameter_estimates(
            final.layout, final.x, prior.centre, covariance, np.zeros(final.layout.size, bool), prior
        )
        where, maps = where_it_fails(self.context, final)
        reached = last != "unknown"
        curve = watch = None
        if not self.stopped:
            curve = None if reached else fit_free_curve(self.context, final, where[0])
            if guarded or (guarded is None and not reached):
                self.progressed("looking at what moves with the bandwidth")
                watch = check_bandwidth(self.measurements, final.layout, final.x)
        return Diagnosis(
            self.measurements.name,
            steps[0].verdict,
            tuple(self.ranked(base, found)),
            where,
            tuple(steps),
            self.effects(final, covariance.standard_errors),
            estimates,
            time.perf_counter() - began,
            self.stopped,
            notes(final, last, errors[-1], self.tolerance, curve, watch),
            final.layout.model(final.x),
            maps,
            curve,
            watch,
        )

    def final_refit(self, final: Fit) -> tuple[Fit, Covariance] | None:
        """The last model with its best values, and their covariance."""
        try:
            self.say("sharpening the values")
            closer = final_refit(self.measurements, final, self.search.check)
        except Interrupted:
            return None
        if closer is None:
            return None
        fit = self.context.fit(final.layout, closer.x, iterations=0, near=final)
        return fit, closer.covariance

    def step(self, added: Finding | None, fit: Fit, errors: PredictionErrors, verdict_now: Verdict) -> Step:
        return Step(
            added,
            errors.rms,
            errors.rms_validation,
            verdict_now,
            errors.groups,
            errors.noise_floor,
            fit.layout.model(fit.x),
        )

    def ranked(self, base: Fit, found: list[Finding]) -> list[Finding]:
        """Candidates for the model the set starts with: the one that was added, then the others tried."""
        out = found[:1]
        taken = {(f.effect, f.joint, f.group, f.payload) for f in out}
        did = objectives(self.first)
        for t in self.first:
            key = (t.effect.effect, base.layout.joint_name(t.effect), t.effect.group, t.effect.payload)
            if key in taken or base.objective - t.fit.objective <= 0:
                continue
            other = explain(self.context, base, t, did, None, t.fit)
            most = (1 - out[0].confidence if out else 0.5) / (1 + len(out))
            out.append(replace(other, confidence=min(other.confidence, most)))
        return out

    def effects(self, final: Fit, std: Array) -> tuple[dict[str, object], ...]:
        """The final model's effects with their values and standard errors; std has shape (P,)."""
        out = []
        for effect, where in final.layout.effect_slices():
            rows = zip(EFFECTS[effect.effect].parameters, final.x[where], std[where], strict=True)
            out.append(
                {
                    "effect": effect.effect,
                    "joint": final.layout.joint_name(effect),
                    "group": effect.group,
                    "payload": effect.payload,
                    "parameters": {
                        p.name: {"value": float(v), "std": float(e), "unit": p.unit} for p, v, e in rows
                    },
                }
            )
        return tuple(out)


def objectives(tried: Iterable[Tried]) -> dict[ChosenEffect, float]:
    """How well each candidate did; the fits themselves hold hundreds of MB on long records."""
    best: dict[ChosenEffect, float] = {}
    for t in tried:
        best[t.effect] = min(best.get(t.effect, np.inf), t.fit.objective)
    return best
