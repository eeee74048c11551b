"""An effect of the library at the place of what seemed to be an unknown law.

A fit without an effect may end so far from the truth that no effect is found from there: a stiffness that has
run away hides backlash. Beside an arbitrary torque at its place (`unknown_place`) the parameters are not
biased, and from them such an effect explains everything, or nearly so if a second one acts there. What only
resembles it leaves much more.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis import stages
from flexviz.diagnosis.acceptance import Gained, excess, removed_share
from flexviz.diagnosis.candidates import ModelStart, candidates, is_episode
from flexviz.diagnosis.comparison import Comparison, RefittedCandidate, SearchStep, unscored
from flexviz.diagnosis.elastic_starts import starts
from flexviz.diagnosis.fit_context import Fit
from flexviz.diagnosis.search import Search
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.unknown_place import UnknownPlace
from flexviz.effects import EFFECTS
from flexviz.parallel import shared

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.search


def effect_at_place(search: Search, fit: Fit, place: UnknownPlace) -> SearchStep | None:
    """The effect that explains nearly all that a fit leaves, added to it; None if there is none.

    Args:
        search: rounds of the search.
        fit: the present model, from which the effect was not found.
        place: where an arbitrary torque explains everything.
    """
    context = search.context
    try:
        start = context.fit(place.layout, place.x, iterations=0, near=fit)
    except np.linalg.LinAlgError:  # far from the noise, weights may be ill-conditioned
        return None
    joint = place.unknown.joint
    every = candidates(fit.layout, context.measurements.groups)
    there = [e for e in every if e.joint == joint and not is_episode(e)]
    scores = search.scores(start, there)
    search.say(stages.AT_PLACE.format(place.joint))
    tried = {s.effect: s for s in scores.ranked[: THRESHOLDS.unknown_place.effects]}
    ranked = {s.effect: s for s in scores.ranked}
    for effect in there:
        if EFFECTS[effect.effect].absorbed_by_stiffness:  # their scores mean little
            tried[effect] = ranked.get(effect) or unscored(effect, start)
    trials = [(s, at) for s in tried.values() for at in starts(context, start, s)]

    def refit(at: ModelStart) -> tuple[Array, float]:
        found = search.fit_from(at, LIMITS.short_refit, near=start)
        return found.x, excess(found)

    most = LIMITS.explained_excess * excess(start)
    fitted = shared(refit, [at for _, at in trials])
    refitted = search.halving(
        [
            RefittedCandidate(s, search.fit_from(ModelStart(at.layout, x), 0, near=start))
            for (s, at), (x, left) in zip(trials, fitted, strict=True)
            if left < most
        ]
    )
    best = search.acceptable(start, refitted, Gained(0.0, np.zeros(fit.layout.n)))
    if best is None or best.fit.objective > fit.objective:
        return None
    if removed_share(start, best.fit) < THRESHOLDS.unknown_place.explained:
        return None
    return SearchStep(fit, best, Comparison(refitted).objectives, scores.shortened())
