"""Effects of the library at the place of what seemed to be an unknown law.

A fit without an effect may end so far from the truth that no effect is found from there: a stiffness that has
run away hides backlash. Beside an arbitrary torque at its place (`unknown_place`) the parameters are not
biased, and from them such an effect, or two that act there, explain nearly everything; or one of the whole
robot, whose torque is mostly that joint's. What only resembles them leaves much more.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis import stages
from flexviz.diagnosis.acceptance import Gained, excess, structured
from flexviz.diagnosis.candidates import ModelStart, candidates, is_episode
from flexviz.diagnosis.comparison import Comparison, RefittedCandidate, SearchStep, unscored
from flexviz.diagnosis.constancy import explained_by_drift
from flexviz.diagnosis.fit_context import Fit
from flexviz.diagnosis.hidden_starts import starts
from flexviz.diagnosis.refits import best_refits
from flexviz.diagnosis.search import Search
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.unknown_place import UnknownPlace
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.estimation import ScoredCandidate

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.search


def effects_at_place(search: Search, fit: Fit, place: UnknownPlace) -> list[SearchStep]:
    """The effect that explains nearly all that a fit leaves, added to it, or two that do; empty if none do.

    A drift of the effect's size may explain the rest, too.

    Args:
        search: rounds of the search.
        fit: the present model, from which the effect was not found.
        place: where an arbitrary torque explains everything.
    """
    needed, context = THRESHOLDS.unknown_place, search.context
    try:
        start = context.fit(place.layout, place.x, iterations=0, near=fit)
    except np.linalg.LinAlgError:  # far from the noise, weights may be ill-conditioned
        return []
    search.say(stages.AT_PLACE.format(place.joint))
    nothing, lacking = Gained(0.0, np.zeros(start.layout.n)), min(excess(start), excess(fit))
    # a fit without the effect may have absorbed most of what it explains
    first = _added(search, start, place, nothing, most=min(lacking, _half(start)))
    if first is None and excess(fit) < needed.from_present:
        first = _added(search, fit, place, nothing, most=_half(fit))
    if first is None or first.after.objective > fit.objective:
        return []
    first, enough = replace(first, before=fit), (1 - needed.explained) * lacking
    if excess(first.after) <= enough or explained_by_drift(context, first.after):
        return [first]
    gained = Gained.by_effects(first.after, context.without_effects(fit))
    second = _added(search, first.after, place, gained, most=_half(first.after))
    return [] if second is None or excess(second.after) > enough else [first, second]


def _half(fit: Fit) -> float:
    """What an effect may leave of the excess of a fit to be of use."""
    return (1 - THRESHOLDS.unknown_place.explained_first) * excess(fit)


def _added(search: Search, fit: Fit, place: UnknownPlace, gained: Gained, most: float) -> SearchStep | None:
    """The effect at a place that explains most of what a fit leaves.

    It leaves an excess of less than `most`; earlier effects gained `gained`.
    """
    joint, entry = place.unknown.joint, place.entry(excess(fit))

    def may_act(effect: ChosenEffect) -> bool:
        return entry is None or effect.joint is None or EFFECTS[effect.effect].entry == entry

    context = search.context
    scores = search.scores(fit, joint=joint)
    ranked = {s.effect: s for s in scores.ranked if may_act(s.effect)}
    tried = {s.effect: s for s in _leading([*ranked.values()])}
    for effect in candidates(fit.layout, context.measurements.groups):
        if effect.joint == joint and may_act(effect) and EFFECTS[effect.effect].underrated:
            tried[effect] = ranked.get(effect) or unscored(effect, fit)
    # something on another side may bias the parameters
    biased = entry is None and not place.complete and excess(fit) > LIMITS.far_off

    def refit(at: ModelStart) -> Fit:
        found = search.fit_from(at, LIMITS.short_refit, near=fit)
        law = EFFECTS[at.layout.effects[-1].effect]
        if not biased or law.absorbed_by_stiffness or excess(found) < LIMITS.noise_reached:
            return found
        return min(found, search.afresh(at, LIMITS.short_refit), key=excess)

    trials = [(s, at) for s in tried.values() for at in starts(context, fit, s)]
    if not trials:
        return None
    (leader, at), *more = trials
    first = RefittedCandidate(leader, refit(at))
    if ranked and search.explains_everything(fit, first.fit):
        others = [s for s in tried.values() if s is not leader]
        refitted = search.rivals(fit, search.converged(first), others).refitted
    else:
        evaluate = partial(search.fit_from, iterations=0, near=fit)
        useful = [first] if excess(first.fit) < most else []
        useful += best_refits(more, refit, evaluate, most)
        least = min((excess(r.fit) for r in useful), default=0.0)
        near_best = THRESHOLDS.unknown_place.near_best * least
        refitted = search.halving([r for r in useful if excess(r.fit) <= near_best])
    chosen = search.acceptable(fit, refitted, gained)
    if chosen is not None and structured(chosen.fit, fit):
        chosen = _damped(search, chosen)
    return chosen and SearchStep(fit, chosen, Comparison(refitted).objectives, scores.shortened())


def _damped(search: Search, refitted: RefittedCandidate) -> RefittedCandidate:
    """A candidate from its values by damped steps: full ones may only lead uphill from there."""
    fit = refitted.fit
    more = search.context.fit(
        fit.layout, fit.x, iterations=LIMITS.last_refit, check=search.check, near=fit, damped=True
    )
    return replace(refitted, fit=more) if more.objective < fit.objective else refitted


def _leading(ranked: list[ScoredCandidate]) -> list[ScoredCandidate]:
    """The joint's candidates with the best scores, and one of the whole robot and an episode among them."""
    lasting = [s for s in ranked if not is_episode(s.effect)]
    own = [s for s in lasting if s.effect.joint is not None][: THRESHOLDS.unknown_place.effects]
    least = own[-1].gain if own else 0.0
    others = [s for s in lasting if s.effect.joint is None and s.gain > least][:1]
    episodes = [s for s in ranked if is_episode(s.effect) and s.gain > least][:1]
    return [*sorted((*own, *others), key=lambda s: -s.gain), *episodes]
