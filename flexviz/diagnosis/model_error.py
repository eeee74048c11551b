"""Search with a model error, for data that no model explains down to the noise, as on most real robots.

Here the model, not the noise, limits the fit, and weights based on the noise alone would be misleading. A
white model error as large as the residual is added to the noise. An effect is accepted if it reduces the
error of held-out groups by clearly more than the scatter between short stretches.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.acceptance import credible, held_to_be_zero
from flexviz.diagnosis.candidates import ModelStart, with_effect
from flexviz.diagnosis.comparison import CandidateScores, RefittedCandidate, SearchStep, by_objective
from flexviz.diagnosis.evidence import uncertain
from flexviz.diagnosis.fit_context import Fit
from flexviz.diagnosis.free_curve_test import FreeCurveTest
from flexviz.diagnosis.restart import common_values
from flexviz.diagnosis.search import Search
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS
from flexviz.equation import Layout
from flexviz.estimation import Point

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.model_error


class ModelErrorSearch:
    """Adds effects one by one, each confirmed on held-out groups.

    Args:
        search: the search without a model error.
        max_steps: maximum number of effects.

    Attributes:
        variance: shape (n,), variance of the model error [Nm²].
    """

    def __init__(self, search: Search, max_steps: int) -> None:
        self.search, self.max_steps = search, max_steps
        signals = search.context.two_band.narrow.signals
        self.variance = LIMITS.first_error**2 * np.mean(signals.tau[0] ** 2, axis=0)
        self.context = search.context

    def run(self, start: Fit) -> list[SearchStep]:
        """Steps of the search from a model on."""
        fit = self.adapted(start.layout, start.x)
        steps: list[SearchStep] = []
        for _ in range(self.max_steps + LIMITS.restarts):
            if len(steps) == self.max_steps:
                break
            search = Search(self.context, self.search.say)
            scores = search.scores(fit, episodes=False)  # other groups cannot confirm an episode
            plain = self.search.context.fit(fit.layout, fit.x, iterations=0)  # in units of the noise
            test = FreeCurveTest(self.search, plain, self.search.scores(plain, episodes=False))
            chosen = self.confirmed(search, fit, scores, test)
            if chosen is None:
                break
            # a fit in a distant local minimum is improved by any effect that happens to lead out of it
            without = ModelStart(fit.layout, common_values(chosen.fit, fit))
            again = search.fit_from(without, LIMITS.iterations, near=chosen.fit)
            if again.objective < min(fit.objective, chosen.fit.objective + LIMITS.least_score):
                fit = self.adapted(again.layout, again.x)
                continue
            before, fit = fit, self.adapted(chosen.fit.layout, chosen.fit.x)
            objectives = {chosen.effect: chosen.fit.objective}
            step = SearchStep(before, chosen, objectives, scores.shortened(), fit)
            if uncertain(self.context, step, fit):
                break
            steps.append(step)
        return steps

    def adapted(self, layout: Layout, x: Array) -> Fit:
        """Fit with a model error as large as its residual, the better of the starts x and plain fit.

        While an effect is missing, another parameter often compensates for it at an unphysical value (a soft
        joint for friction), from which a local fit may not recover.
        """
        check = self.search.check
        context = self.search.context.with_model_error(self.variance)
        iterations = LIMITS.start_iterations
        starts = (x, context.plain_fit(layout, x, check))
        fits = [context.fit(layout, start, iterations=iterations, check=check) for start in starts]
        fit = min(fits, key=lambda f: f.objective)
        for _ in range(LIMITS.error_rounds):
            self.context = self.search.context.with_model_error(self.variance)
            fit = self.context.fit(layout, fit.x, iterations=LIMITS.iterations, check=check)
            if np.all(np.abs(np.log(fit.chi)) < LIMITS.error_settled):
                break
            self.variance = self.variance * fit.chi
        return fit

    def confirmed(
        self, search: Search, fit: Fit, scores: CandidateScores, test: FreeCurveTest
    ) -> RefittedCandidate | None:
        """The first candidate, best scores first, that held-out groups confirm."""
        left = [s for s in scores.ranked if s.gain > LIMITS.least_score and test.passed(s.effect)]
        left = left[: LIMITS.refused]
        while left:
            batch, left = left[: LIMITS.batch], left[LIMITS.batch :]
            refitted = []
            for scored in batch:
                search.say(f"testing candidate with a model error: {EFFECTS[scored.effect.effect].title}")
                start = with_effect(fit.layout, fit.x, scored.effect, scored.values)
                refit = search.fit_from(start, LIMITS.iterations, near=fit)
                refitted.append(RefittedCandidate(scored, refit))
            for r in by_objective(refitted):
                improves = self.improves(fit, r.fit, r.effect.joint)
                possible = credible(r.fit, r.effect, search.raw_step)
                if improves and possible and not held_to_be_zero(self.context, r.fit, r.effect):
                    return r
        return None

    def improves(self, before: Fit, after: Fit, joint: int | None) -> bool:
        """Whether the held-out variance decreases significantly; that of the fit groups if none are held out.

        On the effect's joint the decrease has to exceed the scatter between stretches; on the other joints
        the variance may change, as long as the joint likelihood rises.
        """
        a, b = before.held_out or before.point, after.held_out or after.point
        blocks = (self.context.validation or self.context.two_band).blocks
        step = float(blocks[0].segment.step * blocks[0].stride)
        length = max(1, round(LIMITS.stretch / step))
        old, new = _stretches(a, length), _stretches(b, length)
        falls = (old - new) / np.maximum(old.mean(axis=0), 1e-300)  # relative to each joint's variance
        each = falls.sum(axis=1) if joint is None else falls[:, joint]
        error = float(each.std(ddof=1) / np.sqrt(len(each))) if len(each) > 2 else np.inf
        mean = float(each.mean())
        together = float(np.log(new.mean(axis=0) / np.maximum(old.mean(axis=0), 1e-300)).sum())
        return mean > max(LIMITS.least_improvement, LIMITS.deviations * error) and together < 0


def _stretches(point: Point, length: int) -> Array:
    """Sums of squares over stretches, shape (S, n)."""
    count = len(point.r) // length
    squares = point.r[: count * length] ** 2
    return squares.reshape(count, length, -1).sum(axis=1)


def imitates(search: Search, step: SearchStep, final: Fit) -> bool:
    """Whether an effect is too uncertain or explains much less than a free curve of its joint.

    Args:
        search: the search that added it.
        step: of that search.
        final: its last model.
    """
    if uncertain(search.context, step, final):
        return True
    if step.chosen.effect.joint is None or step.scores is None:
        return False
    return not FreeCurveTest(search, step.before, step.scores).passed(step.chosen.effect)
