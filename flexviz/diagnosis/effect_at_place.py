"""Effects of the library at the place of what seemed to be an unknown law.

A fit without an effect may end so far from the truth that no effect is found from there: a stiffness that has
run away hides backlash. Beside an arbitrary torque at its place (`unknown_place`) the parameters are not
biased, and from them such an effect, or two that act there, explain nearly everything. What only resembles
them leaves much more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis import stages
from flexviz.diagnosis.acceptance import Gained, excess, removed_share, structured
from flexviz.diagnosis.candidates import ModelStart, candidates, is_episode
from flexviz.diagnosis.comparison import Comparison, RefittedCandidate, SearchStep, unscored
from flexviz.diagnosis.fit_context import Fit
from flexviz.diagnosis.hidden_starts import starts
from flexviz.diagnosis.search import Search
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.unknown_place import UnknownPlace
from flexviz.effects import EFFECTS
from flexviz.estimation import ScoredCandidate
from flexviz.parallel import shared

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.search


def effects_at_place(search: Search, fit: Fit, place: UnknownPlace) -> list[SearchStep]:
    """The effect that explains nearly all that a fit leaves, added to it, or two that do; empty if none do.

    Args:
        search: rounds of the search.
        fit: the present model, from which the effect was not found.
        place: where an arbitrary torque explains everything.
    """
    joint, needed = place.unknown.joint, THRESHOLDS.unknown_place
    try:
        start = search.context.fit(place.layout, place.x, iterations=0, near=fit)
    except np.linalg.LinAlgError:  # far from the noise, weights may be ill-conditioned
        return []
    search.say(stages.AT_PLACE.format(place.joint))
    nothing = Gained(0.0, np.zeros(start.layout.n))
    first = _added(search, start, joint, nothing)
    if first is None and excess(fit) < needed.from_present:
        first = _added(search, fit, joint, nothing)
    if first is None or first.after.objective > fit.objective:
        return []
    first = replace(first, before=fit)
    if removed_share(start, first.after) >= needed.explained:
        return [first]
    gained = Gained.by_effects(first.after, search.context.without_effects(fit))
    second = _added(search, first.after, joint, gained)
    if second is None or removed_share(start, second.after) < needed.explained:
        return []
    return [first, second]


def _added(search: Search, fit: Fit, joint: int, gained: Gained) -> SearchStep | None:
    """The effect on a joint that explains most of what a fit leaves; earlier effects gained `gained`."""
    context = search.context
    scores = search.scores(fit, joint=joint)
    ranked = {s.effect: s for s in scores.ranked}
    tried = {s.effect: s for s in _leading(scores.ranked)}
    for effect in candidates(fit.layout, context.measurements.groups):
        if effect.joint == joint and EFFECTS[effect.effect].underrated:
            tried[effect] = ranked.get(effect) or unscored(effect, fit)
    trials = [(s, at) for s in tried.values() for at in starts(context, fit, s)]
    far = excess(fit) > LIMITS.far_off

    def refit(at: ModelStart) -> tuple[Array, float]:
        found = search.fit_from(at, LIMITS.short_refit, near=fit)
        if far and not EFFECTS[at.layout.effects[-1].effect].absorbed_by_stiffness:
            plain = ModelStart(at.layout, context.plain_fit(at.layout, at.x, search.check))
            found = min(found, search.fit_from(plain, LIMITS.short_refit), key=excess)
        return found.x, excess(found)

    most = (1 - THRESHOLDS.unknown_place.explained_first) * excess(fit)
    fitted = shared(refit, [at for _, at in trials])
    refitted = search.halving(
        [
            RefittedCandidate(s, search.fit_from(ModelStart(at.layout, x), 0, near=fit))
            for (s, at), (x, left) in zip(trials, fitted, strict=True)
            if left < most
        ]
    )
    best = search.acceptable(fit, refitted, gained)
    if best is not None and structured(best.fit, fit):
        best = _damped(search, best)
    return best and SearchStep(fit, best, Comparison(refitted).objectives, scores.shortened())


def _damped(search: Search, refitted: RefittedCandidate) -> RefittedCandidate:
    """A candidate from its values by damped steps: full ones may only lead uphill from there."""
    fit = refitted.fit
    more = search.context.fit(
        fit.layout, fit.x, iterations=LIMITS.last_refit, check=search.check, near=fit, damped=True
    )
    return replace(refitted, fit=more) if more.objective < fit.objective else refitted


def _leading(ranked: list[ScoredCandidate]) -> list[ScoredCandidate]:
    """The candidates with the best scores, and an episode that is among them."""
    lasting = [s for s in ranked if not is_episode(s.effect)][: THRESHOLDS.unknown_place.effects]
    least = lasting[-1].gain if lasting else 0.0
    return [*lasting, *[s for s in ranked if is_episode(s.effect) and s.gain > least][:1]]
