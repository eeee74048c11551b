"""Search backwards from a rich model, for robots that hide many effects at once.

Adding one effect at a time to a poor model goes astray: its parameters run to wherever they absorb most, and
imitations win. Here every usual effect starts on every joint; what held-out groups and the residual do not
need is taken away. Then all other effects are scored at once on what is left, the best of each joint are
added, and the model is thinned out again, until nothing is found.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.candidates import candidates
from flexviz.diagnosis.elimination import Necessity, eliminate
from flexviz.diagnosis.motion_fit import MotionContext, MotionFit, place
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.unknown_curve import PIECES, VARIABLES, UnknownCurve, explained_gain
from flexviz.effects import EFFECTS, ChosenEffect, JointScale
from flexviz.equation import Layout
from flexviz.estimation import Projection, ScoredCandidate, best_intervals, score

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.motion
OFFSET = "torque_offset"


@dataclass(frozen=True, eq=False)
class RichModel:
    """The smallest model found.

    Attributes:
        fit: its fit.
        needed: how much it needs each of its effects.
        curves: unknown laws that were eliminated.
    """

    fit: MotionFit
    needed: dict[ChosenEffect, Necessity]
    curves: tuple[UnknownCurve, ...] = ()

    def added(self, own: Layout) -> list[ChosenEffect]:
        """Effects beyond the set's own model, the largest share of the torque first."""
        new = [e for e in self.needed if e not in own.effects]
        return sorted(new, key=lambda e: -self.needed[e].share)


