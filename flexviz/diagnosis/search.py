"""One round of the search: score every candidate, refit the leading ones, drop what is superfluous."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.acceptance import (
    GAIN,
    WORTH,
    credible,
    excess,
    needed_gain,
    only_an_offset,
    removed,
    structured,
)
from flexviz.diagnosis.candidates import candidates, with_effect, without_effect
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.estimation import Projection, Scored, Weigh, best_intervals, score

Array = NDArray[np.float64]

TRIED = 6  # refitted
SIGNATURES = 12  # of leading candidates, which an explanation compares
EPISODES = 2  # of them at most
CLOSE = 0.03  # of the best score: what scores less is not refitted once the best one explains all
EXPLAINED = 0.2  # of the excess left: the leading candidate explains all there is
REACHED = 0.15  # excess at which the noise is reached
FAR = 5.0  # excess from which on a fit may be so far off that the next one had better start afresh
LONGEST = 0.6  # of a group: a torque that acts most of the time is no episode
PLAIN = 0.5  # excess that no noise makes
CLEAR = 0.3  # of it, what an effect has to remove that no score speaks for
WORST = 2  # joints whose own laws are tried whatever their score
SHORT, LONGER, FULL, LAST = 3, 6, 14, 20  # iterations of a refit
MOST = 0.3  # of what the objective holds above the noise
OFFSET = 50.0  # lead in the objective that a gap which is never crossed has to have
NESTED = 12.0  # gain in the objective over the law that an effect refines
RIVAL = 0.3  # of the leader's gain: a rival further behind after SHORT iterations is not followed


@dataclass(frozen=True, eq=False)
class Scores:
    """Every candidate's score at a fit, best first, and what they were measured with."""

    ranked: list[Scored]
    projection: Projection

    def shortened(self) -> Scores:
        """The same, with the leading candidates' signatures only: all of them hold hundreds of MB."""
        rest = [replace(s, signature=np.zeros(0), rows=None) for s in self.ranked[SIGNATURES:]]
        return Scores([*self.ranked[:SIGNATURES], *rest], self.projection)


@dataclass(frozen=True, eq=False)
class Tried:
    """A candidate with its refit."""

    scored: Scored
    fit: Fit

    @property
    def effect(self) -> ChosenEffect:
        return self.scored.effect


