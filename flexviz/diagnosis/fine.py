"""The fine resolution: all of the band, in units of the propagated measurement noise."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.acceptance import credible, excess
from flexviz.diagnosis.candidates import ModelStart, candidates, is_episode, with_effect, without_effect
from flexviz.diagnosis.criterion import Gain, Likelihood, Residuals, gain, half_seconds, likelihood
from flexviz.diagnosis.elimination import Linearised, eliminate
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.scoring import score_by_joint
from flexviz.diagnosis.search import Candidate
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import Layout
from flexviz.estimation import Point, ScoredCandidate

Array = NDArray[np.float64]
# mean excess, and that of one joint, which a right model may leave: without reversals of friction, and with
TOLERATED = (0.4, 1.0), (1.5, 2.5)
TRACE = 1e-6  # of the excess without the effects
LIMITS, LOOP = THRESHOLDS.criterion, THRESHOLDS.search


@dataclass(frozen=True, eq=False)
class FineModel:
    """A fitted model with its likelihood."""

    fit: Fit
    likelihood: Likelihood

    @property
    def layout(self) -> Layout:
        return self.fit.layout


class Fine:
    """Models of one set at the fine resolution, a `Problem` of the search."""

    name = "fine"

    def __init__(self, context: FitContext, own: Layout, say: Callable[[str], None]) -> None:
        self.context, self.own, self.say = context, own, say
        groups = context.measurements.groups
        self.raw_step = max(s.step for g in context.fit_groups for s in g.segments)
        self.tried = len(candidates(own, groups)) + own.n * len(groups)

    def check(self) -> None:
        self.say("")

    def fit(self, layout: Layout, x: Array, iterations: int = 12, near: Fit | None = None) -> FineModel:
        return self.model(self.context.fit(layout, x, iterations=iterations, check=self.check, near=near))

    def model(self, fit: Fit) -> FineModel:
        prior = self.context.start(fit.layout).prior
        points = [p for p in (fit.point, fit.held_out) if p is not None]
        pulses = sum(sum(w.log_determinant for w in p.weightings) + p.transients for p in points)
        other = prior.value(fit.x) + 0.5 * pulses
        floor = np.full(fit.layout.n, 1 + LIMITS.noise_known)
        freedom = fit.layout.size - fit.layout.effect_start
        return FineModel(fit, likelihood([_residuals(p) for p in points], floor, other, freedom))

    def complete(self, model: FineModel) -> bool:
        """Whether a model leaves no more than noise, and what its laws are known to leave.

        Torques at reversals are only roughly known, and no law is exact: each leaves a trace of what it
        explains.
        """
        fit = model.fit
        mean, joint = TOLERATED[fit.layout.has_reversals]
        trace = TRACE * excess(self.context.without_effects(fit))
        above = np.maximum(np.stack((fit.chi, fit.chi_held_out)) - 1.0, 0.0)
        return excess(fit) < mean + trace and float(np.nanmean(above, axis=0).max()) < joint + trace

    def linearised(self, model: FineModel) -> Linearised:
        fit = model.fit
        points = [p for p in (fit.point, fit.held_out) if p is not None]
        start = self.context.start(fit.layout)
        flat = fit.point.z.reshape(-1, fit.layout.size)
        gradient, hessian = start.prior.gradient_and_hessian(fit.x)
        held = np.zeros(fit.layout.size, bool)
        bounds = start.bounds
        at = (fit.x <= bounds.lower) | (fit.x >= bounds.upper)
        held[fit.layout.effect_start :] = at[fit.layout.effect_start :]
        return Linearised(
            fit.layout, fit.x, [_residuals(p) for p in points], [p.z for p in points],
            np.full(fit.layout.n, 1 + LIMITS.noise_known), flat.T @ flat + hessian, (gradient, hessian), held,
            bounds, model.likelihood, np.inf,
        )  # fmt: skip

    # -- the moves

    def parts(self, model: FineModel) -> frozenset[ChosenEffect]:
        return frozenset(model.layout.effects)

    def gain(self, before: FineModel, after: FineModel, tried: int) -> Gain:
        new = set(after.layout.effects) - set(before.layout.effects)
        episode = bool(new) and all(map(is_episode, new))
        return gain(before.likelihood, after.likelihood, tried * (LOOP.intervals if episode else 1), episode)

    def promising(self, before: FineModel, after: FineModel) -> bool:
        found = gain(before.likelihood, after.likelihood)
        return float(found.by_joint.sum()) > 2 * np.log(self.tried)

    def impossible(self, fit: Fit) -> list[ChosenEffect]:
        return [e for e in fit.layout.effects if not credible(fit, e, self.raw_step)]

    def firm(self, layout: Layout) -> set[ChosenEffect]:
        needed = {(EFFECTS[e.effect].beside, e.joint) for e in layout.effects}
        return {*self.own.effects, *(e for e in layout.effects if (e.effect, e.joint) in needed)}

    def pruned(self, model: FineModel) -> FineModel:
        for _ in range(4):
            found = eliminate(self.linearised(model), self.firm, self.impossible(model.fit), self.tried)
            if not found.dropped:
                return model
            smaller = Layout(
                model.layout.joints, tuple(e for e in model.layout.effects if e not in found.dropped)
            )
            x = smaller.vector(model.layout.model(found.x))
            if not self.context.start(smaller).prior.feasible(x):
                x = smaller.vector(model.layout.model(model.fit.x))
            model = self.fit(smaller, x, near=model.fit)
        return model

    def above(self, model: FineModel) -> float:
        """How much any move may gain: all that is above the noise [nats]."""
        like = model.likelihood
        floor = np.log(1 + LIMITS.noise_known)
        count = sum(part.used.sum(axis=0) for part in map(_residuals, self._points(model)))
        return float(np.sum(count * np.maximum(np.log(like.deviation) - floor, 0.0) / like.times))

    def _points(self, model: FineModel) -> list[Point]:
        return [p for p in (model.fit.point, model.fit.held_out) if p is not None]

    def weigh(self, fit: Fit) -> Callable[[Array, int], Array]:
        point, blocks = fit.point, self.context.two_band.blocks

        def weigh(columns: Array, block: int) -> Array:
            out = point.weightings[block].apply(columns)
            out[~point.used[blocks[block].rows]] = 0.0
            return out.reshape(-1, columns.shape[2])

        return weigh

    def scores(
        self, fit: Fit, wanted: Sequence[ChosenEffect], episodes: bool = True
    ) -> list[ScoredCandidate]:
        narrow = self.context.two_band.with_layout(fit.layout).narrow.at(fit.x)
        return score_by_joint(
            narrow, self.context.chain(fit), wanted, self.weigh(fit), self.context.projection(fit), check=self.check,
            longest=LOOP.longest_episode if episodes else None, without=fit.layout.effects, signatures=False,
        )  # fmt: skip

    def candidates(self, model: FineModel) -> list[Candidate]:
        like = model.likelihood
        least = 2 * np.log(self.tried)
        if self.above(model) < least:
            return []
        fit = model.fit
        wanted = candidates(fit.layout, self.context.measurements.groups)
        found = self.scores(fit, wanted)
        known = {s.effect for s in found}
        out = []
        for s in found:
            law = EFFECTS[s.effect.effect]
            time = like.times.min() if s.effect.joint is None else like.times[s.effect.joint]
            tried = len(found) * (LOOP.intervals if is_episode(s.effect) else 1)
            cost = 2 * np.log(tried) + 0.5 * len(law.parameters) * np.log(like.samples)
            out.append(
                Candidate(
                    s.effect,
                    s.effect if law.underrated else "rated",
                    LOOP.reach * 0.5 * s.gain / time - cost,
                    s,
                )
            )
        return out

    def with_added(self, model: FineModel, chosen: Sequence[Candidate]) -> FineModel:
        if len(chosen) > 1:
            return model
        (candidate,) = chosen
        s = candidate.content
        self.say(f"testing candidate: {EFFECTS[s.effect.effect].title}")
        tries = [self.fit(at.layout, at.x, 4, model.fit) for at in self.starts(model.fit, s)]
        best = min(tries, key=lambda m: m.fit.objective)
        return best if best.fit.converged else self.fit(best.layout, best.fit.x, 14, best.fit)

    def starts(self, fit: Fit, scored: ScoredCandidate) -> list[ModelStart]:
        """The model with one more effect: at its score's values, and at those that the effect provides.

        A stiffness that has absorbed part of an elastic effect hides it from the score, and a wrong friction
        of the link does the same to friction that depends on the load.
        """
        first = with_effect(fit.layout, fit.x, scored.effect, scored.values)
        law, joint, found = EFFECTS[scored.effect.effect], scored.effect.joint, [first]
        if not law.underrated or joint is None:
            return found
        compliance = float(fit.x[fit.layout.compliance][joint])
        rough = float(self.context.rough_compliance[joint])
        for hidden in law.hidden_starts(fit.point.torque[:, joint], compliance, rough):
            x = first.x.copy()
            x[first.layout.effect_slices()[-1][1]] = hidden.values
            x[first.layout.compliance.start + joint] = hidden.compliance
            found.append(ModelStart(first.layout, x))
        return found

    def swaps(self, model: FineModel) -> Iterable[Callable[[FineModel], FineModel]]:
        for effect in model.layout.effects:
            if effect not in self.own.effects:
                yield partial(self.swapped, effect=effect)

    def swapped(self, model: FineModel, effect: ChosenEffect) -> FineModel:
        """The model with the best rival in place of an effect."""
        if effect not in model.layout.effects or effect not in self.droppable(model.layout):
            return model
        if self.above(model) < 2 * np.log(self.tried):
            return model
        start = without_effect(model.layout, model.fit.x, effect)
        there = self.fit(start.layout, start.x, 0, model.fit)
        ranked = self.scores(
            there.fit, candidates(start.layout, self.context.measurements.groups), is_episode(effect)
        )
        mine = next((s.gain for s in ranked if s.effect == effect), 0.0)
        rivals = [s for s in ranked if s.effect != effect and s.gain > 0.5 * mine][: LOOP.singles]
        rivals += [
            s
            for s in ranked
            if s.effect.joint == effect.joint
            and EFFECTS[s.effect.effect].underrated
            and s not in rivals
            and s.effect != effect
        ][:2]
        best = model
        for s in rivals:
            at = with_effect(there.layout, there.fit.x, s.effect, s.values)
            found = self.fit(at.layout, at.x, 12, model.fit)
            if credible(found.fit, s.effect, self.raw_step) and self.gain(best, found, 1).accepted:
                best = found
        return best

    def droppable(self, layout: Layout) -> set[ChosenEffect]:
        return set(layout.effects) - self.firm(layout)

    def unknowns(self, model: FineModel) -> Iterable[Callable[[FineModel], FineModel]]:
        return ()


def _residuals(point: Point) -> Residuals:
    blocks = point.two_band.blocks
    used = np.broadcast_to(point.used[:, None], point.r.shape)
    return Residuals(point.r, used, half_seconds(blocks), [b.rows for b in blocks])
