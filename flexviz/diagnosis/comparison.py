"""Candidates for a place in the model: scored, refitted, compared, added."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from flexviz.diagnosis.candidates import is_episode
from flexviz.diagnosis.fit_context import Fit
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.estimation import Covariance, Projection, ScoredCandidate

LIMITS = THRESHOLDS.search


@dataclass(frozen=True, eq=False)
class CandidateScores:
    """Scores of all candidates at a fit, best first, and the projection used."""

    ranked: list[ScoredCandidate]
    projection: Projection

    @property
    def gains(self) -> dict[ChosenEffect, float]:
        """Gain of each candidate, of an episode in its best stretch."""
        return {s.effect: s.gain for s in reversed(self.ranked)}

    @property
    def leading(self) -> list[ScoredCandidate]:
        """The candidates with the best scores, with a limited number of episodes."""
        chosen: list[ScoredCandidate] = []
        episodes = 0
        for s in self.ranked:
            if is_episode(s.effect):
                episodes += 1
                if episodes > LIMITS.refitted_episodes:
                    continue
            chosen.append(s)
            if len(chosen) == LIMITS.refitted:
                break
        return chosen

    def shortened(self) -> CandidateScores:
        """The same with the signatures of the leading candidates only; all signatures take hundreds of MB."""
        kept = LIMITS.kept_signatures
        rest = [s.without_signature() for s in self.ranked[kept:]]
        return CandidateScores([*self.ranked[:kept], *rest], self.projection)


@dataclass(frozen=True, eq=False)
class RefittedCandidate:
    """A candidate and the model refitted with it."""

    scored: ScoredCandidate
    fit: Fit

    @property
    def effect(self) -> ChosenEffect:
        return self.scored.effect

    def reported(self, covariance: Covariance) -> RefittedCandidate:
        """The same with its covariance, without what takes memory."""
        return RefittedCandidate(self.scored.without_signature(), self.fit.reported(covariance))


@dataclass(frozen=True, eq=False)
class Comparison:
    """Candidates for a place in the model.

    Attributes:
        refitted: those that were refitted, the best first.
        ruled_out: predicted objectives of those that cannot come close to the best.
    """

    refitted: list[RefittedCandidate]
    ruled_out: Mapping[ChosenEffect, float] = field(default_factory=dict)

    @property
    def objectives(self) -> dict[ChosenEffect, float]:
        """Objective of each candidate's best refit, or the predicted one."""
        best = dict(self.ruled_out)
        for r in self.refitted:
            best[r.effect] = min(best.get(r.effect, np.inf), r.fit.objective)
        return best


@dataclass(frozen=True, eq=False)
class SearchStep:
    """One added effect.

    Attributes:
        before: the model without it.
        chosen: the effect with its refit.
        objectives: objectives of the candidates compared, kept instead of their fits (hundreds of MB).
        scores: scores of all candidates at `before`; None for candidates that were not added.
        adapted: refit with the remaining model error; None without a model error.
    """

    before: Fit
    chosen: RefittedCandidate
    objectives: Mapping[ChosenEffect, float]
    scores: CandidateScores | None = None
    adapted: Fit | None = None

    @property
    def after(self) -> Fit:
        """The model with the effect."""
        return self.adapted or self.chosen.fit

    def refitted(self, before: Fit, after: Fit) -> SearchStep:
        """The same effect between other fits; its rivals keep their distance in the objective."""
        move = after.objective - self.chosen.fit.objective
        moved = {effect: objective + move for effect, objective in self.objectives.items()}
        return replace(self, before=before, chosen=replace(self.chosen, fit=after), objectives=moved)


def unscored(effect: ChosenEffect, fit: Fit) -> ScoredCandidate:
    """A candidate whose guesses are all outside its bounds: of no gain, and no size."""
    nothing = np.zeros(len(EFFECTS[effect.effect].parameters))
    return ScoredCandidate(effect, 0.0, nothing, np.zeros(fit.point.r.size))


def optimistic_gain(scored: ScoredCandidate) -> float:
    """Upper estimate of the gain of a refit."""
    return EFFECTS[scored.effect.effect].optimism * scored.gain


def by_objective(refitted: list[RefittedCandidate]) -> list[RefittedCandidate]:
    """Refitted candidates, the best first."""
    return sorted(refitted, key=lambda r: r.fit.objective)


def best_of(refitted: Iterable[RefittedCandidate]) -> RefittedCandidate:
    """The best of refitted candidates, of which two are kept at a time."""
    return min(refitted, key=lambda r: r.fit.objective)
