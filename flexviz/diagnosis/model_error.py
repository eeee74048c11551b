"""The search where no model reaches the noise, as on most real robots.

There the model, not the noise, is what is wrong, and measuring its errors in units of the noise would weigh
up what does not matter. A white model error as large as what is left is added to the noise; an effect counts
if it lowers the error of groups it was not fitted to, clearly beyond what chance does between stretches of
half a second.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.acceptance import credible
from flexviz.diagnosis.candidates import with_effect
from flexviz.diagnosis.fit_context import Fit
from flexviz.diagnosis.free_curve_test import FreeCurveTest
from flexviz.diagnosis.search import Scores, Search, Tried
from flexviz.effects import EFFECTS
from flexviz.equation import Layout
from flexviz.estimation import Point

Array = NDArray[np.float64]

FIRST = 0.05  # first guess of the model error, relative to the torque's rms
ROUNDS = 6  # in which it is found
STEPS = 14  # effects at most
REFUSED = 9  # end the search
BATCH = 3  # are refitted before the best of them is taken
LEAST_SCORE = 10.0
STRETCH = 0.5  # [s]
CLEAR = 2.0  # standard errors of the held-out improvement
LEAST = 0.02  # of one joint's held-out variance
ITERATIONS = 5
AFRESH = 8


@dataclass(frozen=True, eq=False)
class Added:
    """One step.

    Attributes:
        tried: the effect with its refit, under the same model error as `before`.
        before: the model without it.
        after: with it, under the model error that is left.
        scores: of all candidates.
        improvement: share by which the held-out variance fell.
    """

    tried: Tried
    before: Fit
    after: Fit
    scores: Scores
    improvement: float


class ModelErrorSearch:
    """Adds effects one by one, each confirmed on held-out groups.

    Args:
        search: of the same workbench.
        longest: most steps.
    """

    def __init__(self, search: Search, longest: int = STEPS) -> None:
        self.search, self.longest = search, longest
        signals = search.context.two_band.narrow.signals
        self.tolerance = FIRST**2 * np.mean(signals.tau[0] ** 2, axis=0)
        self.context = search.context

    def settled(self, layout: Layout, x: Array) -> Fit:
        """A fit under a model error of its own size, from x or from where a plain fit leads.

        While an effect is missing, another parameter often stands in for it, far from where it belongs (a
        soft joint for friction); from there the way back may be closed.
        """
        check = self.search.check
        context = self.search.context.with_model_error(self.tolerance)
        rough = context.plain_fit(layout, x, check)
        starts = [context.fit(layout, start, iterations=AFRESH, check=check) for start in (x, rough)]
        x = min(starts, key=lambda f: f.objective).x
        fit = None
        for _ in range(ROUNDS):
            self.context = self.search.context.with_model_error(self.tolerance)
            fit = self.context.fit(layout, x, iterations=ITERATIONS, check=self.search.check)
            x = fit.x
            if np.all(np.abs(np.log(fit.chi)) < 0.25):
                break
            self.tolerance = self.tolerance * fit.chi
        assert fit is not None
        return fit

    def run(self, start: Fit) -> list[Added]:
        """What is added to a model."""
        fit = self.settled(start.layout, start.x)
        steps: list[Added] = []
        for _ in range(self.longest):
            search = Search(self.context, self.search.say)
            scores = search.scores(fit, episodes=False)  # an episode cannot be confirmed on other groups
            plain = self.search.context.fit(fit.layout, fit.x, iterations=0)  # in units of the noise
            named = FreeCurveTest(self.search, plain, self.search.scores(plain, episodes=False))
            added = self.next(search, fit, scores, named)
            if added is None:
                break
            fit = self.settled(added.tried.fit.layout, added.tried.fit.x)
            steps.append(replace(added, after=fit))
        return steps

    def next(self, search: Search, fit: Fit, scores: Scores, named: FreeCurveTest) -> Added | None:
        """The first candidate, best scores first, that held-out groups confirm."""
        left = [s for s in scores.ranked if s.gain > LEAST_SCORE and named(s.effect)][:REFUSED]
        while left:
            batch, left = left[:BATCH], left[BATCH:]
            tried = []
            for scored in batch:
                search.say(f"trying {EFFECTS[scored.effect.effect].title.lower()} beside a model error")
                layout, x = with_effect(fit.layout, fit.x, scored.effect, scored.values)
                refit = self.context.fit(layout, x, iterations=ITERATIONS, check=search.check, near=fit)
                tried.append(Tried(scored, refit))
            for t in sorted(tried, key=lambda t: t.fit.objective):
                better = self.improvement(fit, t.fit, t.effect.joint)
                if better is not None and credible(t.fit, t.effect, search.raw_step):
                    return Added(t, fit, t.fit, scores, better)
        return None

    def improvement(self, before: Fit, after: Fit, joint: int | None) -> float | None:
        """Share by which the held-out variance falls (the fit groups' without any); None if not clearly.

        The effect's own joint must fall clearly beyond what chance does between stretches; the others may
        scatter, as long as the likelihood of all together rises.
        """
        a, b = before.held_out or before.point, after.held_out or after.point
        blocks = (self.context.validation or self.context.two_band).blocks
        step = float(blocks[0].segment.step * blocks[0].stride)
        length = max(1, round(STRETCH / step))
        old, new = _stretches(a, length), _stretches(b, length)
        falls = (old - new) / np.maximum(old.mean(axis=0), 1e-300)  # relative to each joint's own
        each = falls.sum(axis=1) if joint is None else falls[:, joint]
        error = float(each.std(ddof=1) / np.sqrt(len(each))) if len(each) > 2 else np.inf
        mean = float(each.mean())
        together = float(np.log(new.mean(axis=0) / np.maximum(old.mean(axis=0), 1e-300)).sum())
        return mean if mean > LEAST and mean > CLEAR * error and together < 0 else None


def _stretches(point: Point, length: int) -> Array:
    """Sums of squares over stretches, shape (S, n)."""
    count = len(point.r) // length
    squares = point.r[: count * length] ** 2
    return squares.reshape(count, length, -1).sum(axis=1)
