"""The course of a diagnosis: the search at the coarse resolution, then at the fine one."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.candidates import rows_without_curves, without_curves
from flexviz.analysis.diagnosis.coarse import Coarse, CoarseModel
from flexviz.analysis.diagnosis.criterion import Gain, confidence, unexplained
from flexviz.analysis.diagnosis.fine import Fine, FineModel
from flexviz.analysis.diagnosis.first_movements import with_first_movements
from flexviz.analysis.diagnosis.fit_context import STEPS, FitContext, Fitted
from flexviz.analysis.diagnosis.prediction_errors import PredictionErrorBand
from flexviz.analysis.diagnosis.search import Search, Tried
from flexviz.analysis.diagnosis.so_far import BestModelTracker
from flexviz.analysis.diagnosis.unknown_curve import is_curve
from flexviz.analysis.diagnosis.varying_size import ChangingSize, changing_size
from flexviz.analysis.estimation import Covariance
from flexviz.analysis.identification import Estimate, Estimator
from flexviz.analysis.motion import MotionContext, Phase, Phases
from flexviz.base.parallel import stopped_by
from flexviz.base.progress import Pace, Progress, ProgressCallback, StopCallback, never
from flexviz.base.statistics import NORMAL_95
from flexviz.content.wording import STAGE_SHARES, SearchStage
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS, ChosenEffect
from flexviz.model.equation import layout_of

LEAST_SURE = 0.5  # what is less likely right than wrong is not in the model


Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Interrupted(Exception):
    """Raised between steps when the user stops the diagnosis."""


@dataclass(frozen=True, eq=False)
class SearchEnd:
    """Where the search ended.

    Attributes:
        coarse, fine: the model at both resolutions, at the fine one without free curves.
        at_noise: whether the fine one decided: no model error is left.
        changing: a size that changes during the recordings.
    """

    coarse: CoarseModel
    fine: FineModel
    at_noise: bool
    changing: ChangingSize | None = None

    @property
    def curves(self) -> tuple[ChosenEffect, ...]:
        """Free curves with which the model was estimated."""
        return tuple(filter(is_curve, self.coarse.layout.effects))


class Course:
    """The search on one set.

    Attributes:
        view, fine: its models at both resolutions.
        trace: the moves that were tried.
        stopped: by the user.
        searching: whether the user can stop it.
        survey: whether it is told what each effect alone would remove.
    """

    def __init__(
        self, measurements: MeasurementSet, progress: ProgressCallback | None, should_stop: StopCallback,
        survey: bool = False,
    ) -> None:  # fmt: skip
        self.measurements, self.progress, self.should_stop = measurements, progress, should_stop
        self.survey = survey
        self.began, self.stopped, self.searching = time.perf_counter(), False, True
        self.pace, self.news = Pace(STAGE_SHARES), Progress()
        self.own = layout_of(measurements)
        self.band = PredictionErrorBand(measurements)
        self.best_model = BestModelTracker(self.own, self.band)
        context = MotionContext(measurements, self.own.joints, stand_ins=True)
        self.view = Coarse(context, self.own, self.say)
        self.fine = Fine(FitContext(measurements, self.own), self.own, self.say)
        self.estimator = Estimator(measurements, context=context)
        self.trace: list[Tried] = []
        self.best: CoarseModel | None = None

    def say(self, text: str) -> None:
        """Report progress; raise `Interrupted` if the user has stopped the search."""
        if self.searching:
            self.stopped = self.stopped or self.should_stop()
            if self.stopped:
                raise Interrupted
        self.tell(text)

    def tell(self, text: str) -> None:
        if text and self.progress is not None:
            self.news = replace(self.pace.news(text), so_far=self.news.so_far, alone=self.news.alone)
            self.progress(self.news)

    def fitted(self, fit: Fitted, first_phase: Phases | None = None) -> None:
        """Report a model if it is the best so far."""
        if self.progress is not None and (best := self.best_model.news(fit, first_phase)) is not None:
            self.news = replace(self.news, so_far=best)
            self.progress(self.news)

    def run(self) -> SearchEnd:
        """The end of the search, or where the user stopped it."""
        try:
            return self.searched()
        except Interrupted:
            self.searching = False
            with stopped_by(never):
                return self.ended(self.best or self.view.begin())
        finally:
            self.searching = False

    def searched(self) -> SearchEnd:
        """The end of the search at both resolutions."""
        return self.refined(self.coarse_search())

    def refined(self, coarse: CoarseModel) -> SearchEnd:
        """The end of the search at the fine resolution, from that at the coarse one."""
        view = self.view
        plain = without_curves(coarse.fit)
        fine = self.fine.begin(plain.layout, plain.x, STEPS if plain.layout == coarse.layout else 0)
        end = SearchEnd(coarse, fine, at_noise=False)
        errs = self.errs(coarse, fine)
        if end.curves or (errs and not view.near(coarse)):
            return end
        self.tell(SearchStage.FINE)
        trace = list[Tried]()
        found = Search(self.fine, trace=trace).run(fine)
        if found.layout != coarse.layout:
            coarse = view.fit(found.layout, found.fit.x)
        if errs and self.errs(coarse, found):  # its effects imitate an error that counts
            return end
        self.trace += trace
        return SearchEnd(coarse, found, True, changing_size(self.fine, found))

    def errs(self, coarse: CoarseModel, fine: FineModel) -> bool:
        """Whether a model errs by more than noise and tolerance.

        Torques at reversals and gap crossings are unknown to the coarse resolution; the fine one accounts
        for them.
        """
        view = self.view
        return bool(view.significant(coarse).any()) and self.fine.errs(
            fine, view.context.noise_floor, view.criterion.least
        )

    def coarse_search(self) -> CoarseModel:
        """The end of the search at the coarse resolution."""
        view = self.view
        self.say(SearchStage.OWN_MODEL)
        bare = self.best = view.begin()
        self.fitted(bare.fit)
        if not view.loud(bare).any():
            return bare
        for joint in (*range(self.own.n), None) if self.survey else ():
            self.news = replace(self.news, alone={**self.news.alone, **view.alone(bare, joint)})
            self.say(SearchStage.SURVEY)
        self.say(SearchStage.USUAL)
        rests = any(bool(np.any(phase < Phase.MOTION)) for phase in view.context.phases)
        if rests and view.context.set_standstill_apart(view.rich().fit):
            bare = view.begin()
        self.say(SearchStage.SEARCH)
        end = self.walked(bare)
        self.say(SearchStage.FOUND)
        return self.completed(end)

    def walked(self, model: CoarseModel) -> CoarseModel:
        """The end of the search from a model, and from there on as long as J can be measured better."""
        while True:
            end = Search(self.view, self.made, self.trace).run(model)
            renewed = self.view.renewed(end)
            if renewed is None:
                return end
            model = renewed

    def completed(self, end: CoarseModel) -> CoarseModel:
        """The end of a search with rest angles in place of offsets, and effects of first movements."""
        view = self.view
        merged = self.noted(end, view.with_rest_angles(end), 0.0)
        larger = with_first_movements(view, merged)
        return self.noted(merged, larger, sum(gain.delta for gain in view.in_start.values()))

    def noted(self, before: CoarseModel, after: CoarseModel, delta: float) -> CoarseModel:
        """A model, with the step that leads to it in the trace."""
        old, new = self.view.parts(before), self.view.parts(after)
        if old != new:
            made = Gain(delta, np.zeros(self.own.n), 0.0)
            kind = "add" if old < new else "swap"
            self.trace.append(Tried(kind, tuple(new - old), tuple(old - new), made, True, self.view.name))
        return after

    def gains(self, end: SearchEnd) -> dict[ChosenEffect, Gain]:
        """What each effect of the final model gains given the others."""
        return self.fine.gains(end.fine) if end.at_noise else self.view.gains(end.coarse)

    def concluded(self, end: SearchEnd) -> tuple[SearchEnd, Estimate]:
        """The end without effects for which there is no evidence, and the estimate of its model."""
        while True:
            if end.curves:
                found = self.estimator.of_motion(end.coarse.fit)
            else:
                known = end.fine.fit if end.at_noise else end.coarse.fit
                found = self.estimator.estimate(known.layout, known.x, known=True)
            weak = self.doubtful(end, found)
            if weak is None:
                return end, found
            self.view.banned = self.fine.banned = self.view.banned | {weak}
            coarse = self.view.without(end.coarse, weak)
            lost = Gain(end.coarse.score.total - coarse.score.total, np.zeros(self.own.n), 0.0)
            old, new = self.view.parts(end.coarse), self.view.parts(coarse)
            kind = "drop" if new < old else "swap"  # a spring leaves an offset
            moved = Tried(kind, tuple(new - old), tuple(old - new), lost, True, self.view.name)
            self.trace.append(moved)
            end = self.refined(self.completed(self.continued(coarse)))

    def continued(self, coarse: CoarseModel) -> CoarseModel:
        """The end of the search from a model, or what it had found when the user stopped it."""
        if self.stopped:
            return coarse
        self.best, self.searching = coarse, True
        try:
            return self.walked(coarse)
        except Interrupted:
            return self.best
        finally:
            self.searching = False

    def without_curves(self, found: Estimate) -> Estimate:
        """An estimate without the free curves beside which its parameters were estimated."""
        kept, layout = rows_without_curves(found.layout), without_curves(found).layout
        start = self.view.context.start(layout)

        def stated(held: Sequence[Bools]) -> list[tuple[Covariance, Covariance]]:
            pairs = found.stated([np.isin(np.arange(len(found.x)), kept[one]) for one in held])
            return [(_cut(a, kept), _cut(b, kept)) for a, b in pairs]

        return replace(
            found, layout=layout, x=found.x[kept], at_bound=found.at_bound[kept], stated=stated,
            prior=start.prior, start=start.x,
        )  # fmt: skip

    def doubtful(self, end: SearchEnd, found: Estimate) -> ChosenEffect | None:
        """The effect for which there is least evidence.

        None if all sizes differ from none at 95 %, and all effects are more likely right than wrong.
        """
        firm, errors = self.view.firm(found.layout), found.covariances
        gains, doubt = self.gains(end), dict[ChosenEffect, float]()
        for effect, where in found.layout.effect_slices():
            if effect in firm:
                continue
            need = gains.get(effect)
            certain = apart_from_none(found.x, effect, where, errors, need)
            samples = (self.fine if end.at_noise else self.view).criterion.samples
            left = 0.0 if end.at_noise or need is None else unexplained(need, samples, effect.joint)
            sure = 1.0 if need is None else confidence(need.delta, left)
            if certain < NORMAL_95 or sure < LEAST_SURE:
                doubt[effect] = min(certain / NORMAL_95, sure / LEAST_SURE)
        return min(doubt, key=lambda e: doubt[e], default=None)

    def made(self, model: CoarseModel) -> None:
        """A model is accepted."""
        self.best = model
        self.fitted(without_curves(model.fit), self.view.context.first_phase)

    def ended(self, coarse: CoarseModel) -> SearchEnd:
        """Where the search stopped."""
        plain = without_curves(coarse.fit)
        return SearchEnd(coarse, self.fine.begin(plain.layout, plain.x, 0), at_noise=False)


def _cut(covariance: Covariance, kept: NDArray[np.intp]) -> Covariance:
    return Covariance(covariance.matrix[np.ix_(kept, kept)], covariance.prior_share[kept])


def apart_from_none(
    x: Array,
    effect: ChosenEffect,
    where: slice,
    errors: tuple[Covariance, Covariance],
    need: Gain | None,
) -> float:
    """By how many standard errors an effect's size differs from none; infinite for one without a size.

    `errors`: stated and of chance alone. By its standard error, or by what the likelihood loses without it: a
    size that hardly differs from others of the same law with another velocity may still be far from none.
    What the model lacks weakens both alike.
    """
    law = EFFECTS[effect.effect]
    sizes = np.array([where.start + k for k in law.size_at], int)
    if not len(sizes):
        return np.inf
    stated, chance = (np.maximum(one.standard_errors[sizes], 1e-300) for one in errors)
    certain = float(np.max(np.abs(x[sizes]) / stated))
    if need is None or law.offset_parameter:  # without a spring its rest angle's torque is missing, too
        return certain
    nats = max(float(need.by_joint.sum()), 0.0)
    return max(certain, float(np.sqrt(2 * nats) * np.max(chance / stated)))
