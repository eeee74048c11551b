"""Search backwards from a rich model, for robots that hide many effects at once.

Adding one effect at a time to a poor model goes astray: its parameters run to wherever they absorb most, and
imitations win. Here every usual effect starts on every joint; what held-out groups and the residual do not
need is taken away. Then all other effects are scored at once on what is left, the best of each joint are
added, and the model is thinned out again, until nothing is found.
"""

from __future__ import annotations

from collections.abc import Callable
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
        fit, needed, idle = survey.fit, survey.needed, 0
        for _ in range(LIMITS.rounds):
            self.say("scoring what is left")
            chosen = self.best_of_each_joint(fit, self.scores(fit))
            if (unknown := self.unknown(fit, chosen)) is not None:
                self.say(f"eliminating an unknown law on {self.own.joints[unknown.joint]}")
                self.curves += (unknown,)
                self._refused = set()
                fit, needed = self.thinned(self.usual_fit(beside=fit))
                continue
            if not chosen or idle > LIMITS.idle_rounds:
                break
            names = ", ".join(sorted({EFFECTS[s.effect.effect].title for s in chosen}))
            self.say(f"adding: {names}")
            larger, kept = self.thinned(self.confirmed(fit, self.with_candidates(fit, chosen), chosen))
            added = {s.effect for s in chosen}
            self._refused |= added - set(kept)
            if added & set(kept) and larger.objective < fit.objective:
                fit, needed, idle = larger, kept, 0
            else:
                self._refused |= added
                idle += 1
        fit, needed = self.without_superfluous_curves(fit, needed)
        return RichModel(fit, needed, self.curves)

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
            values[: EFFECTS[effect.effect].size_count] *= LIMITS.small_start
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
        firm = frozenset(self.own.effects)
        for _ in range(LIMITS.eliminations):
            result = eliminate(fit, firm)
            merged = self.merged_offsets(fit.layout, result.x, tuple(result.kept))
            if not result.dropped and merged is None:
                return fit, result.kept
            kept, x = merged or (tuple(result.kept), result.x)
            smaller = Layout(fit.layout.joints, kept)
            fit = self.context.fit(
                smaller, self.feasible(fit, smaller, x), curves=self.curves, check=self.check
            )
        return fit, eliminate(fit, frozenset(fit.layout.effects)).kept

    def feasible(self, fit: MotionFit, smaller: Layout, x: Array) -> Array:
        """Start of a smaller model on the way from a fit to x: the linear move may leave what is possible."""
        prior = self.context.start(smaller).prior
        for share in (1.0, 0.5, 0.25):
            start = smaller.vector(fit.layout.model(fit.x + share * (x - fit.x)))
            if prior.feasible(start):
                return start
        return smaller.vector(fit.layout.model(fit.x))

    def merged_offsets(
        self, layout: Layout, x: Array, kept: tuple[ChosenEffect, ...]
    ) -> tuple[tuple[ChosenEffect, ...], Array] | None:
        """A torque offset beside a spring becomes part of the spring's rest angle; None without any such."""
        x, merged = x.copy(), []
        springs = {e.joint: e for e in kept if EFFECTS[e.effect].offset_parameter}
        for effect in kept:
            if effect.effect != "torque_offset" or effect.joint not in springs or effect in self.own.effects:
                continue
            where = place(layout, springs[effect.joint])
            stiffness, rest = x[where]
            if stiffness <= 0:
                continue
            x[where.start + 1] = np.clip(rest - x[place(layout, effect).start] / stiffness, -50.0, 50.0)
            merged.append(effect)
        return (tuple(e for e in kept if e not in merged), x) if merged else None

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
        taken = {curve.joint for curve in self.curves}
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
        layout = Layout(fit.layout.joints, (*kept, *(s.effect for s in chosen)))
        x = layout.vector(fit.layout.model(fit.x))
        for s in chosen:
            x[place(layout, s.effect)] = s.values
        return self.context.fit(layout, x, curves=self.curves, check=self.check)