class RichSearch:
    """A search on one set.

    Args:
        context: the data.
        own: effects of the set's own model, which stay.
        say: called with a progress message; may raise to stop.
    """

    def __init__(self, context: MotionContext, own: Layout, say: Callable[[str], None]) -> None:
        self.context, self.own, self.say = context, own, say
        self._refused: set[ChosenEffect] = set()
        self._lawful: set[int] = set()  # joints on which a free curve does not help
        self.curves: tuple[UnknownCurve, ...] = ()

    def check(self) -> None:
        self.say("")

    def survey(self) -> RichModel:
        """The rich model of usual effects, thinned out once."""
        self.say("fitting all usual effects on all joints")
        fit, needed = self.thinned(self.usual_fit())
        return RichModel(fit, needed)

    def hides_many(self, survey: RichModel) -> bool:
        """Whether the set needs several effects and no single one explains nearly as much."""
        quiet = np.all(survey.fit.rms < LIMITS.far_off * self.context.noise_floor)
        if quiet and len(survey.added(self.own)) < LIMITS.many:
            return False
        self.say("checking whether one effect explains all")
        bare = self.context.fit(self.own, self.context.start(self.own).x, check=self.check)
        enough = LIMITS.explains_all * np.maximum(survey.fit.rms, self.context.noise_floor)
        leading = [s for s in self.scores(bare) if EFFECTS[s.effect.effect].scope != "episode"]
        singles = (self.with_candidates(bare, [s]) for s in leading[: LIMITS.singles])
        return not any(np.all(single.rms < enough) for single in singles)

    def run(self, survey: RichModel) -> RichModel:
        """The smallest model that is as good as the rich one with all that is found in what it leaves."""
        idle = 0
        fit, needed = survey.fit, survey.needed
        if self.context.set_standstill_apart(fit):
            fit, needed = self.thinned(self.usual_fit())
        fit, needed = self.refined(fit, needed)
        if self.context.set_standstill_apart(fit):
            again = self.context.fit(fit.layout, fit.x, check=self.check)
            fit, needed = self.refined(*self.thinned(again))
        for _ in range(LIMITS.rounds):
            self.say("scoring what is left")
            chosen = self.best_of_each_joint(fit, self.scores(fit))
            if (unknown := self.unknown(fit, chosen)) is not None:
                self.say(f"eliminating an unknown law on {self.own.joints[unknown.joint]}")
                joint, before = unknown.joint, self.curves
                self.curves += (unknown,)
                beside, kept = self.thinned(self.usual_fit(beside=fit))
                if beside.held_out_rms()[joint] < LIMITS.curve_gain * fit.held_out_rms()[joint]:
                    fit, needed, self._refused = beside, kept, set()
                    continue
                self.curves, self._lawful = before, self._lawful | {joint}
            if not chosen or idle > LIMITS.idle_rounds:
                break
            names = ", ".join(sorted({EFFECTS[s.effect.effect].title for s in chosen}))
            self.say(f"adding: {names}")
            larger, kept = self.enlarged(fit, chosen)
            added = {s.effect for s in chosen}
            self._refused |= added - set(kept)
            if added & set(kept) and larger.objective < fit.objective:
                fit, needed, idle = larger, kept, 0
            else:
                self._refused |= added
                idle += 1
        fit, needed = self.without_superfluous_curves(fit, needed)
        fit, needed = self.with_rest_angles(fit, needed)
        return RichModel(fit, needed, self.curves)

    def enlarged(
        self, fit: MotionFit, chosen: list[ScoredCandidate]
    ) -> tuple[MotionFit, dict[ChosenEffect, Necessity]]:
        """The model with those candidates that are needed and make no held-out joint clearly worse."""
        larger, kept = self.thinned(self.confirmed(fit, self.with_candidates(fit, chosen), chosen))
        worse = self.worse_joints(fit, larger)
        if not worse:
            return larger, kept
        harmless = [s for s in chosen if s.effect.joint is not None and s.effect.joint not in worse]
        if harmless and len(harmless) < len(chosen):
            larger, kept = self.thinned(self.confirmed(fit, self.with_candidates(fit, harmless), harmless))
            if not self.worse_joints(fit, larger):
                return larger, kept
        return fit, {}

    def worse_joints(self, fit: MotionFit, larger: MotionFit) -> set[int]:
        """Joints whose held-out residual is clearly larger than before."""
        allowed = np.maximum(LIMITS.worse * fit.held_out_rms(), LIMITS.far_off * self.context.noise_floor)
        return {int(j) for j in np.flatnonzero(larger.held_out_rms() > allowed)}

    def without_superfluous_curves(
        self, fit: MotionFit, needed: dict[ChosenEffect, Necessity]
    ) -> tuple[MotionFit, dict[ChosenEffect, Necessity]]:
        """The model without curves that the effects found later made superfluous."""
        for curve in self.curves:
            others = tuple(c for c in self.curves if c != curve)
            without = self.context.fit(fit.layout, fit.x, curves=others, check=self.check)
            if without.rms[curve.joint] < LIMITS.superfluous_curve * fit.rms[curve.joint]:
                self.curves = others
                fit, needed = self.thinned(without)
        return fit, needed

    # -- the rich model

    def usual_fit(self, beside: MotionFit | None = None) -> MotionFit:
        """Every usual effect on every joint, from small sizes; `beside`: a model whose effects are kept."""
        have = self.own.effects if beside is None else beside.layout.effects
        own = set(have)
        replaced = {(EFFECTS[e.effect].replaces, e.joint) for e in own}
        usual = (
            ChosenEffect(name, joint)
            for name, law in EFFECTS.items()
            if law.usual
            for joint in range(self.own.n)
        )
        more = (e for e in usual if e not in own and (e.effect, e.joint) not in replaced)
        layout = Layout(self.own.joints, (*have, *more))
        x = self.context.start(layout).x.copy()
        if beside is not None:
            x = layout.vector(beside.layout.model(beside.x))
        for effect, where in layout.effect_slices():
            if beside is not None and effect in own:
                continue
            values = np.array(EFFECTS[effect.effect].typical(self.scale(effect.joint or 0)))
            values[list(EFFECTS[effect.effect].size_at)] *= LIMITS.small_start
            x[where] = values
        return self.context.fit(layout, x, curves=self.curves, check=self.check)

    def scale(self, joint: int) -> JointScale:
        """Magnitudes of a joint's motion in the fit groups."""
        signals, x = self.context.signals, self.context.start(Layout(self.own.joints)).x
        layout = Layout(self.own.joints)
        torque = float(np.sqrt(np.mean(signals.tau[0, :, joint] ** 2)))
        compliance, inertia = x[layout.compliance], x[layout.motor_inertia]
        neighbour = joint - 1 if joint else min(1, self.own.n - 1)
        return JointScale(
            torque=torque,
            speed=float(np.sqrt(np.mean(signals.theta[1, :, joint] ** 2))),
            deflection=torque * float(compliance[joint]),
            stiffness=1 / float(compliance[joint]),
            motor_inertia=float(inertia[joint]),
            neighbour_inertia=float(inertia[neighbour]),
            position=float(np.mean(signals.theta[0, :, joint])),
            duration=float(np.ptp(signals.time)),
        )

    # -- backwards

    def thinned(self, fit: MotionFit) -> tuple[MotionFit, dict[ChosenEffect, Necessity]]:
        """The model without the effects that it does not need, fitted again until all are needed."""
        for _ in range(LIMITS.eliminations):
            result = eliminate(fit, frozenset(self.own.effects) | self.offsets_of_springs(fit.layout))
            if not result.dropped:
                return fit, result.kept
            smaller = Layout(fit.layout.joints, tuple(result.kept))
            start = self.feasible(fit, smaller, result.x)
            fit = self.context.fit(smaller, start, curves=self.curves, check=self.check)
        return fit, eliminate(fit, frozenset(fit.layout.effects)).kept

    def offsets_of_springs(self, layout: Layout) -> frozenset[ChosenEffect]:
        """Torque offsets beside a spring, whose rest angle they stand for during the search.

        k (q − q₀) with both free is singular where k is small; k (q − q̄) and an offset are linear.
        """
        springs = {e.joint for e in layout.effects if EFFECTS[e.effect].offset_parameter}
        return frozenset(e for e in layout.effects if e.effect == OFFSET and e.joint in springs)

    def with_rest_angles(
        self, fit: MotionFit, needed: dict[ChosenEffect, Necessity]
    ) -> tuple[MotionFit, dict[ChosenEffect, Necessity]]:
        """The model with torque offsets beside a spring turned into the spring's rest angle."""
        merged = self.offsets_of_springs(fit.layout) - set(self.own.effects)
        if not merged:
            return fit, needed
        smaller = Layout(fit.layout.joints, tuple(e for e in fit.layout.effects if e not in merged))
        x = smaller.vector(fit.layout.model(fit.x))
        for offset in merged:
            for effect, where in smaller.effect_slices():
                if (
                    effect.joint == offset.joint
                    and EFFECTS[effect.effect].offset_parameter
                    and x[where.start]
                ):
                    torque = fit.x[place(fit.layout, offset).start]
                    x[where.start + 1] = np.clip(x[where.start + 1] - torque / x[where.start], -50.0, 50.0)
        fit = self.context.fit(smaller, x, curves=self.curves, check=self.check)
        return fit, eliminate(fit, frozenset(smaller.effects)).kept

    def feasible(self, fit: MotionFit, smaller: Layout, x: Array) -> Array:
        """Start of a smaller model on the way from a fit to x: the linear move may leave what is possible."""
        prior = self.context.start(smaller).prior
        for share in (1.0, 0.5, 0.25):
            start = smaller.vector(fit.layout.model(fit.x + share * (x - fit.x)))
            if prior.feasible(start):
                return start
        return smaller.vector(fit.layout.model(fit.x))

    # -- refinements of effects that it has

    def refined(
        self, fit: MotionFit, needed: dict[ChosenEffect, Necessity]
    ) -> tuple[MotionFit, dict[ChosenEffect, Necessity]]:
        """The model with effects replaced by their refinement on the joints where that helps clearly.

        All at once: the score of a single refinement says little, because its law is far from linear.
        """
        loud = fit.rms > LIMITS.far_off * self.context.noise_floor
        finer = {law.replaces: name for name, law in EFFECTS.items() if law.replaces}
        swaps = {
            e: ChosenEffect(finer[e.effect], e.joint)
            for e in fit.layout.effects
            if e.effect in finer and e.joint is not None and loud[e.joint] and e not in self.own.effects
        }
        if not swaps:
            return fit, needed
        self.say(f"trying: {', '.join(sorted({EFFECTS[e.effect].title for e in swaps.values()}))}")
        trial = self.swapped(fit, fit, swaps)
        old, new = fit.held_out_rms() ** 2, trial.held_out_rms() ** 2
        better = {
            e: swap
            for e, swap in swaps.items()
            if max(new[e.joint] / old[e.joint], (trial.sigma[e.joint] / fit.sigma[e.joint]) ** 2)
            < 1 - LIMITS.replaced_share
        }
        if not better:
            return fit, needed
        return self.thinned(trial if len(better) == len(swaps) else self.swapped(fit, trial, better))

    def swapped(
        self, fit: MotionFit, values: MotionFit, swaps: Mapping[ChosenEffect, ChosenEffect]
    ) -> MotionFit:
        """The model with effects swapped, from the values of a model that may have the new ones."""
        layout = Layout(fit.layout.joints, tuple(swaps.get(e, e) for e in fit.layout.effects))
        x = layout.vector(values.layout.model(values.x))
        for old, new in swaps.items():
            if new not in values.layout.effects:
                x[place(layout, new)] = EFFECTS[new.effect].refining(fit.x[place(fit.layout, old)])
        for effect, where in layout.effect_slices():
            if effect in fit.layout.effects and effect not in values.layout.effects:
                x[where] = fit.x[place(fit.layout, effect)]
        return self.context.fit(layout, x, curves=self.curves, check=self.check)

    # -- what is left

    def scores(self, fit: MotionFit) -> list[ScoredCandidate]:
        """Scores of all effects that a model lacks, the best first."""
        weigh = self.weigh(fit)
        residual, jacobian = fit.whitened
        flat = jacobian.reshape(-1, fit.layout.size)
        projection = Projection(residual.ravel(), flat, flat.T @ flat + fit.prior_hessian)
        wanted = [e for e in candidates(fit.layout, self.fit_groups) if e not in self._refused]
        found = score(fit.point, fit.chain, wanted, weigh, projection)
        for joint in range(fit.layout.n):
            self.check()
            intervals = best_intervals(fit.point, joint, weigh, projection, longest=LIMITS.longest_episode)
            found += [s for s in intervals if s.effect not in self._refused]
        return sorted(found, key=lambda s: -s.gain)

    def unknown(self, fit: MotionFit, chosen: list[ScoredCandidate]) -> UnknownCurve | None:
        """The free curve that explains much more than any candidate on its joint; the largest one."""
        residual, jacobian = fit.whitened
        flat = jacobian.reshape(-1, fit.layout.size)
        projection = Projection(residual.ravel(), flat, flat.T @ flat + fit.prior_hessian)
        best = {s.effect.joint: s.gain for s in reversed(chosen)}
        taken = {curve.joint for curve in self.curves} | self._lawful
        ratio = fit.rms / self.context.noise_floor
        joint = int(np.argmax(np.where([j in taken for j in range(fit.layout.n)], 0.0, ratio)))
        if joint in taken or ratio[joint] < LIMITS.far_off:
            return None
        curves = [self.context.unknown_curve(joint, variable) for variable in VARIABLES]
        gains = [self.curve_gain(fit, curve, projection) for curve in curves]
        k = int(np.argmax(gains))
        least = max(LIMITS.least_curve_share * len(fit.weights), LIMITS.curve_lead * best.get(joint, 0.0))
        return curves[k] if gains[k] > least else None

    def curve_gain(self, fit: MotionFit, curve: UnknownCurve, projection: Projection) -> float:
        """Share of the weighted sum of squares that a curve explains beside the model's own parameters."""
        columns = np.zeros((*fit.weights.shape, PIECES))
        columns[:, curve.joint] = curve.columns(fit.point)
        columns *= fit.weights[:, :, None]
        return explained_gain(curve, *projection.normal(columns.reshape(-1, PIECES)))

    @property
    def fit_groups(self) -> list:
        return [g for g in self.context.measurements.groups if not g.validation]

    def weigh(self, fit: MotionFit) -> Callable[[Array, int], Array]:
        """Function that weights the columns of a stretch like the residual of a fit."""

        def weigh(columns: Array, block: int) -> Array:
            rows = self.context.signals.blocks[block].rows
            return (columns * fit.weights[rows][:, :, None]).reshape(-1, columns.shape[2])

        return weigh

    def best_of_each_joint(self, fit: MotionFit, leading: list[ScoredCandidate]) -> list[ScoredCandidate]:
        """The best candidate of each joint, and of those without one, that explains a clear share."""
        chosen: dict[int | None, ScoredCandidate] = {}
        quiet = fit.rms < LIMITS.quiet * self.context.noise_floor
        for s in leading:
            law, joint = EFFECTS[s.effect.effect], s.effect.joint
            least = LIMITS.least_share_episode if law.scope == "episode" else LIMITS.least_share
            if s.gain < least * len(fit.weights):
                continue
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
                law.scope == "episode"
                and larger.rms[joint] > LIMITS.episode_noise * self.context.noise_floor[joint]
            ):
                doubtful.append(s)
            if (
                law.replaces
                and larger.sigma[joint] ** 2 > (1 - LIMITS.replaced_share) * fit.sigma[joint] ** 2
            ):
                doubtful.append(s)
        return self.with_candidates(fit, [s for s in chosen if s not in doubtful]) if doubtful else larger

    def with_candidates(self, fit: MotionFit, chosen: list[ScoredCandidate]) -> MotionFit:
        """The model with candidates at their scored values, fitted."""
        replaced = {(EFFECTS[s.effect.effect].replaces, s.effect.joint) for s in chosen}
        kept = tuple(e for e in fit.layout.effects if (e.effect, e.joint) not in replaced)
        springs = [s for s in chosen if EFFECTS[s.effect.effect].offset_parameter]
        offsets = (ChosenEffect(OFFSET, s.effect.joint) for s in springs)
        new = dict.fromkeys((*(s.effect for s in chosen), *offsets))
        layout = Layout(fit.layout.joints, (*kept, *(e for e in new if e not in kept)))
        x = layout.vector(fit.layout.model(fit.x))
        for s in chosen:
            x[place(layout, s.effect)] = s.values
        return self.context.fit(layout, x, curves=self.curves, check=self.check)
