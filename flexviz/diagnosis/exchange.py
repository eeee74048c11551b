"""An effect of an earlier step against its close rivals once more, beside the effects added since.

While another effect is still missing, one of another form or elsewhere may fit better than the right one.
That is then a close rival, and fits better as soon as the other effect is in the model.
"""

from __future__ import annotations

from flexviz.diagnosis.acceptance import credible, held_to_be_zero
from flexviz.diagnosis.candidates import ModelStart, with_effect, without_effect
from flexviz.diagnosis.comparison import RefittedCandidate, SearchStep
from flexviz.diagnosis.fit_context import Fit
from flexviz.diagnosis.search import Search
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import Layout

EVIDENCE, LIMITS = THRESHOLDS.evidence, THRESHOLDS.search


def exchanged(search: Search, final: Fit, step: SearchStep) -> RefittedCandidate | None:
    """The final model with a rival in place of the effect of an earlier step; None if none fits better."""
    effect = step.chosen.effect
    rivals = close_rivals(step) - set(final.layout.effects)
    if not rivals:
        return None
    start = without_effect(final.layout, final.x, effect)
    there = search.fit_from(start, 0, near=final)
    scores = search.scores(there, {effect, *rivals})
    least = LIMITS.close_alone * scores.gains.get(effect, 0.0)
    best, beat = None, final.objective - EVIDENCE.tied_gain
    for s in scores.ranked:
        if s.effect == effect or s.gain < least:
            continue
        search.say(f"comparing with: {EFFECTS[s.effect.effect].title}")
        start = in_place_of(effect, final.layout, with_effect(there.layout, there.x, s.effect, s.values))
        fit = search.fit_from(start, LIMITS.full_refit, near=final, beat=beat)
        if fit.objective < beat and credible(fit, s.effect, search.raw_step):
            best, beat = RefittedCandidate(s, fit), fit.objective
    if best is None or held_to_be_zero(search.context, best.fit, best.effect):
        return None
    return best


def close_rivals(step: SearchStep) -> set[ChosenEffect]:
    """Effects that gained nearly as much as the one that was chosen in a step."""
    objective = step.chosen.fit.objective
    limit = objective + LIMITS.rival_deficit * (step.before.objective - objective)
    return {effect for effect, reached in step.objectives.items() if reached < limit}


def in_place_of(effect: ChosenEffect, before: Layout, start: ModelStart) -> ModelStart:
    """The same model with its last effect where `effect` was in the order of effects."""
    *others, new = start.layout.effects
    order = [new if e == effect else e for e in before.effects if e == effect or e in others]
    layout = Layout(before.joints, tuple(order))
    return ModelStart(layout, layout.vector(start.layout.model(start.x)))
