"""Effects of joints that follow goals: parts of the law of their servo."""

from __future__ import annotations

import numpy as np

from flexviz.model.effects.effect import Effect
from flexviz.model.effects.terms import Array, Context, EffectTarget, Guess, Terms


class GoalEffect(Effect):
    """Part of the law by which a joint's servo makes a torque of its goal.

    Such joints are fitted by their free motion (`flexviz.analysis.servo`). In the equation of a recorded
    torque it has no part: the torque of such a set is already that of the identified law.
    """

    where = "sensing"
    signature = "The measured position leaves the goal in another way than the rest of the model explains."

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        """None: u is zero."""
        nothing = np.zeros((3, context.count(), 1))
        return Terms("torque", (place.own_joint,), nothing, np.zeros((len(values), *nothing.shape)))

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        """None."""
        return []
