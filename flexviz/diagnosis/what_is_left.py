"""What a model of many effects leaves: scores of the effects that it lacks, and laws of no library."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from flexviz.diagnosis.acceptance import credible
from flexviz.diagnosis.candidates import candidates, is_episode
from flexviz.diagnosis.elimination import expected, raw_step
from flexviz.diagnosis.model_family import ModelFamily
from flexviz.diagnosis.motion_fit import MotionContext, MotionFit
from flexviz.diagnosis.scoring import score_by_joint
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.unknown_curve import best_curve
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import Layout
from flexviz.estimation import ScoredCandidate, explained, score

LIMITS = THRESHOLDS.motion


class WhatIsLeft(ModelFamily):
    """Models of one set, and what they leave."""

    def __init__(self, context: MotionContext, own: Layout, say: Callable[[str], None]) -> None:
        super().__init__(context, own, say)
        self._refused: set[ChosenEffect] = set()
        self._lawful: set[int] = set()  # joints on which a free curve does not help

    def scores(
        self, fit: MotionFit, joints: Sequence[int | None] | None = None, episodes: bool = True
    ) -> list[ScoredCandidate]:
        """Scores of all effects that a model lacks, the best first; `joints`: of these only."""
        groups = self.context.measurements.groups
        wanted = [e for e in candidates(fit.layout, groups, many=True) if e not in self._refused]
        longest = LIMITS.longest_episode if episodes else None
        without = {*self._refused, *fit.layout.effects}
        return score_by_joint(
            fit.point, fit.chain, wanted, self.weigh(fit), fit.projection, check=lambda: self.say(""),
            longest=longest, without=without, signatures=False, joints=joints,
        )  # fmt: skip

    def scored(self, fit: MotionFit, wanted: Sequence[ChosenEffect]) -> list[ScoredCandidate]:
        """Scores of these effects, the best first."""
        found = score(fit.point, fit.chain, wanted, self.weigh(fit), fit.projection)
        return sorted(found, key=lambda s: -s.gain)

    def usual_share(self, fit: MotionFit, joint: int) -> float:
        """Share of a joint's mean square that its usual effects, which the model lacks, explain together."""
        columns = [
            fit.chain.column(guess.entry, guess.joints, one)
            for name, law in EFFECTS.items()
            if law.usual and (effect := ChosenEffect(name, joint)) not in fit.layout.effects
            for guess in law.guesses(fit.point.context, effect.place)
            for one in guess.columns
        ]
        if not columns:
            return 0.0
        weighed = np.stack(columns, axis=2) * fit.weights[:, :, None]
        return explained(*fit.projection.normal(weighed.reshape(-1, len(columns))))[1] / len(fit.weights)

    def unknown(self, fit: MotionFit, chosen: list[ScoredCandidate]) -> ChosenEffect | None:
        """The best free curve on the joint that errs most, if it explains much more than any candidate.

        Or else on another one, if it leads by far: no curve describes some laws, such as a vibration.
        """
        best = {s.effect.joint: s.gain for s in reversed(chosen)}
        taken = {curve.place.own_joint for curve in self.curves} | self._lawful
        ratio = fit.rms / self.context.noise_floor
        lead = LIMITS.curve_lead
        for joint in map(int, np.argsort(-ratio)):
            if joint in taken or ratio[joint] < LIMITS.far_off:
                continue
            curve, gain = best_curve(fit, joint)
            if gain > max(LIMITS.least_curve_share * len(fit.weights), lead * best.get(joint, 0.0)):
                return curve
            lead = LIMITS.curve_lead_elsewhere
        return None

    def best_of_each_joint(self, fit: MotionFit, leading: list[ScoredCandidate]) -> list[ScoredCandidate]:
        """The best candidate of each joint, and of those without one, that explains a clear share."""
        chosen: dict[int | None, ScoredCandidate] = {}
        quiet = fit.rms < LIMITS.quiet * self.context.noise_floor
        near = fit.rms < LIMITS.far_off * self.context.noise_floor
        curved = {curve.joint for curve in self.curves}

        def weighed(s: ScoredCandidate) -> float:
            return s.gain * (LIMITS.flexible_weight if EFFECTS[s.effect.effect].flexible else 1.0)

        for s in sorted(leading, key=weighed, reverse=True):
            law, joint = EFFECTS[s.effect.effect], s.effect.joint
            least = LIMITS.least_share_episode if is_episode(s.effect) else LIMITS.least_share
            if s.gain < least * len(fit.weights):
                continue
            if joint is not None and near[joint] and not expected(s.effect, s.values):
                continue  # so large an error would leave more
            if law.expected and not credible(fit, s.effect, raw_step(fit), s.values):
                continue
            if joint is not None and law.hidden_state and joint in curved and near[joint]:
                continue  # it would mend the form of the curve
            if joint not in chosen and not (joint is not None and quiet[joint]):
                chosen[joint] = s
        return list(chosen.values())

    def confirmed(self, fit: MotionFit, larger: MotionFit, chosen: list[ScoredCandidate]) -> MotionFit:
        """The larger model without episodes that leave much, and without refinements that gain little."""
        doubtful = []
        for s in chosen:
            law, joint = EFFECTS[s.effect.effect], s.effect.joint
            if joint is None:
                continue
            if (
                is_episode(s.effect)
                and larger.rms[joint] > LIMITS.episode_noise * self.context.noise_floor[joint]
            ):
                doubtful.append(s)
            if (
                law.replaces
                and larger.sigma[joint] ** 2 > (1 - LIMITS.replaced_share) * fit.sigma[joint] ** 2
            ):
                doubtful.append(s)
        if not doubtful:
            return larger
        others = [s for s in chosen if s not in doubtful]
        return self.with_candidates(fit, others) if others else fit

    def worse_joints(self, fit: MotionFit, larger: MotionFit) -> set[int]:
        """Joints whose held-out residual is clearly larger than before."""
        factor = np.full(self.own.n, LIMITS.worse)
        new = set(larger.layout.effects) - set(fit.layout.effects)
        factor[[e.place.own_joint for e in new if is_episode(e)]] = LIMITS.worse_episode
        allowed = np.maximum(factor * fit.held_out_rms(), LIMITS.quiet * self.context.noise_floor)
        return {int(j) for j in np.flatnonzero(larger.held_out_rms() > allowed)}
