"""Effects that act after a standstill: sought where a model errs much more there than in motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis import stages
from flexviz.diagnosis.candidates import candidates
from flexviz.diagnosis.elimination import Necessity, necessities, sizes
from flexviz.diagnosis.motion_fit import MotionFit
from flexviz.diagnosis.motion_samples import Phase, Phases
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.what_is_left import WhatIsLeft
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.estimation import ScoredCandidate
from flexviz.statistics import NORMAL_95

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.motion


class AfterRest(WhatIsLeft):
    """Adds them to a model, with and without the standstill itself."""

    def with_starts(
        self, fit: MotionFit, needed: dict[ChosenEffect, Necessity]
    ) -> tuple[MotionFit, dict[ChosenEffect, Necessity]]:
        """The model with effects that act after a standstill, on joints that err much more there."""
        chosen = self.best_of_each_joint(fit, self.scored(fit, self.after_rest(fit)))
        if not chosen:
            return fit, needed
        self.say(f"adding: {EFFECTS[chosen[0].effect.effect].title}")
        larger, kept = self.thinned(self.usual_fit(beside=self.with_candidates(fit, chosen)))
        better = larger.objective < fit.objective and not self.worse_joints(fit, larger)
        return (larger, kept) if better else (fit, needed)

    def with_first_movements(
        self, fit: MotionFit, needed: dict[ChosenEffect, Necessity]
    ) -> tuple[MotionFit, dict[ChosenEffect, Necessity]]:
        """The model with effects that describe the first movement after a standstill that was left out.

        Where these, or those found before, describe it, it counts from then on.
        """
        context, before = self.context, self.context.first_phase
        if not np.any(before == Phase.MOTION):
            return fit, needed
        self.say(stages.FIRST_MOVEMENT)
        try:
            context.first_phase = np.minimum(before, np.int8(Phase.START))
            larger, useful = self.with_useful_starts(self.fit(fit.layout, fit.x))
        finally:  # a search that is stopped here, too, shows the model that it had
            context.first_phase = before
        found = fit
        if useful:
            in_motion = self.fit(larger.layout, larger.x, iterations=0).held_out_rms()
            harmless = in_motion < LIMITS.start_harm * fit.held_out_rms()
            found = self.with_candidates(fit, [s for s in useful if harmless[s.effect.place.own_joint]])
        context.first_phase = with_described_starts(found)
        if np.all(context.first_phase == before):
            return fit, needed
        found = self.fit(found.layout, found.x)
        return found, necessities(found)

    def with_useful_starts(self, fit: MotionFit) -> tuple[MotionFit, list[ScoredCandidate]]:
        """The model with the best effect after a standstill on each joint, and which of them are of use."""
        chosen = self.best_of_each_joint(fit, self.scored(fit, self.after_rest(fit)))
        if not chosen:
            return fit, []
        larger = self.with_candidates(fit, chosen)
        needs = necessities(larger)
        return larger, [s for s in chosen if self.clearly_better(fit, larger, s.effect, needs[s.effect])]

    def clearly_better(
        self, fit: MotionFit, larger: MotionFit, effect: ChosenEffect, need: Necessity
    ) -> bool:
        """Whether an effect describes what follows a standstill: a few short stretches, all much alike.

        Held-out groups decide, if there are any: what is the same in them was not fitted.
        """
        joint = effect.place.own_joint
        falls = larger.held_out_rms()[joint] < LIMITS.start_gain * fit.held_out_rms()[joint]
        least = NORMAL_95 if fit.held_out else LIMITS.significant
        return bool(falls and need.credible and need.deviations > least)

    def after_rest(self, fit: MotionFit) -> list[ChosenEffect]:
        """Effects after a standstill that a model lacks on joints that err much more there."""
        every = candidates(fit.layout, self.context.measurements.groups, many=True)
        loud = self.context.louder_before_motion(fit)
        return [e for e in every if EFFECTS[e.effect].after_rest and e.joint is not None and loud[e.joint]]


def with_described_starts(fit: MotionFit) -> Phases:
    """The first phases that count, shape (n,), with first movements that a model's effects describe.

    That is where the error of the held-out ones, or of the fitted ones without any, is smaller with them.
    """
    context, layout = fit.context, fit.layout
    equation = context.held_out_equation(layout) or context.equation(layout)
    start, first = context.judged_phases == Phase.START, context.first_phase.copy()

    def misfit(x: Array, joint: int) -> float:
        residual = equation.at(x).residual(x)[:, joint]
        return float(np.sum(residual[start[:, joint]] ** 2))

    for effect, where in layout.effect_slices():
        if not EFFECTS[effect.effect].after_rest or first[effect.place.own_joint] != Phase.MOTION:
            continue
        joint, without = effect.place.own_joint, fit.x.copy()
        without[sizes(effect, where)] = 0.0
        if misfit(fit.x, joint) < misfit(without, joint):
            first[joint] = Phase.START
    return first
