"""Laws of the model replaced by alternatives on the joints where that helps, and back."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.acceptance import credible
from flexviz.diagnosis.after_rest import AfterRest
from flexviz.diagnosis.candidates import without_effect
from flexviz.diagnosis.elimination import Necessity, necessities, raw_step
from flexviz.diagnosis.motion_fit import Hopeless, MotionFit
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import Layout
from flexviz.parallel import shared

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.motion


class SwappedLaws(AfterRest):
    """Refinements of effects that the model has, and alternatives to them."""

    def refined(
        self,
        fit: MotionFit,
        needed: dict[ChosenEffect, Necessity],
        joints: Collection[int | None] | None = None,
    ) -> tuple[MotionFit, dict[ChosenEffect, Necessity]]:
        """The model with effects replaced by an alternative on the joints where that helps clearly.

        All joints, or all of `joints`, at once: the score of one alternative says little, because its law is
        far from linear.
        """
        ratio = fit.rms / self.context.noise_floor
        for name, law in EFFECTS.items():
            loud = ratio > (LIMITS.far_off if law.hidden_state else LIMITS.quiet)
            for curve in self.curves:  # what is left is the curve's own error
                loud[curve.place.own_joint] &= ratio[curve.place.own_joint] > LIMITS.far_off
            swaps = {
                e: ChosenEffect(name, e.joint)
                for e in fit.layout.effects
                if e.effect in (law.replaces, law.instead_of)
                and e.joint is not None
                and loud[e.joint]
                and (joints is None or e.joint in joints)
                and e not in self.own.effects
            }
            if any(EFFECTS[e.effect].offset_parameter for e in swaps):
                merged = self.with_offsets_merged(fit)
                # an offset of the motor torque does not load the transmission, a spring's preload does
                if merged.objective < fit.objective - LIMITS.likelier:
                    fit, needed = merged, necessities(merged)
                    swaps = {e: swap for e, swap in swaps.items() if e in fit.layout.effects}
            if swaps:
                fit, needed = self.better_of(fit, needed, swaps)
        return fit, needed

    def better_of(
        self,
        fit: MotionFit,
        needed: dict[ChosenEffect, Necessity],
        swaps: Mapping[ChosenEffect, ChosenEffect],
    ) -> tuple[MotionFit, dict[ChosenEffect, Necessity]]:
        """The model with those swaps that clearly lower the residual of their joint.

        A law with a hidden state, which can fit more, has to lower the held-out residual, too.
        """
        self.say(f"trying: {', '.join(sorted({EFFECTS[e.effect].title for e in swaps.values()}))}")
        joints = [e.joint for e in swaps if e.joint is not None]

        def hopeless(trial: MotionFit, more: float) -> bool:
            return trial.objective - more > fit.objective and bool(np.all((trial.sigma > fit.sigma)[joints]))

        trial = self.swapped(fit, fit, swaps, hopeless)
        held_out = (trial.held_out_rms() / fit.held_out_rms()) ** 2
        fitted = (trial.sigma / fit.sigma) ** 2
        simple = fitted < 1 - LIMITS.swapped_share
        hidden = np.maximum(held_out, fitted) < 1 - LIMITS.replaced_share
        better = {
            e: swap
            for e, swap in swaps.items()
            if (hidden if EFFECTS[swap.effect].hidden_state else simple)[e.joint]
            and credible(trial, swap, raw_step(trial))
        }
        if not better:
            return fit, needed
        return self.thinned(trial if len(better) == len(swaps) else self.swapped(fit, trial, better))

    def swapped(
        self,
        fit: MotionFit,
        values: MotionFit,
        swaps: Mapping[ChosenEffect, ChosenEffect],
        hopeless: Hopeless | None = None,
    ) -> MotionFit:
        """The model with effects swapped, from the values of a model that may have the new ones."""
        springs = {e.joint for e in swaps if EFFECTS[e.effect].offset_parameter}
        offsets = self.offsets_of_springs(fit.layout) - set(self.own.effects)
        gone = {offset.joint: offset for offset in offsets if offset.joint in springs}
        kept = (e for e in fit.layout.effects if e not in gone.values())
        layout = Layout(fit.layout.joints, tuple(swaps.get(e, e) for e in kept))
        x = layout.vector(values.layout.model(values.x))
        for old, new in swaps.items():
            if new not in values.layout.effects:
                start = fit.x[fit.layout.effect_slice(old)]
                if old.joint in gone:
                    torque = float(fit.x[fit.layout.effect_slice(gone[old.joint]).start])
                    start = EFFECTS[old.effect].with_constant(start, torque)
                x[layout.effect_slice(new)] = EFFECTS[new.effect].refining(start)
        for effect, where in layout.effect_slices():
            if effect in fit.layout.effects and effect not in values.layout.effects:
                x[where] = fit.x[fit.layout.effect_slice(effect)]
        return self.better_start(layout, x, hopeless)

    def better_start(self, layout: Layout, x: Array, hopeless: Hopeless | None) -> MotionFit:
        """The better of two fits: from x, and with all but the effects where an identification starts.

        While an effect is missing, other parameters stand in for it at values from which a fit may not
        return.
        """
        afresh = self.context.start(layout).x.copy()
        afresh[layout.effect_start :] = x[layout.effect_start :]

        ends = shared(lambda start: self.fit(layout, start, hopeless=hopeless).x, (x, afresh))
        # a fit keeps the unknown initial states of friction with memory from where it starts
        return min((self.fit(layout, end, iterations=0) for end in ends), key=lambda fit: fit.objective)

    def with_original_laws(
        self, fit: MotionFit, needed: dict[ChosenEffect, Necessity]
    ) -> tuple[MotionFit, dict[ChosenEffect, Necessity]]:
        """The model with alternative laws replaced by the original ones, unless that is clearly worse.

        The alternative may have won only because something else was missing.
        """
        for effect in [e for e in fit.layout.effects if e not in self.own.effects]:
            original, joint = EFFECTS[effect.effect].instead_of, effect.joint
            if not original or joint is None or effect not in fit.layout.effects:
                continue
            self.say(f"trying: {EFFECTS[original].title}")
            start = without_effect(fit.layout, fit.x, effect)
            if ChosenEffect(original, joint) in start.layout.effects:
                continue  # beside each other they are not alternatives
            without = self.fit(start.layout, start.x, iterations=0)
            if not (turned := self.scored(without, [ChosenEffect(original, joint)])):
                continue
            trial = self.with_candidates(without, turned)
            trial = min(trial, self.with_offsets_merged(trial), key=lambda each: each.sigma[joint])
            if (1 - LIMITS.swapped_share) * trial.sigma[joint] ** 2 < fit.sigma[joint] ** 2:
                thinner, kept = self.with_rest_angles(*self.thinned(trial))
                if ChosenEffect(original, joint) in kept and not self.worse_joints(fit, thinner):
                    fit, needed = thinner, kept
        return fit, needed
