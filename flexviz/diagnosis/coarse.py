"""The coarse resolution: the band of the motion, each joint weighted by what the model leaves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.candidates import (
    candidates,
    credible,
    offsets_of_springs,
    usual_model,
    with_candidates,
    with_offsets_merged,
)
from flexviz.diagnosis.criterion import Gain, Likelihood, Residuals, gain, half_seconds, likelihood
from flexviz.diagnosis.elimination import Linearised
from flexviz.diagnosis.fit_context import STEPS
from flexviz.diagnosis.motion_fit import MotionContext, MotionFit
from flexviz.diagnosis.motion_samples import Phase
from flexviz.diagnosis.resolution import EFFORT, LIMITS, Model, Resolution, Scoring, without
from flexviz.diagnosis.search import Candidate
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.unknown_curve import best_curve, is_curve
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import Layout
from flexviz.estimation import shares_alone

Array = NDArray[np.float64]
CoarseModel = Model[MotionFit]


class Coarse(Resolution[MotionFit]):
    """Models of one set in the band of the motion.

    Each joint is weighted by what its model leaves, σ² = noise + m, and large residuals count linearly: an
    incomplete model of a real robot is judged by its own error instead of by sensors far better than it.
    """

    name = "coarse"

    def __init__(self, context: MotionContext, own: Layout, say: Callable[[str], None]) -> None:
        super().__init__(context.measurements, own, say, many=True)
        self.context = context
        self.noise = np.maximum(context.noise_floor, LIMITS.tolerance * context.spread)
        self.in_start = dict[ChosenEffect, Gain]()  # of what acts in first movements alone

    # -- fits

    def fit(self, layout: Layout, x: Array, iterations: int = STEPS) -> CoarseModel:
        """A model fitted from x, shape (P,)."""
        return self.model(self.context.fit(layout, x, iterations=iterations, check=self.check))

    def refit(self, model: CoarseModel, layout: Layout, x: Array) -> CoarseModel:
        return self.fit(layout, x)

    def model(self, fit: MotionFit) -> CoarseModel:
        """A fit with its likelihood."""
        return Model(fit, self.likelihood(fit))

    def bare(self) -> CoarseModel:
        """The set's own model."""
        return self.fit(self.own, self.context.start(self.own).x)

    def rich(self, beside: CoarseModel | None = None) -> CoarseModel:
        """Every usual effect on every joint; `beside`: a model whose effects are kept."""
        usual = usual_model(self.context, self.own, beside and beside.fit)
        return self.fit(usual.layout, usual.x, STEPS // 2)  # it need not converge

    def towards(self, model: CoarseModel, x: Array, smaller: Layout) -> Array:
        return model.fit.towards(x, smaller)

    def with_rest_angles(self, model: CoarseModel) -> CoarseModel:
        """The model with torque offsets on a joint with a spring turned into the spring's rest angle."""
        merged = with_offsets_merged(model.fit, self.own)
        return model if merged.layout == model.layout else self.fit(merged.layout, merged.x)

    # -- likelihood

    def residuals(self, fit: MotionFit) -> list[Residuals]:
        context = self.context
        return [
            Residuals(r, used, half_seconds(s.blocks), [b.rows for b in s.blocks])
            for r, used, s in zip(fit.residuals, context.used, context.parts, strict=True)
        ]

    def likelihood(self, fit: MotionFit) -> Likelihood:
        """Likelihood of a fit; free curves cost what their prior and the data say, not a count."""
        prior, freedom = self.context.start(fit.layout).prior, 0
        other = prior.value(fit.x)
        for effect, where in fit.layout.effect_slices():
            if is_curve(effect):
                other += curve_cost(fit, where)
            else:
                freedom += where.stop - where.start
        found = likelihood(self.residuals(fit), self.floor, other, freedom, LIMITS.outlier)
        return self.judged(found, prior, fit.x)

    def linearised(self, model: CoarseModel) -> Linearised:
        fit = model.fit
        gradient, hessian = fit.prior_derivatives
        return Linearised(
            fit.layout, fit.x, self.residuals(fit), fit.jacobians(), self.floor, fit.information + hessian,
            (gradient, hessian), fit.held, self.context.start(fit.layout).bounds, model.likelihood,
            LIMITS.outlier,
        )  # fmt: skip

    def scoring(self, fit: MotionFit) -> Scoring:
        return Scoring(fit.point, fit.chain, fit.weigh, fit.projection)

    def significant(self, model: CoarseModel) -> NDArray[np.bool_]:
        """Joints whose model error is more than noise, and a share of the torque that counts, shape (n,)."""
        deviation = model.likelihood.deviation
        error = np.sqrt(np.maximum(deviation**2 - self.floor**2, 0.0))
        return (error > LIMITS.unknown_share * self.context.spread) & (error > LIMITS.deviations * self.floor)

    # -- moves

    def alone(self, model: CoarseModel, joint: int | None) -> dict[str, float]:
        """Effect → share of its joint's error that it alone would remove; `joint`: None for all others."""
        fit = model.fit
        wanted = [e for e in candidates(fit.layout, self.measurements.groups, self.many) if e.joint == joint]
        found = shares_alone(fit.point, fit.chain, wanted, fit.weigh, fit.projection)
        return {e.text(self.own.joints): share for e, share in found.items()}

    def firm(self, layout: Layout) -> set[ChosenEffect]:
        curves = filter(is_curve, layout.effects)
        return {*super().firm(layout), *curves, *offsets_of_springs(layout)}

    def with_added(self, model: CoarseModel, chosen: Sequence[Candidate]) -> CoarseModel:
        """The model with candidates, fitted."""
        self.say(f"adding: {', '.join(sorted({EFFECTS[c.content.effect.effect].title for c in chosen}))}")
        larger = with_candidates(model.fit, [c.content for c in chosen])
        trial = self.fit(larger.layout, larger.x, EFFORT.first_look)
        return self.fit(larger.layout, trial.fit.x) if self.promising(model, trial) else trial

    def swaps(self, model: CoarseModel) -> Iterable[Callable[[CoarseModel], CoarseModel]]:
        """Laws in place of those that they refine, or for which they may be mistaken."""
        for name, law in EFFECTS.items():
            for old, new in ((law.replaces, name), (law.instead_of, name), (name, law.instead_of)):
                if old and new:
                    yield partial(self.swapped, old=old, new=new)

    def swapped(self, model: CoarseModel, old: str, new: str) -> CoarseModel:
        """The model with a law in place of another on the joints where that gains."""
        fit = model.fit
        loud = model.likelihood.deviation > self.floor
        pairs = {
            e: ChosenEffect(new, e.joint)
            for e in fit.layout.effects
            if e.effect == old and e.joint is not None and loud[e.joint]
        }
        taken = {*self.own.effects, *fit.layout.effects}
        pairs = {e: to for e, to in pairs.items() if e not in self.own.effects and to not in taken}
        if not pairs:
            return model
        self.say(f"trying: {EFFECTS[new].title}")
        trial = self.exchanged(model, model, pairs)
        found = gain(model.likelihood, trial.likelihood)
        clear = found.by_joint > LIMITS.deviations * found.errors
        good = {
            e: to
            for e, to in pairs.items()
            if clear[e.place.own_joint] and credible(trial.fit, to, self.raw_step)
        }
        if not good:
            return trial if len(pairs) == 1 else model
        return self.pruned(trial if len(good) == len(pairs) else self.exchanged(model, trial, good))

    def exchanged(
        self, model: CoarseModel, values: CoarseModel, pairs: Mapping[ChosenEffect, ChosenEffect]
    ) -> CoarseModel:
        """The model with effects exchanged, from the values of a model that may have the new ones."""
        fit = model.fit
        springs = {e.joint for e in pairs if EFFECTS[e.effect].offset_parameter}
        offsets = offsets_of_springs(fit.layout) - set(self.own.effects)
        gone = {offset.joint: offset for offset in offsets if offset.joint in springs}
        kept = without(fit.layout, gone.values()).effects
        layout = fit.layout.with_effects(pairs.get(e, e) for e in kept)
        x = layout.vector(values.layout.model(values.fit.x))
        for old, new in pairs.items():
            if new not in values.layout.effects:
                start = fit.x[fit.layout.effect_slice(old)]
                if old.joint in gone:
                    torque = float(fit.x[fit.layout.effect_slice(gone[old.joint]).start])
                    start = EFFECTS[old.effect].with_constant(start, torque)
                x[layout.effect_slice(new)] = EFFECTS[new.effect].refining(start)
        for effect, where in layout.effect_slices():
            if effect in fit.layout.effects and effect not in values.layout.effects:
                x[where] = fit.x[fit.layout.effect_slice(effect)]
        # while an effect is missing, others stand in for it at values from which a fit may not return
        afresh = self.context.start(layout).x.copy()
        afresh[layout.effect_start :] = x[layout.effect_start :]
        best = min(
            (self.fit(layout, at, EFFORT.first_look) for at in (x, afresh)), key=lambda m: m.fit.objective
        )
        return self.fit(layout, best.fit.x) if best.fit.objective < fit.objective else best

    def gains(self, model: CoarseModel) -> dict[ChosenEffect, Gain]:
        return super().gains(model) | self.in_start

    def with_first_movements(self, model: CoarseModel) -> CoarseModel:
        """The model with effects of the first movement after a standstill, which then counts.

        What happens a few times in a record is an outlier to the search: here those movements alone count,
        in units of what the model leaves in motion.
        """
        context, before = self.context, self.context.first_phase
        if not np.any(before == Phase.MOTION):
            return model
        context.first_phase = np.minimum(before, np.int8(Phase.START))
        there = self.fit(model.layout, model.fit.x, iterations=0)
        wanted = candidates(there.layout, self.measurements.groups, self.many)
        starts = [
            e for e in wanted if EFFECTS[e.effect].after_rest and before[e.place.own_joint] == Phase.MOTION
        ]
        scored = self.scores(there.fit, starts, episodes=False)
        start = with_candidates(there.fit, scored)
        larger = self.fit(start.layout, start.x)
        gains = {s.effect: self.gain_in_start(there, larger, s.effect.place.own_joint) for s in scored}
        kept = [
            s for s in scored if gains[s.effect].accepted and credible(larger.fit, s.effect, self.raw_step)
        ]
        self.in_start = {s.effect: gains[s.effect] for s in kept}
        joints = [s.effect.place.own_joint for s in kept]
        context.first_phase = np.where(np.isin(np.arange(self.own.n), joints), context.first_phase, before)
        if not kept:
            return model
        start = with_candidates(there.fit, kept)
        return self.fit(start.layout, start.x)

    def gain_in_start(self, before: CoarseModel, after: CoarseModel, joint: int) -> Gain:
        """What a larger model gains in the first movements of a joint, in units of what is left in motion."""
        sigma = np.full(self.own.n, np.inf)
        sigma[joint] = before.likelihood.deviation[joint]

        def like(model: CoarseModel) -> Likelihood:
            only = [
                replace(p, used=p.used & (phase == Phase.START))
                for p, phase in zip(self.residuals(model.fit), self.context.phases, strict=True)
            ]
            extra = 2 * (model is after)
            return likelihood(only, sigma, 0.0, extra, np.inf, before.likelihood.times, fixed=True)

        return gain(like(before), like(after), self.tried)

    def unknowns(self, model: CoarseModel) -> Iterable[Callable[[CoarseModel], CoarseModel]]:
        """A free curve on a joint with a significant model error, the largest first."""
        taken = {e.joint for e in model.layout.effects if is_curve(e)}
        much = self.significant(model)
        order = map(int, np.argsort(-model.likelihood.deviation / self.floor))
        joints = [j for j in order if much[j] and j not in taken]
        return [partial(self.with_curve, joint=j) for j in joints[: THRESHOLDS.search.unknown_places]]

    def with_curve(self, model: CoarseModel, joint: int) -> CoarseModel:
        """The model with the free curve of a joint that explains most, and what is needed given it."""
        curve, promised = best_curve(model.fit, joint)
        if 0.5 * promised / model.likelihood.times[joint] < self.least():
            return model
        self.say(f"fitting a free curve to an unknown law on {self.own.joints[joint]}")
        layout = model.layout.with_effects((*model.layout.effects, curve))
        start = self.fit(layout, layout.vector(model.layout.model(model.fit.x)))
        return self.pruned(self.rich(start))


def curve_cost(fit: MotionFit, where: slice) -> float:
    """½ log det(1 + C G) of a curve with prior covariance C and information G [nats]."""
    free = np.diag(fit.information)[where] > 0
    prior = fit.prior_derivatives[1][where, where][np.ix_(free, free)]
    known = fit.information[where, where][np.ix_(free, free)]
    return 0.5 * float(np.linalg.slogdet(prior + known)[1] - np.linalg.slogdet(prior)[1])
