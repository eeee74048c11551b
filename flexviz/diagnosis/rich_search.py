"""Search backwards from a rich model, for robots that hide many effects at once.

Adding one effect at a time to a poor model goes astray: its parameters run to wherever they absorb most, and
imitations win. Here every usual effect starts on every joint; what held-out groups and the residual do not
need is taken away. Then all other effects are scored at once on what is left, the best of each joint are
added, and the model is thinned out again, until nothing is found.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis import stages
from flexviz.diagnosis.candidates import NearNoise, is_episode, without_effect
from flexviz.diagnosis.elimination import Necessity, necessities
from flexviz.diagnosis.model_family import RichModel
from flexviz.diagnosis.motion_fit import MotionContext, MotionFit
from flexviz.diagnosis.so_far import Standing
from flexviz.diagnosis.swapped_laws import SwappedLaws
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import Layout
from flexviz.estimation import ScoredCandidate
from flexviz.parallel import allowed_cores
from flexviz.wording import plural

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.motion


class RichSearch(SwappedLaws):
    """A search on one set.

    Args:
        context: the data.
        own: effects of the set's own model, which stay.
        say: called with a progress message; may raise to stop.
        standing: is told of the models found.

    Attributes:
        few: usual effects that together come near the noise, if they are few.
    """

    def __init__(
        self, context: MotionContext, own: Layout, say: Callable[[str], None], standing: Standing
    ) -> None:
        super().__init__(context, own, say)
        self.standing = standing
        self.best: RichModel | None = None  # so far
        self.few: frozenset[ChosenEffect] = frozenset()
        self._singles: dict[ChosenEffect, MotionFit] = {}

    @cached_property
    def bare(self) -> MotionFit:
        """Fit of the set's own model."""
        return self.fit(self.own, self.context.start(self.own).x)

    @cached_property
    def alone(self) -> list[ScoredCandidate]:
        """Scores of all effects beside the set's own model, the best first."""
        return self.scores(self.bare)

    def singles(self, wanted: Sequence[ScoredCandidate]) -> Iterator[MotionFit]:
        """Fits of the set's own model with one effect each: the first, then the others on all cores."""
        for part in (wanted[:1], wanted[1:]):
            new = [s for s in part if s.effect not in self._singles]
            fits = self.on_all_cores(lambda s: self.with_candidates(self.bare, [s]), new)
            for s in part:
                if s.effect not in self._singles:
                    self._singles[s.effect] = next(fits)
                yield self._singles[s.effect]

    def forget(self) -> None:
        """Release the fits and scores of single effects, which take as much memory as what follows."""
        self._singles.clear()
        self.best = None
        for name in ("bare", "alone"):
            self.__dict__.pop(name, None)

    def near_noise(self) -> NearNoise | None:
        """The set's own model, or that with one effect, if it is near the noise of every joint."""
        self.say("fitting the set's own model and scoring candidates")
        floor = self.context.noise_floor
        self.best = RichModel(self.bare, {})
        self.standing.own_model(self.bare)
        if np.all(self.bare.rms < LIMITS.quiet_model * floor):
            return NearNoise(self.own, self.bare.x)
        if self.alone:
            self.standing.promising(self.alone[0].effect)
        excess = np.maximum(1 - (floor / self.bare.sigma) ** 2, 0.0).sum() * len(self.bare.weights)
        worth = [s for s in self.alone[: LIMITS.singles] if s.gain >= LIMITS.single_share * excess]
        if worth:
            self.say(f"testing candidate: {EFFECTS[worth[0].effect.effect].title}")
        for number, found in enumerate(self.singles(worth), 1):
            self.standing.fitted(found)
            if np.all(found.rms < LIMITS.near_noise * floor):
                rivals = (s.effect for s in self.alone[: THRESHOLDS.search.kept_signatures])
                return NearNoise(found.layout, found.x, frozenset(rivals))
            if number == 1 < len(worth):
                self.say(f"testing {plural(len(worth) - 1, 'other candidate')}")
        return None

    def survey(self) -> RichModel:
        """The rich model of usual effects, thinned out once."""
        self.say(stages.USUAL)
        fit, needed = self.thinned(self.usual_fit())
        return RichModel(fit, needed)

    def hides_many(self, survey: RichModel) -> bool:
        """Whether the set needs several effects.

        It does not if one alone leaves hardly more than the survey on every joint, or nearly the noise.
        """
        quiet = np.all(survey.fit.rms < LIMITS.far_off * self.context.noise_floor)
        if quiet and len(survey.added(self.own)) < LIMITS.many:
            self.few = frozenset(survey.added(self.own))
            return False
        weighty = [e for e in survey.added(self.own) if survey.needed[e].share > LIMITS.weighty_share]
        if len(weighty) >= LIMITS.surely_many:
            return True
        self.say(stages.ONE)
        floor = self.context.noise_floor
        enough = np.minimum(LIMITS.far_off * floor, np.maximum(LIMITS.as_well * survey.fit.rms, 2 * floor))
        leading = [s for s in self.alone if not is_episode(s.effect)]
        return not any(np.all(fit.rms < enough) for fit in self.singles(leading[: LIMITS.singles]))

    def run(self, survey: RichModel) -> RichModel:
        """The smallest model that is as good as the rich one with all that is found in what it leaves."""
        self.keep(survey.fit, survey.needed)
        fit, needed = self.with_starts(survey.fit, survey.needed)
        if self.context.set_standstill_apart(fit):
            fit, needed = self.thinned(self.usual_fit())
        fit, needed = self.refined(fit, needed)
        if self.context.set_standstill_apart(fit):
            again = self.fit(fit.layout, fit.x)
            fit, needed = self.refined(*self.thinned(again))
        fit, needed = self.with_all_found(fit, needed)
        merged, kept = self.with_rest_angles(fit, needed)
        if merged.objective > fit.objective + LIMITS.likelier:
            # offsets of the motor torque and of the link differ where friction follows the load
            joints = {e.joint for e in set(fit.layout.effects) - set(merged.layout.effects)}
            self._refused = {e for e in self._refused if e.joint not in joints}
            merged, kept = self.with_all_found(*self.refined(merged, kept, joints))
        merged, kept = self.with_original_laws(merged, kept)
        fit, needed = self.without_absent(*self.without_superfluous_curves(merged, kept))
        fit, needed = self.with_first_movements(fit, needed)
        return RichModel(fit, needed, self.curves)

    def keep(self, fit: MotionFit, needed: dict[ChosenEffect, Necessity]) -> None:
        """Keep the model so far, for a search that is stopped."""
        self.best = RichModel(fit, needed, self.curves)
        self.standing.fitted(self.best.model, self.context.first_phase)

    def with_all_found(
        self, fit: MotionFit, needed: dict[ChosenEffect, Necessity]
    ) -> tuple[MotionFit, dict[ChosenEffect, Necessity]]:
        """The model with all that is found in what it leaves, thinned out after each round."""
        idle = 0
        for _ in range(LIMITS.rounds):
            self.keep(fit, needed)
            self.say(f"scoring candidates beside {plural(len(needed.keys() - set(self.curves)), 'effect')}")
            chosen = self.best_of_each_joint(fit, self.scores(fit))
            if (unknown := self.unknown(fit, chosen)) is not None:
                joint = unknown.place.own_joint
                self.say(f"fitting a free curve to an unknown law on {self.own.joints[joint]}")
                if (beside := self.beside_curve(fit, unknown)) is not None:
                    (fit, needed), self._refused, idle = beside, set(), 0
                    continue
                self._lawful.add(joint)
            if not chosen or idle > LIMITS.idle_rounds:
                break
            names = ", ".join(sorted({EFFECTS[s.effect.effect].title for s in chosen}))
            self.say(f"adding: {names}")
            if (larger := self.enlarged(fit, chosen)) is not None:
                fit, needed, idle = *larger, 0
            else:
                self._refused |= {s.effect for s in chosen}
                idle += 1
        return fit, needed

    def beside_curve(
        self, fit: MotionFit, curve: ChosenEffect
    ) -> tuple[MotionFit, dict[ChosenEffect, Necessity]] | None:
        """The usual effects beside an unknown law, if that lowers the held-out residual clearly.

        What was found on its joint before may have imitated the law: it is left out, unless the law helps
        only beside it. What is real is found again.
        """
        joint = curve.place.own_joint
        highest = LIMITS.curve_gain * fit.held_out_rms()[joint]
        before = self.curves
        self.curves += (curve,)
        for layout in dict.fromkeys((self.without_found(fit.layout, joint), fit.layout)):
            larger = Layout(layout.joints, (*layout.effects, curve))
            start = self.fit(larger, larger.vector(fit.layout.model(fit.x)))
            if start.held_out_rms()[joint] < LIMITS.curve_promise * highest:
                larger_fit, kept = self.thinned(self.usual_fit(beside=start))
                if larger_fit.held_out_rms()[joint] < highest:
                    return larger_fit, kept
        self.curves = before
        return None

    def without_found(self, layout: Layout, joint: int) -> Layout:
        """A layout without the effects that the search has added on a joint to the usual ones."""
        usual = (e for e in layout.effects if e.joint != joint or EFFECTS[e.effect].usual or e in self.curves)
        return Layout(layout.joints, tuple(dict.fromkeys((*self.own.effects, *usual))))

    def enlarged(
        self, fit: MotionFit, chosen: list[ScoredCandidate]
    ) -> tuple[MotionFit, dict[ChosenEffect, Necessity]] | None:
        """The model with those candidates that are needed and make no held-out joint clearly worse.

        All at once, or else those of the joints that do not become worse, or else one of the leading ones.
        None if no candidate is of use.
        """

        def with_needed(wanted: list[ScoredCandidate]) -> MotionFit:
            return self.thinned(self.confirmed(fit, self.with_candidates(fit, wanted), wanted))[0]

        larger = with_needed(chosen)
        worse = self.worse_joints(fit, larger)
        if not worse and (better := self.if_better(fit, larger, chosen)) is not None:
            return better
        harmless = [s for s in chosen if s.effect.joint is not None and s.effect.joint not in worse]
        clear = [s for s in chosen[: LIMITS.alone] if s.gain > LIMITS.clear_share * len(fit.weights)]
        subsets = [harmless, *([s] for s in clear if [s] != harmless)]
        fewer = [subset for subset in subsets if 0 < len(subset) < len(chosen)]
        at_once = allowed_cores()
        for first in range(0, len(fewer), at_once):
            some = fewer[first : first + at_once]
            for wanted, larger in zip(some, self.on_all_cores(with_needed, some), strict=True):
                better = None if self.worse_joints(fit, larger) else self.if_better(fit, larger, wanted)
                if better is not None:
                    return better
        return None

    def if_better(
        self, fit: MotionFit, larger: MotionFit, added: list[ScoredCandidate]
    ) -> tuple[MotionFit, dict[ChosenEffect, Necessity]] | None:
        """A larger model, if it keeps any of the added candidates; the others are not tried again."""
        effects, kept = {s.effect for s in added}, set(larger.layout.effects)
        if not effects & kept or larger.objective >= fit.objective:
            return None
        self._refused |= effects - kept
        return larger, necessities(larger)

    def without_superfluous_curves(
        self, fit: MotionFit, needed: dict[ChosenEffect, Necessity]
    ) -> tuple[MotionFit, dict[ChosenEffect, Necessity]]:
        """The model without curves for which effects found later, usual ones or one more can stand."""
        for curve in self.curves:
            joint = curve.place.own_joint
            limit = LIMITS.superfluous_curve * float(fit.rms[joint])
            start = without_effect(fit.layout, fit.x, curve)
            without = self.fit(start.layout, start.x)
            if without.rms[joint] >= limit:
                limit = min(limit, LIMITS.far_off * float(self.context.noise_floor[joint]))
                without = self.by_library(without, joint, limit)
            if without.rms[joint] < limit:
                self.curves = tuple(c for c in self.curves if c != curve)
                fit, needed = self.thinned(without)
        return fit, needed

    def by_library(self, fit: MotionFit, joint: int, limit: float) -> MotionFit:
        """The model with all usual effects and, if a joint errs more than `limit` [Nm], one more on it.

        As it is where its linearised laws explain too little to come so far.
        """
        alone = self.lasting(fit, joint)
        best = alone[0].gain / len(fit.weights) if alone else 0.0
        if self.usual_share(fit, joint) + best < LIMITS.instead_of_curve:
            return fit
        self.say(f"trying laws in place of the curve on {self.own.joints[joint]}")
        usual = self.usual_fit(beside=fit)
        if usual.rms[joint] < limit or not (left := self.lasting(usual, joint)):
            return usual
        return self.with_candidates(usual, left[:1])

    def lasting(self, fit: MotionFit, joint: int) -> list[ScoredCandidate]:
        """Scores of a joint's effects that a model lacks, without episodes, the best first."""
        return self.scores(fit, [joint], episodes=False)
