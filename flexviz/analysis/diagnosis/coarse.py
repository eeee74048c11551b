"""The coarse resolution: the band of the motion, each joint weighted by what the model leaves."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.candidates import (
    OFFSET,
    alternatives,
    candidates,
    offsets_of_springs,
    with_candidates,
    with_offsets_merged,
    without,
    without_effects,
)
from flexviz.analysis.diagnosis.criterion import Criterion, Gain, Residuals, criterion_of
from flexviz.analysis.diagnosis.elimination import Linearised, eliminated
from flexviz.analysis.diagnosis.fit_context import STEPS
from flexviz.analysis.diagnosis.resolution import EFFORT, LIMITS, Model, Moves, Resolution, Scoring
from flexviz.analysis.diagnosis.unknown_curve import best_curve, curve_cost, is_curve
from flexviz.analysis.estimation import Descent, ScoredCandidate, shares_alone, torque_scale
from flexviz.analysis.motion import MOTION, Known, MotionContext, MotionFit, plain_model, usual_model
from flexviz.model.effects import EFFECTS, ChosenEffect
from flexviz.model.equation import Layout

Array = NDArray[np.float64]
CoarseModel = Model[MotionFit]


class Coarse(Resolution[MotionFit]):
    """Models of one set in the band of the motion.

    Each joint is weighted by what its model leaves, and large residuals count linearly: an incomplete model
    of a real robot is judged by its own error instead of by sensors far better than it.
    """

    name = "coarse"

    def __init__(self, context: MotionContext, own: Layout, say: Callable[[str], None]) -> None:
        super().__init__(context.measurements, own, say, many=True)
        self.context = context
        self._criterion: Criterion | None = None
        self._swapped = set[tuple[frozenset[ChosenEffect], ChosenEffect, ChosenEffect]]()  # rivals tried
        self._worse = set[tuple[ChosenEffect, ChosenEffect]]()  # rivals that were far worse
        self._refused = dict[Hashable, float]()  # candidates and joints, and what they promised
        self.in_start = dict[ChosenEffect, Gain]()  # of what acts in first movements alone

    @property
    def criterion(self) -> Criterion:
        """Of the recording, by the set's own model."""
        if self._criterion is None:
            self.begin()
        assert self._criterion is not None
        return self._criterion

    def begin(self) -> CoarseModel:
        """The set's own model, from which on J is measured, of the samples that count by now."""
        fit = self.context.fit(self.own, self.context.start(self.own).x, check=self.check)
        return self.measured_by(fit, self.criterion_by(fit))

    def criterion_by(self, fit: MotionFit) -> Criterion:
        """The criterion of the recording, by the residuals of a model."""
        return criterion_of(self.residuals(fit), self.context.least, self.choices, MOTION.outlier)

    def measured_by(self, fit: MotionFit, criterion: Criterion) -> CoarseModel:
        """The model of a fit, from which on J is measured by a criterion."""
        self._criterion = criterion
        count = np.sum([used.sum(axis=0) for used in self.context.used], axis=0)
        self.settled = criterion.settled(float(count.sum()))
        self.independent = criterion.samples / np.maximum(count, 1)  # share of the samples, (n,)
        return self.model(fit)

    def renewed(self, model: CoarseModel) -> CoarseModel | None:
        """The model with J measured by it; None if its errors are hardly more independent than before.

        What is left after large slow errors are explained is faster, so that more of it is evidence.
        """
        before, now = self.criterion, self.criterion_by(model.fit)
        more = (now.samples > EFFORT.again * before.samples) & (model.score.deviation > before.least)
        if not more.any():
            return None
        known = {joint for joint in range(self.own.n) if not more[joint]}
        self._refused = {k: v for k, v in self._refused.items() if getattr(k, "joint", k) in known}
        self._swapped = {one for one in self._swapped if one[1].joint in known}
        samples = np.maximum(now.samples, before.samples)
        return self.measured_by(model.fit, replace(now, samples=samples))

    # -- fits

    def fit(self, layout: Layout, x: Array, iterations: int = STEPS) -> CoarseModel:
        """A model fitted from x, shape (P,)."""
        return self.model(self.context.fit(layout, x, iterations=iterations, check=self.check))

    def tried(self, start: Known, lowest: float = np.inf) -> CoarseModel | None:
        """A model fitted as closely as its J needs; None once it cannot come near the `lowest` objective."""
        nats = self.settled / LIMITS.settled  # an effect's cost in units of the objective
        hopeless = lowest + nats * self.criterion.cost(1, 1)

        def watch(descent: Descent[MotionFit]) -> bool:
            # a step of length l promises a decrease of l² where the model is nearly linear
            promised = EFFORT.reach * descent.length**2
            return descent.steps >= EFFORT.first_steps and descent.place.objective - promised > hopeless

        fit = self.context.fit(start.layout, start.x, check=self.check, settled=self.settled, watch=watch)
        return None if fit.ended else self.model(fit)

    def refit(self, model: CoarseModel, layout: Layout, x: Array) -> CoarseModel:
        return self.fit(layout, x)

    def model(self, fit: MotionFit) -> CoarseModel:
        """A fit with its score."""
        scale, cost = torque_scale(fit.layout, fit.x), self.cost(fit.layout)
        for effect, where in fit.layout.effect_slices():
            if is_curve(effect):
                cost += curve_cost(fit, where)
            cost += EFFECTS[effect.effect].surprise(fit.x[where])
        return Model(fit, self.criterion.score(self.residuals(fit), cost, scale, self.cut_off(fit)))

    def cut_off(self, fit: MotionFit) -> tuple[Array, Array] | None:
        """Shares of samples whose torque exceeds a limit of the model, and its deviation, (n,) each."""
        share, torque = np.zeros(self.own.n), np.abs(self.context.signals.tau[0])
        for effect, where in fit.layout.effect_slices():
            if EFFECTS[effect.effect].limits_torque and (limit := fit.x[where.start]) > 0:
                share[effect.place.own_joint] = np.mean(torque[:, effect.place.own_joint] > limit)
        return (share, self.context.spread) if share.any() else None

    def rich(self) -> CoarseModel:
        """Every usual effect on every joint."""
        usual = usual_model(self.context, self.own)
        return self.fit(usual.layout, usual.x)

    def towards(self, model: CoarseModel, x: Array, smaller: Layout) -> Array:
        return model.fit.towards(x, smaller)

    def without(self, model: CoarseModel, effect: ChosenEffect) -> CoarseModel:
        """The model without an effect, fitted; the torque of a spring's rest angle stays as an offset."""
        start = without_effects(model.fit, [effect])
        layout, offset = start.layout, ChosenEffect(OFFSET, effect.joint)
        if EFFECTS[effect.effect].offset_parameter and offset not in {*layout.effects, *self.banned}:
            layout = layout.with_effects((*layout.effects, offset))
        return self.fit(layout, layout.vector(start.layout.model(start.x)))

    def with_rest_angles(self, model: CoarseModel) -> CoarseModel:
        """The model with torque offsets on a joint with a spring turned into the spring's rest angle."""
        merged = with_offsets_merged(model.fit, self.own)
        return model if merged.layout == model.layout else self.fit(merged.layout, merged.x)

    def residuals(self, fit: MotionFit) -> list[Residuals]:
        context = self.context
        return [
            Residuals(r, used, [b.rows for b in s.blocks], u)
            for r, u, used, s in zip(*fit.judged, context.used, context.parts, strict=True)
        ]

    def linearised(self, model: CoarseModel) -> Linearised:
        fit = model.fit
        gradient, hessian = fit.prior_derivatives
        return Linearised(
            fit.layout, fit.x, self.residuals(fit), fit.jacobians(), fit.information + hessian,
            (gradient, hessian), fit.held, self.context.start(fit.layout).bounds,
        )  # fmt: skip

    def scoring(self, fit: MotionFit) -> Scoring:
        return Scoring(fit.point, fit.chain, fit.weigh, fit.projection)

    def significant(self, model: CoarseModel) -> NDArray[np.bool_]:
        """Joints whose model errs by more than noise and tolerance, shape (n,)."""
        return model.score.deviation > self.criterion.least * (1 + MOTION.noise_known)

    def near(self, model: CoarseModel) -> bool:
        """Whether what a model leaves may be due to reversals and gaps, hardly resolved here."""
        return bool(np.all(model.score.deviation < MOTION.far * self.criterion.least))

    def smaller(
        self, model: CoarseModel, among: Collection[ChosenEffect] | None = None
    ) -> Iterator[CoarseModel]:
        for curve in filter(is_curve, model.layout.effects):
            yield self.without(model, curve)
        yield from super().smaller(model, among)

    def firm(self, layout: Layout) -> set[ChosenEffect]:
        return {*super().firm(layout), *filter(is_curve, layout.effects), *offsets_of_springs(layout)}

    def alone(self, model: CoarseModel, joint: int | None) -> dict[str, float]:
        """Effect → share of its joint's error that it alone would remove; `joint`: None for all others."""
        fit = model.fit
        wanted = [e for e in candidates(fit.layout, self.measurements.groups, self.many) if e.joint == joint]
        found = shares_alone(fit.point, fit.chain, wanted, fit.weigh, fit.projection)
        return {e.text(self.own.joints): share for e, share in found.items()}

    # -- moves

    @property
    def stages(self) -> dict[str, Callable[[CoarseModel], Moves[MotionFit]]]:
        return {"add": self.larger, "swap": self.rivals, "episode": self.episodes, "unknown": self.unknowns}

    def larger(self, model: CoarseModel) -> Iterator[tuple[Hashable, CoarseModel]]:
        """On each joint its best-scored effects and its plain model; those of no joint."""
        fit, loud = model.fit, self.loud(model)
        if not loud.any():
            return
        wanted = [e for e in self.wanted(fit.layout) if e.joint is None or loud[e.joint]]
        scored = [s for s in self.scores(fit, wanted) if self.promising(model, s.effect, s.gain)]
        for joint in [*np.flatnonzero(loud).tolist(), None]:
            for other in self.of_place(model, joint, [s for s in scored if s.effect.joint == joint]):
                yield joint, other

    def of_place(
        self, model: CoarseModel, joint: int | None, scored: list[ScoredCandidate]
    ) -> Iterator[CoarseModel]:
        """Best-scored effects of a place, sensing errors and its plain model, until nothing is left there."""
        sensing = [s for s in scored[EFFORT.best :] if EFFECTS[s.effect.effect].where == "sensing"]
        lowest = np.inf
        for s in [*scored[: EFFORT.best], *sensing]:
            if s.gain < EFFORT.again * self._refused.get(s.effect, 0.0):
                continue
            self.say(f"trying: {EFFECTS[s.effect.effect].title}")
            other = self.tried(with_candidates(model.fit, [s]), lowest)
            if other is None or self.doubtful(other, model.layout):
                continue
            self.remember(s.effect, s.gain, model, other)
            lowest = min(lowest, other.fit.objective)
            yield other
            if joint is not None and not self.loud(other)[joint]:
                return
        above = 0.0 if joint is None else float(self.above(model)[joint])
        if joint is None or above < EFFORT.again * self._refused.get(joint, 0.0):
            return
        plain = plain_model(self.context, model.fit, joint, self.banned)
        if plain is not None and (rich := self.tried(plain, lowest)) is not None:
            other = self.pruned_of(rich, model.layout)
            self.remember(joint, above, model, other)
            if not self.doubtful(other, model.layout):
                yield other

    def remember(self, key: Hashable, promise: float, before: CoarseModel, after: CoarseModel) -> None:
        """Keep what a refused trial promised: it is not tried again until it promises clearly more."""
        if after.score.total >= before.score.total:
            self._refused[key] = promise

    def pruned_of(self, model: CoarseModel, firm: Layout) -> CoarseModel:
        """The model without effects that it does not need, but for those of another one."""
        among = set(model.layout.effects) - set(firm.effects) - offsets_of_springs(model.layout)
        gone, x = eliminated(self.linearised(model), model.score, self, among)
        if not gone:
            return model
        smaller = without(model.layout, gone)
        return self.tried(Known(smaller, self.towards(model, x, smaller))) or model

    def promising(self, model: CoarseModel, effect: ChosenEffect, gained: float) -> bool:
        """Whether an effect may lower J, by the decrease of the weighted squares that its score promises."""
        if EFFECTS[effect.effect].underrated:
            return True
        share = self.independent[slice(None) if effect.joint is None else effect.joint]
        return EFFORT.reach * 0.5 * gained * float(np.max(share)) > self.cost_of(effect)

    def united(self, model: CoarseModel, others: list[CoarseModel]) -> CoarseModel:
        """The model with what others have more, or instead."""
        have, fit = set(model.layout.effects), model.fit
        gone = {e for other in others for e in have - set(other.layout.effects)}
        kept = [e for e in model.layout.effects if e not in gone]
        added = {e: other for other in others for e in other.layout.effects if e not in have}
        layout = fit.layout.with_effects((*kept, *added))
        x = layout.vector(fit.layout.model(fit.x))
        for effect, other in added.items():
            x[layout.effect_slice(effect)] = other.fit.x[other.layout.effect_slice(effect)]
        larger = self.fit(layout, x)
        while doubtful := self.doubtful(larger, model.layout):
            start = without_effects(larger.fit, doubtful)
            larger = self.fit(start.layout, start.x)
        return larger

    def episodes(self, model: CoarseModel) -> Iterator[tuple[Hashable, CoarseModel]]:
        """An episode on each joint: of the right size and length, it explains a part of anything."""
        loud = self.loud(model)
        for s in self.scores(model.fit, [], episodes=True) if loud.any() else ():
            if loud[s.effect.place.own_joint] and self.promising(model, s.effect, s.gain):
                start = with_candidates(model.fit, [s])
                other = self.fit(start.layout, start.x)
                if not self.doubtful(other, model.layout):
                    yield s.effect.joint, other

    def rivals(self, model: CoarseModel) -> Iterator[tuple[Hashable, CoarseModel]]:
        """Effects exchanged for others of their family, or for those that they refine or are mistaken for."""
        own, have = set(self.own.effects), set(model.layout.effects)
        needed = {(EFFECTS[e.effect].beside, e.joint): e for e in have - own}
        for effect in model.layout.effects:
            others = [ChosenEffect(name, effect.joint) for name in alternatives(effect.effect)]
            others = [e for e in others if e not in have | self.banned and self.own.can_have(e)]
            if effect in own or effect.joint is None or is_curve(effect) or not others:
                continue
            gone = {effect, needed.get((effect.effect, effect.joint), effect)}
            here = frozenset(e for e in have if e.joint == effect.joint)
            others = [e for e in others if (here, effect, e) not in self._swapped]
            others = [e for e in others if (effect, e) not in self._worse]
            self._swapped.update((here, effect, e) for e in others)
            if not others:
                continue
            start = without_effects(model.fit, gone)
            there = self.fit(start.layout, start.x, iterations=0)
            ranked = self.scores(there.fit, [effect, *others])
            mine = next((s.gain for s in ranked if s.effect == effect), 0.0)
            for s in [s for s in ranked if s.effect != effect and s.gain > EFFORT.close * mine]:
                self.say(f"trying: {EFFECTS[s.effect.effect].title}")
                other = self.tried(with_candidates(there.fit, [s]), model.fit.objective)
                far = EFFORT.reach * self.cost_of(s.effect)
                if other is None or other.score.total > model.score.total + far:
                    self._worse.add((effect, s.effect))
                elif not self.doubtful(other, model.layout):
                    yield effect.joint, other
        for name, law in EFFECTS.items():
            for joint in range(self.own.n) if law.merges else ():
                if {ChosenEffect(part, joint) for part in law.merges} <= have - own:
                    yield joint, self.merged(model, ChosenEffect(name, joint))

    def merged(self, model: CoarseModel, new: ChosenEffect) -> CoarseModel:
        """The model with an effect in place of those that it merges."""
        law, fit = EFFECTS[new.effect], model.fit
        gone = {name: ChosenEffect(name, new.joint) for name in law.merges}
        layout = without(fit.layout, gone.values())
        layout = layout.with_effects((*layout.effects, new))
        x = layout.vector(fit.layout.model(fit.x))
        values = {name: fit.x[fit.layout.effect_slice(e)] for name, e in gone.items()}
        x[layout.effect_slice(new)] = law.merged(values)
        return self.fit(layout, x)

    def gains(self, model: CoarseModel) -> dict[ChosenEffect, Gain]:
        return super().gains(model) | self.in_start

    # -- unknown laws

    def unknowns(self, model: CoarseModel) -> Iterator[tuple[Hashable, CoarseModel]]:
        """A free curve on a joint with a significant model error, the largest first."""
        taken = {e.joint for e in model.layout.effects if is_curve(e)}
        much = self.significant(model)
        order = map(int, np.argsort(-model.score.deviation / self.criterion.least))
        joints = [j for j in order if much[j] and j not in taken]
        for joint in joints[: EFFORT.unknown_places]:
            self.say(f"fitting a free curve to an unknown law on {self.own.joints[joint]}")
            curve, _ = best_curve(model.fit, joint)
            layout = model.layout.with_effects((*model.layout.effects, curve))
            yield joint, self.fit(layout, layout.vector(model.layout.model(model.fit.x)))