class Search:
    """Rounds of the search on one workbench.

    Args:
        context: the data.
        say: called with what is being tried; may raise to stop.
    """

    def __init__(self, context: FitContext, say: Callable[[str], None]) -> None:
        self.context, self.say = context, say
        self.raw_step = max(s.step for g in context.fit_groups for s in g.segments)

    def check(self) -> None:
        self.say("")

    def scores(self, fit: Fit, episodes: bool = True) -> Scores:
        """Every candidate's score at a fit."""
        layout, point = fit.layout, fit.point
        narrow = self.context.two_band.with_layout(layout).narrow.at(fit.x)
        prior, _ = self.context.prior_and_bounds(layout)
        flat = point.z.reshape(-1, layout.size)
        hessian = flat.T @ flat + prior.gradient_and_hessian(fit.x)[1]
        projection = Projection(point.r.ravel(), flat, hessian)
        weigh = self.weigh(fit)
        wanted = candidates(layout, self.context.fit_groups)
        scored = score(narrow, self.context.chain(fit), wanted, weigh, projection)
        if episodes:
            have = set(layout.effects)
            for joint in range(layout.n):
                self.check()
                found = best_intervals(narrow, joint, weigh, projection, longest=LONGEST)
                scored += [s for s in found if s.effect not in have]
        return Scores(sorted(scored, key=lambda s: -s.gain), projection)

    def weigh(self, fit: Fit) -> Weigh:
        """Columns of a stretch weighted as the fit's residual."""
        point, blocks = fit.point, self.context.two_band.blocks

        def weigh(columns: Array, block: int) -> Array:
            out = point.weightings[block].apply(columns)
            out[~point.used[blocks[block].rows]] = 0.0
            return out.reshape(-1, columns.shape[2])

        return weigh

    def refits(self, fit: Fit, scores: Scores, gained: float) -> list[Tried]:
        """The leading candidates refitted, best first; `gained` was gained before by others."""
        chosen = [s for s in self.leading(scores) if optimistic_gain(s) > needed_gain(s.effect, gained)]
        first = self.leader(fit, chosen[0]) if chosen else None
        if first is not None and self.explains(fit, first.fit):
            tried = [first, *self.rivals(fit, first, chosen[1:])]
            return sorted(tried, key=lambda t: t.fit.objective)
        tried = [*([first] if first else []), *self.attempts(fit, chosen[1:])]
        hidden = excess(fit) > PLAIN  # more than the scores see
        if hidden and gained < GAIN:
            tried += self.underrated(fit, scores)
        tried = self.tournament(tried)
        if hidden and gained >= GAIN and self.acceptable(fit, tried, gained) is None:
            more = self.tournament(self.underrated(fit, scores))
            tried += [t for t in more if removed(fit, t.fit) > CLEAR]
        return sorted(tried, key=lambda t: t.fit.objective)

    def explains(self, before: Fit, after: Fit) -> bool:
        """Whether hardly anything is left."""
        enough = excess(after) < max(EXPLAINED * excess(before), 0.05)
        return enough and not structured(after, before) and after.objective < before.objective

    def leader(self, fit: Fit, scored: Scored) -> Tried:
        """The best score refitted to the end; from afresh too where that leaves much."""
        direct = self.finished(self.refit(fit, scored, FULL))
        if excess(fit) < FAR or excess(direct.fit) < REACHED:
            return direct
        return min(direct, self.afresh(fit, scored, FULL), key=lambda t: t.fit.objective)

    def afresh(self, fit: Fit, scored: Scored, iterations: int) -> Tried:
        """One candidate, from where the data of a plain fit lead: the model may stand far off."""
        layout, x = with_effect(fit.layout, fit.x, scored.effect, scored.values)
        x = self.context.plain_fit(layout, x, self.check)
        return Tried(scored, self.context.fit(layout, x, iterations=iterations, check=self.check))

    def attempts(self, fit: Fit, chosen: list[Scored]) -> list[Tried]:
        """A few steps of every candidate, from where the model stands and, where that is far off, afresh."""
        out = []
        for s in chosen:
            out.append(self.refit(fit, s, SHORT))
            if excess(fit) > FAR:
                out.append(self.afresh(fit, s, SHORT))
        return out

    def underrated(self, fit: Fit, scores: Scores) -> list[Tried]:
        """Elastic laws of the joints with the largest residual, from several starts.

        A stiffness that has absorbed a part of such a law hides it from the score: the law's own starts give
        that part back.
        """
        torque = fit.point.narrow.torque[0]
        ranked = {s.effect: s for s in scores.ranked}
        out = []
        for j in np.argsort(-fit.chi)[:WORST]:
            for effect in candidates(fit.layout, self.context.fit_groups):
                law = EFFECTS[effect.effect]
                if not law.absorbed_by_stiffness or effect.joint != j:
                    continue
                nothing = np.zeros(len(law.parameters))
                scored = ranked.get(effect) or Scored(effect, 0.0, nothing, np.zeros(fit.point.r.size))
                self.say(f"trying {law.title.lower()} from several starts")
                layout, x = with_effect(fit.layout, fit.x, scored.effect, scored.values)
                compliance = float(fit.x[fit.layout.compliance][j])
                rough = float(self.context.rough_compliance[j])
                begin = [x]
                for start in law.elastic_starts(torque[:, j], compliance, rough):
                    begin.append(x.copy())
                    begin[-1][layout.effect_slices()[-1][1]] = start.values
                    begin[-1][layout.compliance.start + j] = start.compliance
                fits = [
                    self.context.fit(layout, b, iterations=SHORT, check=self.check, near=fit) for b in begin
                ]
                out.append(Tried(scored, min(fits, key=lambda f: f.objective)))
        return out

    def leading(self, scores: Scores) -> list[Scored]:
        """The candidates with the best scores."""
        chosen: list[Scored] = []
        episodes = 0
        for s in scores.ranked:
            if EFFECTS[s.effect.effect].scope == "episode":
                episodes += 1
                if episodes > EPISODES:
                    continue
            chosen.append(s)
            if len(chosen) == TRIED:
                break
        return chosen

    def refit(self, fit: Fit, scored: Scored, iterations: int) -> Tried:
        """One candidate, refitted from where the model stands."""
        self.say(f"trying {EFFECTS[scored.effect.effect].title.lower()}")
        layout, x = with_effect(fit.layout, fit.x, scored.effect, scored.values)
        return Tried(scored, self.context.fit(layout, x, iterations=iterations, check=self.check, near=fit))

    def rivals(self, fit: Fit, leader: Tried, others: list[Scored]) -> list[Tried]:
        """The others, where the leader explains all: can one of them do the same from the same start?"""
        gain = fit.objective - leader.fit.objective
        out = []
        for s in others:
            if s.gain < CLOSE * leader.scored.gain:
                continue
            self.say(f"comparing with {EFFECTS[s.effect.effect].title.lower()}")
            layout, x = with_effect(fit.layout, _shared(leader.fit, fit), s.effect, s.values)
            here = self.context.fit(layout, x, iterations=SHORT, check=self.check, near=leader.fit)
            if not here.converged and here.objective < leader.fit.objective + RIVAL * max(gain, GAIN):
                here = self.context.fit(layout, here.x, iterations=FULL, check=self.check, near=here)
            out.append(Tried(s, here))
        return out

    def tournament(self, tried: list[Tried]) -> list[Tried]:
        """Candidates that were refitted for a few steps, by halving; the best one of each effect."""
        best: dict[ChosenEffect, Tried] = {}
        for t in tried:
            if t.effect not in best or t.fit.objective < best[t.effect].fit.objective:
                best[t.effect] = t
        tried = list(best.values())
        for keep, iterations in ((3, LONGER), (2, FULL)):
            tried.sort(key=lambda t: t.fit.objective)
            for k, t in enumerate(tried[:keep]):
                if not t.fit.converged:
                    more = self.context.fit(
                        t.fit.layout, t.fit.x, iterations=iterations, check=self.check, near=t.fit
                    )
                    tried[k] = replace(t, fit=more)
        return sorted(tried, key=lambda t: t.fit.objective)

    def acceptable(self, fit: Fit, tried: list[Tried], gained: float) -> Tried | None:
        """The best refitted candidate, if it is worth adding after `gained` was gained before."""
        possible = [t for t in tried if credible(t.fit, t.effect, self.raw_step)]
        if not possible:
            return None
        best = self.simplest(possible)
        gain = fit.objective - best.fit.objective
        worth = removed(fit, best.fit) > WORTH or gain > MOST * fit.noise_objective
        return self.finished(best) if gain >= needed_gain(best.effect, gained) and worth else None

    def simplest(self, possible: list[Tried]) -> Tried:
        """The best one, or what does as well: the simpler law that it refines; anything beside a gap never
        crossed."""
        best = possible[0]
        if only_an_offset(best.fit, best.effect, self.raw_step):
            others = [t for t in possible[1:] if not only_an_offset(t.fit, t.effect, self.raw_step)]
            return others[0] if others and others[0].fit.objective < best.fit.objective + OFFSET else best
        simpler = EFFECTS[best.effect.effect].replaces
        for t in possible[1:]:
            if t.effect.effect == simpler and t.effect.joint == best.effect.joint:
                return t if t.fit.objective < best.fit.objective + NESTED else best
        return best

    def restarted(self, fit: Fit, best: Tried, gained: float) -> Fit | None:
        """The model without the newest effect, from where that one led, if it does as well from there.

        A fit that ended far from where it belongs is left by any effect that happens to lead out.
        """
        if excess(fit) < FAR:
            return None
        self.say("looking whether the effect was needed")
        start = _shared(best.fit, fit)
        again = self.context.fit(fit.layout, start, iterations=FULL, check=self.check, near=best.fit)
        return again if again.objective < best.fit.objective + needed_gain(best.effect, gained) else None

    def finished(self, tried: Tried) -> Tried:
        """The same fitted to the end: what a fit leaves on its way looks like another effect."""
        if tried.fit.converged:
            return tried
        layout, x = tried.fit.layout, tried.fit.x
        more = self.context.fit(layout, x, iterations=LAST, check=self.check, near=tried.fit)
        return replace(tried, fit=more) if more.objective < tried.fit.objective else tried

    def simplified(self, best: Fit, earlier: tuple[ChosenEffect, ...]) -> tuple[Fit, list[ChosenEffect]]:
        """The model without those earlier effects that have become superfluous, and which those are."""
        dropped: list[ChosenEffect] = []
        for effect in earlier:
            if effect not in best.layout.effects:
                continue
            layout, x = without_effect(best.layout, best.x, effect)
            alone = self.context.fit(layout, x, iterations=LONGER, check=self.check, near=best)
            if alone.objective < best.objective + GAIN:
                best = alone
                dropped.append(effect)
        return best, dropped


def optimistic_gain(scored: Scored) -> float:
    """The most that a refit is expected to gain."""
    return EFFECTS[scored.effect.effect].optimism * scored.gain


def _shared(leader: Fit, before: Fit) -> Array:
    """The leader's values of everything that the model before it has, or that model's own."""
    x = before.layout.vector(leader.layout.model(leader.x))
    for effect, where in before.layout.effect_slices():
        if effect not in leader.layout.effects:
            x[where] = before.x[where]
    return x
