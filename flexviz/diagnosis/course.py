"""The course of a diagnosis: the search at the coarse resolution, then at the fine one."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from flexviz.diagnosis import so_far as stages
from flexviz.diagnosis.coarse import Coarse, CoarseModel
from flexviz.diagnosis.criterion import gain
from flexviz.diagnosis.fine import Fine, FineModel
from flexviz.diagnosis.fit_context import STEPS, FitContext
from flexviz.diagnosis.model_family import without_curves
from flexviz.diagnosis.motion_fit import MotionContext
from flexviz.diagnosis.prediction_errors import PredictionErrorBand
from flexviz.diagnosis.search import Search, Tried
from flexviz.diagnosis.so_far import Standing
from flexviz.diagnosis.unknown_curve import is_curve
from flexviz.diagnosis.varying_size import ChangingSize, changing_size
from flexviz.effects import ChosenEffect
from flexviz.equation import layout_of
from flexviz.measurements import MeasurementSet
from flexviz.parallel import stopped_by
from flexviz.progress import BestSoFar, Progress, ProgressCallback, StopCallback, never


class Interrupted(Exception):
    """Raised between steps when the user stops the diagnosis."""


@dataclass(frozen=True, eq=False)
class SearchEnd:
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


class Course:
    """The search on one set.

    Attributes:
        view, fine: its models at both resolutions.
        trace: the moves that were tried.
        stopped: by the user.
        searching: whether the user can stop it.
    """

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
        context = MotionContext(measurements, self.own.joints, stand_ins=True)
        self.view = Coarse(context, self.own, self.say)
        self.fine = Fine(FitContext(measurements, self.own), self.own, self.say)
        self.trace: list[Tried] = []
        self.best: CoarseModel | None = None
        self.searching = True

    def say(self, text: str) -> None:
        """Report progress; raise `Interrupted` if the user has stopped the search."""
        if self.searching:
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

    def run(self) -> SearchEnd:
        """The end of the search, or where the user stopped it."""
        try:
            return self.searched()
        except Interrupted:
            self.searching = False
            with stopped_by(never):
                return self.ended(self.best or self.view.bare(), "coarse")
        finally:
            self.searching = False

    def searched(self) -> SearchEnd:
        """The end of the search at both resolutions."""
        coarse = self.coarse_search()
        view = self.view
        end = self.ended(coarse, "fine")
        if end.curves or (view.significant(coarse).any() and not self.fine.complete(end.fine)):
            return replace(end, resolution="coarse")
        self.tell(stages.FINE)
        assert view.reference is not None
        self.fine.reference = end.fine.likelihood
        self.fine.explained = np.maximum(gain(view.reference, coarse.likelihood).by_joint, 0.0)
        search = Search(self.fine, trace=self.trace)
        found = search.run(end.fine)
        model = end.coarse
        if found.layout != end.coarse.layout:
            model = view.fit(found.layout, found.fit.x, iterations=5)
        return SearchEnd(model, found, "fine", (), changing_size(self.fine, found))

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
        if view.significant(rich).any() and view.context.set_standstill_apart(rich.fit):
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

    def ended(self, coarse: CoarseModel, resolution: str) -> SearchEnd:
        curves = tuple(filter(is_curve, coarse.layout.effects))
        plain = without_curves(coarse.fit, curves)
        iterations = STEPS if resolution == "fine" and not curves else 0
        return SearchEnd(coarse, self.fine.fit(plain.layout, plain.x, iterations), resolution, curves)
