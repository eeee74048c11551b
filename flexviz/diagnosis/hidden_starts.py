"""Effects whose scores mean little: where they are tried, and from which values.

A stiffness that has absorbed part of an elastic effect hides it from the score. A wrong friction of the link
does the same to friction that depends on the load.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.diagnosis.acceptance import excess, largest_excess
from flexviz.diagnosis.candidates import ModelStart, candidates, with_effect
from flexviz.diagnosis.comparison import CandidateScores, RefittedCandidate, unscored
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS
from flexviz.estimation import ScoredCandidate

LIMITS = THRESHOLDS.search


def loudest(fit: Fit, most: int) -> list[int]:
    """The joints with the largest residuals, at most `most`."""
    count = np.count_nonzero(fit.chi > LIMITS.hidden_share * fit.chi.max())
    return np.argsort(-fit.chi)[: min(most, count)].tolist()


def stands_out(fit: Fit) -> bool:
    """Whether a model leaves more than noise, in the mean or on one joint."""
    return excess(fit) > LIMITS.faint_excess or largest_excess(fit) > LIMITS.faint_alone


def doubtful_joints(fit: Fit, leader: RefittedCandidate, close: Sequence[ScoredCandidate]) -> list[int]:
    """Joints on which such an effect may explain what a leader explains, with the `close` candidates.

    The one with the largest residual, if the leader leaves more than noise. If it gains far more than it
    scored, the present model is biased, and scores mean little: the joints on which it and the others act.
    """
    if excess(leader.fit) > LIMITS.faint_excess or largest_excess(leader.fit) > LIMITS.faint_joint:
        return loudest(leader.fit, 1)
    if fit.objective - leader.fit.objective < LIMITS.understated * leader.scored.gain:
        return []
    joints = dict.fromkeys(s.effect.joint for s in (leader, *close) if s.effect.joint is not None)
    return [*joints][: LIMITS.hidden_joints]


def starts(context: FitContext, fit: Fit, scored: ScoredCandidate) -> list[ModelStart]:
    """A model with one more effect: at its score's values, and at those that the effect provides."""
    first = with_effect(fit.layout, fit.x, scored.effect, scored.values)
    law, joint = EFFECTS[scored.effect.effect], scored.effect.joint
    if not law.underrated or joint is None:
        return [first]
    compliance = float(fit.x[fit.layout.compliance][joint])
    rough = float(context.rough_compliance[joint])
    found = [first]
    for hidden in law.hidden_starts(fit.point.torque[:, joint], compliance, rough):
        x = first.x.copy()
        x[first.layout.effect_slices()[-1][1]] = hidden.values
        x[first.layout.compliance.start + joint] = hidden.compliance
        found.append(ModelStart(first.layout, x))
    return found


def hidden_trials(
    context: FitContext, fit: Fit, loud: list[int], scores: CandidateScores | None
) -> list[tuple[ScoredCandidate, ModelStart]]:
    """Effects whose scores mean little, and from where to refit them.

    Those on the `loud` joints, from several starts; and, with `scores`, elastic ones for which these promise
    something only with the wrong sign: near a biased model they may be wrong about that.
    """
    ranked = {s.effect: s for s in scores.ranked} if scores else {}
    out = []
    for effect in candidates(fit.layout, context.measurements.groups):
        law, is_loud = EFFECTS[effect.effect], effect.joint in loud
        wrong_sign = scores is not None and effect not in ranked
        if law.underrated if is_loud else law.absorbed_by_stiffness and wrong_sign:
            scored = ranked.get(effect) or unscored(effect, fit)
            out += [(scored, start) for start in starts(context, fit, scored)[: None if is_loud else 1]]
    return out
