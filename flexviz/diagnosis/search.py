"""One round of the search: score all candidates, refit the best, drop superfluous effects."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis import stages
from flexviz.diagnosis.acceptance import (
    Gained,
    credible,
    excess,
    held_to_be_zero,
    needed_gain,
    only_an_offset,
    removed_share,
    structured,
)
from flexviz.diagnosis.candidates import (
    ModelStart,
    NearNoise,
    candidates,
    is_episode,
    with_effect,
    without_effect,
)
from flexviz.diagnosis.comparison import (
    CandidateScores,
    Comparison,
    RefittedCandidate,
    best_of,
    by_objective,
    optimistic_gain,
)
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.hidden_starts import doubtful_joints, hidden_trials, loudest, stands_out
from flexviz.diagnosis.refits import best_refits
from flexviz.diagnosis.restart import Restart, common_values
from flexviz.diagnosis.scoring import score_by_joint
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import layout_of
from flexviz.estimation import ScoredCandidate, Weigh
from flexviz.wording import plural

Array = NDArray[np.float64]

ACCEPTANCE, EVIDENCE, LIMITS = THRESHOLDS.acceptance, THRESHOLDS.evidence, THRESHOLDS.search


class Search:
    """Rounds of the search on one context.

    Args:
        context: the data.
        say: called with a progress message; may raise to stop.

    Attributes:
        expected: effects that probably explain everything together.
    """

    def __init__(self, context: FitContext, say: Callable[[str], None]) -> None:
        self.context, self.say = context, say
        self.restart = Restart(context, self.check)
        self.given = len(layout_of(context.measurements).effects)  # effects of the set's own model
        self.raw_step = max(s.step for g in context.fit_groups for s in g.segments)
        self.expected: frozenset[ChosenEffect] = frozenset()

    def check(self) -> None:
        self.say("")

    def go_on_with(self, context: FitContext) -> None:
        """Look at the data in another way from now on."""
        self.context = self.restart.context = context

    # -- scores

    def scores(
        self,
        fit: Fit,
        only: Collection[ChosenEffect] | None = None,
        episodes: bool = True,
        joint: int | None = None,
    ) -> CandidateScores:
        """Scores of all candidates at a fit, or of those in `only`, or of those that act on a joint."""
        layout = fit.layout
        narrow = self.context.two_band.with_layout(layout).narrow.at(fit.x)
        projection = self.context.projection(fit)
        weigh = self.weigh(fit)
        wanted = candidates(layout, self.context.measurements.groups)
        if only is not None:
            wanted = [e for e in wanted if e in only]
            episodes = any(map(is_episode, only))
        ranked = score_by_joint(
            narrow, self.context.chain(fit), wanted, weigh, projection, check=self.check,
            longest=LIMITS.longest_episode if episodes else None, without=layout.effects,
            joints=None if joint is None else [joint, None],
        )  # fmt: skip
        return CandidateScores(ranked, projection)

    def weigh(self, fit: Fit) -> Weigh:
        """Function that weights the columns of a stretch like the residual of a fit."""
        point, blocks = fit.point, self.context.two_band.blocks

        def weigh(columns: Array, block: int) -> Array:
            out = point.weightings[block].apply(columns)
            out[~point.used[blocks[block].rows]] = 0.0
            return out.reshape(-1, columns.shape[2])

        return weigh

    # -- refits

    def compare(
        self, fit: Fit, gained: Gained, near: NearNoise | None = None
    ) -> tuple[CandidateScores, Comparison]:
        """Scores of the candidates for the next place in the model, and the leading ones refitted.

        Args:
            fit: the present model.
            gained: gain of earlier effects.
            near: a model with one more effect that may explain everything.
        """
        if near is not None and near.rivals:
            scores = self.scores(fit, near.rivals)
            if (confirmed := self.confirmed(fit, scores, near, gained)) is not None:
                return scores, confirmed
        scores = self.scores(fit)
        return scores, self.refits(fit, scores, gained)

    def refits(self, fit: Fit, scores: CandidateScores, gained: Gained) -> Comparison:
        """The leading candidates refitted, best first; earlier effects gained `gained`."""
        chosen = [s for s in scores.leading if optimistic_gain(s) > needed_gain(s.effect, gained)]
        first = self.refit_leader(fit, chosen[0]) if chosen else None
        if first is not None and self.explains_everything(fit, first.fit):
            return self.rivals(fit, first, chosen[1:])
        refitted = [*([first] if first else []), *self.short_refits(fit, chosen[1:])]
        hidden = excess(fit) > LIMITS.hidden_excess  # more than the scores explain
        started = len(fit.layout.effects) > self.given
        loud = loudest(fit, LIMITS.hidden_joints if hidden else 1)
        if hidden and not started and not self.leads_as_expected(fit, refitted):
            refitted += self.underrated(fit, loud, scores)
        refitted = self.halving(refitted)
        if stands_out(fit) and (started or not hidden) and self.acceptable(fit, refitted, gained) is None:
            everywhere = scores if excess(fit) > LIMITS.faint_excess else None
            more = self.halving(self.underrated(fit, loud, everywhere))
            refitted += [r for r in more if removed_share(fit, r.fit) > LIMITS.hidden_removed]
        return Comparison(by_objective(refitted))

    def leads_as_expected(self, fit: Fit, refitted: list[RefittedCandidate]) -> bool:
        """Whether the best of the refitted candidates is one of several effects that are expected."""
        left = self.expected - set(fit.layout.effects)
        return len(left) > 1 and bool(refitted) and by_objective(refitted)[0].effect in left

    def confirmed(
        self, fit: Fit, scores: CandidateScores, guess: ModelStart, gained: Gained
    ) -> Comparison | None:
        """A guessed model with one more effect and its rivals; None if it leaves something."""
        scored = [s for s in scores.ranked if (*fit.layout.effects, s.effect) == guess.layout.effects]
        if not scored:
            return None
        self.say(f"testing candidate: {EFFECTS[scored[0].effect.effect].title}")
        first = RefittedCandidate(scored[0], self.fit_from(guess, LIMITS.full_refit, near=fit))
        if not self.explains_everything(fit, first.fit):
            return None
        first = self.converged(first)
        if excess(fit) >= LIMITS.far_off:
            self.restart.begin(fit, first, gained)
        others = [s for s in scores.leading if s.effect != first.effect]
        return self.rivals(fit, first, others)

    def explains_everything(self, before: Fit, after: Fit) -> bool:
        """Whether hardly any excess is left to explain."""
        enough = excess(after) < max(LIMITS.explained_excess * excess(before), LIMITS.explained_floor)
        return enough and not structured(after, before) and after.objective < before.objective

    def refit(self, fit: Fit, scored: ScoredCandidate, iterations: int) -> RefittedCandidate:
        """Refit of one candidate from the present model."""
        self.say(f"testing candidate: {EFFECTS[scored.effect.effect].title}")
        start = with_effect(fit.layout, fit.x, scored.effect, scored.values)
        return RefittedCandidate(scored, self.fit_from(start, iterations, near=fit))

    def afresh(self, start: ModelStart, iterations: int) -> Fit:
        """Fit from a plain one, which takes only the effects' values from a start that may be far off."""
        x = self.context.plain_fit(start.layout, start.x, self.check)
        return self.fit_from(ModelStart(start.layout, x), iterations)

    def fit_from(
        self, start: ModelStart, iterations: int, near: Fit | None = None, beat: float = np.inf
    ) -> Fit:
        return self.context.fit(
            start.layout, start.x, iterations=iterations, check=self.check, near=near, beat=beat
        )

    def continued(self, fit: Fit, iterations: int, beat: float = np.inf) -> Fit:
        return self.fit_from(ModelStart(fit.layout, fit.x), iterations, near=fit, beat=beat)

    def refit_leader(self, fit: Fit, scored: ScoredCandidate) -> RefittedCandidate:
        """Full refit of the candidate with the best score; also from a plain fit if much excess is left."""
        direct = self.converged(self.refit(fit, scored, LIMITS.full_refit))
        if excess(fit) < LIMITS.far_off or excess(direct.fit) < LIMITS.noise_reached:
            return direct
        start = with_effect(fit.layout, fit.x, scored.effect, scored.values)
        return best_of((direct, RefittedCandidate(scored, self.afresh(start, LIMITS.full_refit))))

    def short_refits(self, fit: Fit, chosen: list[ScoredCandidate]) -> list[RefittedCandidate]:
        """A few iterations per candidate, from the present model and, if far off, also from a plain fit."""

        def refit(trial: tuple[ModelStart, bool]) -> Fit:
            way = self.afresh if trial[1] else partial(self.fit_from, near=fit)
            return way(trial[0], LIMITS.short_refit)

        if chosen:
            self.say(f"testing {plural(len(chosen), 'other candidate')}")
        ways = (False, True) if excess(fit) > LIMITS.far_off else (False,)
        starts = ((s, with_effect(fit.layout, fit.x, s.effect, s.values)) for s in chosen)
        trials = [(s, (start, afresh)) for s, start in starts for afresh in ways]
        return best_refits(trials, refit, partial(self.fit_from, iterations=0, near=fit))

    def underrated(
        self, fit: Fit, loud: list[int], scores: CandidateScores | None
    ) -> list[RefittedCandidate]:
        """Refits of effects whose scores mean little (`hidden_trials`)."""
        trials = hidden_trials(self.context, fit, loud, scores)
        self.say(f"testing {plural(len(trials), 'start')} of effects that may be hidden")
        refit = partial(self.fit_from, iterations=LIMITS.short_refit, near=fit)
        return best_refits(trials, refit, partial(refit, iterations=0))

    def rivals(self, fit: Fit, leader: RefittedCandidate, others: list[ScoredCandidate]) -> Comparison:
        """The other candidates from the values of a leader that explains everything.

        Only those are refitted that come close in closed form, at the leader's values without its effect or,
        near the noise, at the present model's: a load may depend much on values that the leader moves.
        """
        gain = max(fit.objective - leader.fit.objective, ACCEPTANCE.least_gain)
        tied = leader.fit.point.objective + max(EVIDENCE.tied_gain, EVIDENCE.tied_share * gain)
        close = [s for s in others if s.gain >= LIMITS.close_score * leader.scored.gain]
        common = common_values(leader.fit, fit)
        there = self.fit_from(ModelStart(fit.layout, common), 0, near=leader.fit)
        gains = self.scores(there, {leader.effect, *(s.effect for s in close)}).gains
        all_of_it = gains.get(leader.effect, 0.0)  # missing if none of its guesses is within its bounds there
        near_noise = excess(fit) < LIMITS.hidden_excess
        limit = leader.fit.objective + LIMITS.rival_deficit * gain
        trials, ruled_out = [], {}
        for s in close:
            left = all_of_it - gains.get(s.effect, 0.0)
            if near_noise:
                left = min(left, leader.scored.gain - s.gain)
            deficit = there.point.r.size * float(np.log1p(max(left, 0.0) / there.point.r.size))
            linear = EFFECTS[s.effect.effect].linear and deficit > LIMITS.rival_deficit * gain
            if linear or left > LIMITS.close_alone * all_of_it:
                ruled_out[s.effect] = leader.fit.objective + deficit
            else:
                trials.append((s, with_effect(fit.layout, common, s.effect, s.values)))

        def refit(start: ModelStart) -> Fit:
            rival = self.fit_from(start, LIMITS.short_refit, near=leader.fit, beat=limit)
            done = rival.converged or rival.objective > limit
            return rival if done else self.continued(rival, LIMITS.full_refit, beat=tied)

        if names := sorted({EFFECTS[s.effect.effect].title for s, _ in trials}):
            self.say(f"comparing with: {', '.join(names)}")
        out = best_refits(trials, refit, partial(self.fit_from, iterations=0, near=leader.fit))
        if loud := doubtful_joints(fit, leader, close):
            hidden = self.underrated(fit, loud, None)
            out += self.halving([r for r in hidden if r.effect != leader.effect])
        return Comparison(by_objective([leader, *out]), ruled_out)

    def halving(self, refitted: list[RefittedCandidate]) -> list[RefittedCandidate]:
        """Best refit of each effect; successively fewer leading ones are continued for longer."""
        best = {r.effect: r for r in reversed(by_objective(refitted))}
        refitted = by_objective(list(best.values()))
        for keep, iterations in ((3, LIMITS.longer_refit), (2, LIMITS.full_refit)):
            trials = [(r.scored, r.fit) for r in refitted[:keep] if not r.fit.converged]
            rest = [r for k, r in enumerate(refitted) if k >= keep or r.fit.converged]
            go_on = partial(self.continued, iterations=iterations)
            evaluate = partial(self.fit_from, iterations=0, near=refitted[0].fit if refitted else None)
            refitted = by_objective([*rest, *best_refits(trials, go_on, evaluate)])
        return refitted

    # -- decisions

    def acceptable(
        self, fit: Fit, refitted: list[RefittedCandidate], gained: Gained
    ) -> RefittedCandidate | None:
        """The best refitted candidate not held to be zero, if it gains enough after earlier `gained`."""
        possible = [r for r in refitted if credible(r.fit, r.effect, self.raw_step)]
        while possible:
            best = self.simplest(possible)
            gain = fit.objective - best.fit.objective
            removes = removed_share(fit, best.fit) > ACCEPTANCE.least_excess_share
            worth = removes or gain > ACCEPTANCE.large_gain_share * fit.noise_objective
            if gain < needed_gain(best.effect, gained) or not worth:
                return None
            found = self.converged(best)
            if not held_to_be_zero(self.context, found.fit, found.effect):
                return found
            possible = [r for r in possible if r is not best]
        return None

    def simplest(self, possible: list[RefittedCandidate]) -> RefittedCandidate:
        """The best candidate, or a simpler one that fits nearly as well.

        Simpler means the effect that it refines, or any effect compared with backlash that is never crossed.
        """
        best = possible[0]
        if only_an_offset(best.fit, best.effect, self.raw_step):
            others = [r for r in possible[1:] if not only_an_offset(r.fit, r.effect, self.raw_step)]
            more = others[0].fit.layout.size - best.fit.layout.size if others else 0
            limit = best.fit.objective + ACCEPTANCE.offset_gain - ACCEPTANCE.nested_gain * max(more, 0)
            return others[0] if others and others[0].fit.objective < limit else best
        simpler = EFFECTS[best.effect.effect].replaces
        for r in possible[1:]:
            if r.effect.effect == simpler and r.effect.joint == best.effect.joint:
                return r if r.fit.objective < best.fit.objective + ACCEPTANCE.nested_gain else best
        return best

    def restarted(self, fit: Fit, best: RefittedCandidate, gained: Gained) -> Fit | None:
        """The present model from the best candidate's values, if it fits as well without the effect."""
        if not self.restart.advisable(fit, best):
            return None
        self.say(stages.NEED)
        return self.restart.of(fit, best, gained)

    def converged(self, refitted: RefittedCandidate) -> RefittedCandidate:
        """The candidate with a converged fit: the residual of an unfinished fit looks like another effect."""
        if refitted.fit.converged:
            return refitted
        more = self.continued(refitted.fit, LIMITS.last_refit)
        return replace(refitted, fit=more) if more.objective < refitted.fit.objective else refitted

    def without_superfluous(self, best: Fit, earlier: tuple[ChosenEffect, ...]) -> Fit:
        """The model refitted without superfluous earlier effects."""
        for effect in earlier:
            if effect not in best.layout.effects:
                continue
            start = without_effect(best.layout, best.x, effect)
            smaller = self.fit_from(start, LIMITS.longer_refit, near=best)
            if smaller.objective < best.objective + ACCEPTANCE.superfluous_gain:
                best = smaller
        return best
