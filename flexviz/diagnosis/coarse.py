"""The coarse resolution: the band of the motion, each joint weighted by what the model leaves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.acceptance import credible
from flexviz.diagnosis.candidates import candidates, is_episode
from flexviz.diagnosis.criterion import Gain, Likelihood, Residuals, gain, half_seconds, likelihood
from flexviz.diagnosis.elimination import Linearised, eliminate
from flexviz.diagnosis.model_family import ModelFamily
from flexviz.diagnosis.motion_fit import MotionContext, MotionFit
from flexviz.diagnosis.scoring import score_by_joint
from flexviz.diagnosis.search import Candidate
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.unknown_curve import best_curve, is_curve
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import Layout

Array = NDArray[np.float64]
LIMITS, LOOP = THRESHOLDS.criterion, THRESHOLDS.search


@dataclass(frozen=True, eq=False)
class CoarseModel:
    """A fitted model with its likelihood."""

    fit: MotionFit
    likelihood: Likelihood

    @property
    def layout(self) -> Layout:
        return self.fit.layout


class Coarse:
    """Models of one set at the coarse resolution, a `Problem` of the search."""

    name = "coarse"

    def __init__(self, context: MotionContext, own: Layout, say: Callable[[str], None]) -> None:
        self.context, self.own, self.say = context, own, say
        self.family = ModelFamily(context, own, say)
        groups = context.measurements.groups
        self.raw_step = max(s.step for g in groups for s in g.segments)
        bare = candidates(own, groups, many=True)
        self.tried = len(bare) + own.n * len(groups)
        self.floor = np.maximum(context.noise_floor, LIMITS.tolerance * context.spread)

    def fit(self, layout: Layout, x: Array, iterations: int = 25) -> CoarseModel:
        return self.model(self.context.fit(layout, x, iterations=iterations, check=lambda: self.say("")))

    def model(self, fit: MotionFit) -> CoarseModel:
        return CoarseModel(fit, self.likelihood(fit))

    def bare(self) -> CoarseModel:
        """The set's own model."""
        return self.fit(self.own, self.context.start(self.own).x)

    def complete(self, model: CoarseModel) -> bool:
        """Whether no move can gain what it costs: the model is at the noise."""
        return self.above(model) < 2 * np.log(self.tried)

    def with_rest_angles(self, model: CoarseModel) -> CoarseModel:
        """The model with torque offsets beside a spring turned into the spring's rest angle."""
        merged = self.family.with_offsets_merged(model.fit)
        return model if merged is model.fit else self.model(merged)

    def rich(self, beside: CoarseModel | None = None) -> CoarseModel:
        """Every usual effect on every joint."""
        return self.model(self.family.usual_fit(None if beside is None else beside.fit))

    def residuals(self, fit: MotionFit) -> list[Residuals]:
        blocks = self.context.signals.blocks
        parts = [Residuals(fit.residual, self.context.used, half_seconds(blocks), [b.rows for b in blocks])]
        if fit.held_out:
            held = self.context.judged_signals.blocks
            parts.append(
                Residuals(
                    fit.held_out_residual,
                    self.context.judged_used,
                    half_seconds(held),
                    [b.rows for b in held],
                )
            )
        return parts

    def likelihood(self, fit: MotionFit) -> Likelihood:
        layout, prior = fit.layout, self.context.start(fit.layout).prior
        freedom, other = 0, prior.value(fit.x)
        for effect, where in layout.effect_slices():
            if is_curve(effect):
                other += self.occam(fit, where)
            else:
                freedom += where.stop - where.start
        return likelihood(self.residuals(fit), self.floor, other, freedom, LIMITS.outlier)

    def occam(self, fit: MotionFit, where: slice) -> float:
        """½ log det(1 + C G) of a curve with prior covariance C and information G [nats]."""
        prior = fit.prior_derivatives[1][where, where]
        free = np.diag(fit.information)[where] > 0
        prior, gram = prior[np.ix_(free, free)], fit.information[where, where][np.ix_(free, free)]
        return 0.5 * float(np.linalg.slogdet(prior + gram)[1] - np.linalg.slogdet(prior)[1])

    def linearised(self, model: CoarseModel) -> Linearised:
        fit = model.fit
        parts, start = self.residuals(fit), self.context.start(fit.layout)
        jacobians = [fit.point.evaluate(fit.x, moving=True).jacobian]
        if fit.held_out:
            jacobians.append(fit.judged[1])
        gradient, hessian = fit.prior_derivatives
        return Linearised(
            fit.layout,
            fit.x,
            parts,
            jacobians,
            self.floor,
            fit.information + hessian,
            (gradient, hessian),
            fit.held,
            start.bounds,
            model.likelihood,
            LIMITS.outlier,
        )

    # -- the moves

    def parts(self, model: CoarseModel) -> frozenset[ChosenEffect]:
        return frozenset(model.layout.effects)

    def gain(self, before: CoarseModel, after: CoarseModel, tried: int) -> Gain:
        new = set(after.layout.effects) - set(before.layout.effects)
        episode = bool(new) and all(map(is_episode, new))
        return gain(before.likelihood, after.likelihood, tried * (LOOP.intervals if episode else 1), episode)

    def promising(self, before: CoarseModel, after: CoarseModel) -> bool:
        found = gain(before.likelihood, after.likelihood)
        return float(found.by_joint.sum()) > 2 * np.log(self.tried)

    def impossible(self, fit: MotionFit) -> list[ChosenEffect]:
        step = self.raw_step
        return [e for e in fit.layout.effects if not credible(fit, e, step)]

    def firm(self, layout: Layout) -> set[ChosenEffect]:
        """Effects that are not dropped."""
        needed = {(EFFECTS[e.effect].beside, e.joint) for e in layout.effects}
        beside = {e for e in layout.effects if (e.effect, e.joint) in needed}
        return {
            *self.own.effects,
            *beside,
            *filter(is_curve, layout.effects),
            *self.family.offsets_of_springs(layout),
        }

    def pruned(self, model: CoarseModel) -> CoarseModel:
        for _ in range(4):
            found = eliminate(self.linearised(model), self.firm, self.impossible(model.fit), self.tried)
            if not found.dropped:
                return model
            smaller = Layout(
                model.layout.joints, tuple(e for e in model.layout.effects if e not in found.dropped)
            )
            model = self.fit(smaller, model.fit.towards(found.x, smaller))
        return model

    def above(self, model: CoarseModel) -> float:
        """How much any move may gain: all that is above the noise [nats]."""
        like = model.likelihood
        count = sum(part.used.sum(axis=0) for part in self.residuals(model.fit))
        floor = np.log((1 + LIMITS.noise_known) * self.floor)
        return float(np.sum(count * np.maximum(np.log(like.deviation) - floor, 0.0) / like.times))

    def candidates(self, model: CoarseModel) -> list[Candidate]:
        fit = model.fit
        if self.complete(model):
            return []
        wanted = candidates(fit.layout, self.context.measurements.groups, many=True)
        found = score_by_joint(
            fit.point, fit.chain, wanted, self.family.weigh(fit), fit.projection, check=lambda: self.say(""),
            longest=LOOP.longest_episode, without=set(fit.layout.effects), signatures=False,
        )  # fmt: skip
        like = model.likelihood
        most = like.samples
        out = []
        for s in found:
            joint = s.effect.joint
            time = like.times.min() if joint is None else like.times[joint]
            tried = len(found) * (LOOP.intervals if is_episode(s.effect) else 1)
            cost = 2 * np.log(tried) + 0.5 * len(EFFECTS[s.effect.effect].parameters) * np.log(most)
            law = EFFECTS[s.effect.effect]
            if law.expected and not credible(fit, s.effect, self.raw_step, s.values):
                continue
            out.append(Candidate(s.effect, joint, LOOP.reach * 0.5 * s.gain / time - cost, s))
        return out

    def with_added(self, model: CoarseModel, chosen: Sequence[Candidate]) -> CoarseModel:
        names = ", ".join(sorted({EFFECTS[c.key.effect].title for c in chosen}))
        self.say(f"adding: {names}")
        return self.model(self.family.with_candidates(model.fit, [c.content for c in chosen]))

    def swaps(self, model: CoarseModel) -> Iterable[Callable[[CoarseModel], CoarseModel]]:
        for name, law in EFFECTS.items():
            if law.replaces or law.instead_of:
                yield lambda now, name=name: self.swapped(now, name)

    def swapped(self, model: CoarseModel, name: str) -> CoarseModel:
        """The model with a law in place of another on the joints where that gains."""
        law, fit = EFFECTS[name], model.fit
        old = {
            e: ChosenEffect(name, e.joint)
            for e in fit.layout.effects
            if e.effect in (law.replaces, law.instead_of)
            and e.joint is not None
            and e not in self.own.effects
            and ChosenEffect(name, e.joint) not in fit.layout.effects
            and self.loud(model, e.joint)
        }
        if not old:
            return model
        self.say(f"trying: {law.title}")
        trial = self.exchanged(model, model, old)
        step = self.raw_step
        found = gain(model.likelihood, trial.likelihood)
        good = {
            e: to
            for e, to in old.items()
            if found.by_joint[e.joint] > 6 + LIMITS.deviations * found.errors[e.joint]
            and credible(trial.fit, to, step)
        }
        if not good:
            return model
        return self.pruned(trial if len(good) == len(old) else self.exchanged(model, trial, good))

    def loud(self, model: CoarseModel, joint: int) -> bool:
        """Whether a joint leaves more than noise."""
        return bool(model.likelihood.deviation[joint] > (1 + LIMITS.noise_known) * self.floor[joint])

    def exchanged(
        self, model: CoarseModel, values: CoarseModel, pairs: dict[ChosenEffect, ChosenEffect]
    ) -> CoarseModel:
        fit = model.fit
        springs = {e.joint for e in pairs if EFFECTS[e.effect].offset_parameter}
        offsets = {
            o.joint: o
            for o in self.family.offsets_of_springs(fit.layout) - set(self.own.effects)
            if o.joint in springs
        }
        layout = Layout(
            fit.layout.joints, tuple(pairs.get(e, e) for e in fit.layout.effects if e not in offsets.values())
        )
        x = layout.vector(values.layout.model(values.fit.x))
        for old, new in pairs.items():
            if new not in values.layout.effects:
                start = fit.x[fit.layout.effect_slice(old)]
                if old.joint in offsets:
                    torque = float(fit.x[fit.layout.effect_slice(offsets[old.joint]).start])
                    start = EFFECTS[old.effect].with_constant(start, torque)
                x[layout.effect_slice(new)] = EFFECTS[new.effect].refining(start)
        for effect, where in layout.effect_slices():
            if effect in fit.layout.effects and effect not in values.layout.effects:
                x[where] = fit.x[fit.layout.effect_slice(effect)]
        afresh = self.context.start(layout).x.copy()
        afresh[layout.effect_start :] = x[layout.effect_start :]
        fits = [self.fit(layout, start, iterations=6) for start in (x, afresh)]
        best = min(fits, key=lambda m: m.fit.objective)
        return self.fit(layout, best.fit.x) if best.fit.objective < model.fit.objective else best

    def unknowns(self, model: CoarseModel) -> Iterable[Callable[[CoarseModel], CoarseModel]]:
        taken = {e.joint for e in model.layout.effects if is_curve(e)}
        ratio = model.likelihood.deviation / self.floor
        much = self.significant(model)
        for joint in map(int, np.argsort(-ratio)[: LOOP.unknown_places]):
            if joint not in taken and much[joint]:
                yield lambda now, joint=joint: self.beside_curve(now, joint, True)

    def significant(self, model: CoarseModel) -> Array:
        """Joints whose model error is a significant share of the torque, shape (n,)."""
        like = model.likelihood
        error = np.sqrt(np.maximum(like.deviation**2 - self.floor**2, 0.0))
        return (error > LIMITS.unknown_share * self.context.spread) & (like.deviation > 2 * self.floor)

    def beside_curve(self, model: CoarseModel, joint: int, all_kept: bool) -> CoarseModel:
        """The model with the free curve of a joint that explains most, and what is needed beside it."""
        curve, promised = best_curve(model.fit, joint)
        time = model.likelihood.times[joint]
        if 0.5 * promised / time < 2 * np.log(self.tried):
            return model
        self.say(f"fitting a free curve to an unknown law on {self.own.joints[joint]}")
        kept = [
            e
            for e in model.layout.effects
            if all_kept or e.joint != joint or EFFECTS[e.effect].usual or is_curve(e) or e in self.own.effects
        ]
        layout = Layout(model.layout.joints, (*kept, curve))
        start = self.fit(layout, layout.vector(model.layout.model(model.fit.x)))
        self.family.curves = tuple(filter(is_curve, layout.effects))
        found = self.pruned(self.rich(start))
        self.family.curves = tuple(filter(is_curve, model.layout.effects))
        return found
