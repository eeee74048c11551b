"""The fine resolution: all of the band, in units of the propagated measurement noise."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.candidates import (
    candidates,
    credible,
    excess,
    is_episode,
    with_effects,
    without_effects,
)
from flexviz.diagnosis.criterion import Likelihood, Residuals, half_seconds, likelihood
from flexviz.diagnosis.elimination import Linearised
from flexviz.diagnosis.fit_context import STEPS, Fit, FitContext
from flexviz.diagnosis.prediction_errors import Known
from flexviz.diagnosis.resolution import EFFORT, Model, Resolution, Scoring
from flexviz.diagnosis.search import Candidate
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import Chain, Layout
from flexviz.estimation import Point, ScoredCandidate

Array = NDArray[np.float64]
FineModel = Model[Fit]

# mean excess, and that of one joint, which a right model may leave: without reversals of friction, and with
TOLERATED = (0.4, 1.0), (1.5, 2.5)
TRACE = 1e-6  # of the excess without the effects


class Fine(Resolution[Fit]):
    """Models of one set in units of the noise.

    The residual of the whole band is whitened by the noise of θ and τ propagated through filter and equation,
    so that a complete model leaves unit variance and small effects show.
    """

    name = "fine"

    def __init__(self, context: FitContext, own: Layout, say: Callable[[str], None]) -> None:
        super().__init__(context.measurements, own, say, many=False)
        self.context, self.noise = context, np.ones(own.n)

    # -- fits

    def fit(self, layout: Layout, x: Array, iterations: int = STEPS, near: Fit | None = None) -> FineModel:
        """A model fitted from x, shape (P,); `near`: a fit whose whiteners can be reused."""
        return self.model(self.context.fit(layout, x, iterations=iterations, check=self.check, near=near))

    def refit(self, model: FineModel, layout: Layout, x: Array) -> FineModel:
        return self.fit(layout, x, near=model.fit)

    def model(self, fit: Fit) -> FineModel:
        """A fit with its likelihood."""
        pulses = sum(sum(w.log_determinant for w in p.weightings) + p.transients for p in _points(fit))
        prior, freedom = self.context.start(fit.layout).prior, fit.layout.size - fit.layout.effect_start
        found = likelihood(self.residuals(fit), self.floor, prior.value(fit.x) + 0.5 * pulses, freedom)
        return Model(fit, self.judged(found, prior, fit.x))

    def towards(self, model: FineModel, x: Array, smaller: Layout) -> Array:
        start = smaller.vector(model.layout.model(x))
        feasible = self.context.start(smaller).prior.feasible(start)
        return start if feasible else smaller.vector(model.layout.model(model.fit.x))

    # -- likelihood

    def residuals(self, fit: Fit) -> list[Residuals]:
        return list(map(_residuals, _points(fit)))

    def linearised(self, model: FineModel) -> Linearised:
        fit, start = model.fit, self.context.start(model.layout)
        flat = fit.point.z.reshape(-1, fit.layout.size)
        gradient, hessian = start.prior.gradient_and_hessian(fit.x)
        held = (fit.x <= start.bounds.lower) | (fit.x >= start.bounds.upper)
        held[: fit.layout.effect_start] = False
        return Linearised(
            fit.layout, fit.x, self.residuals(fit), [p.z for p in _points(fit)], self.floor,
            flat.T @ flat + hessian, (gradient, hessian), held, start.bounds, model.likelihood, np.inf,
        )  # fmt: skip

    def scoring(self, fit: Fit) -> Scoring:
        point = fit.point
        narrow = self.context.two_band.with_layout(fit.layout).narrow.at(fit.x)
        lay = fit.layout
        chain = Chain(fit.x[lay.compliance], fit.x[lay.link_viscous], point.link)
        return Scoring(narrow, chain, point.weigh, self.context.projection(fit))

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

    # -- moves

    def rivalry(self, effect: ChosenEffect) -> object:
        """One at a time; those whose scores mean little are tried anyway."""
        return effect if EFFECTS[effect.effect].underrated else None

    def with_added(self, model: FineModel, chosen: Sequence[Candidate]) -> FineModel:
        """The model with a candidate from the best of its starts; not with several at once."""
        if len(chosen) > 1:
            return model
        scored: ScoredCandidate = chosen[0].content
        self.say(f"testing candidate: {EFFECTS[scored.effect.effect].title}")
        trials = [
            self.fit(at.layout, at.x, EFFORT.first_look, model.fit) for at in self.starts(model.fit, scored)
        ]
        best = min(trials, key=lambda m: m.fit.objective)
        if best.fit.converged or not self.promising(model, best):
            return best
        return self.fit(best.layout, best.fit.x, STEPS, best.fit)

    def units(self, like: Likelihood) -> Array:
        return like.deviation**2

    def starts(self, fit: Fit, scored: ScoredCandidate) -> list[Known]:
        """The model with one more effect: at its score's values, and at those that the effect provides.

        A stiffness that has absorbed part of an elastic effect hides it from the score, and a wrong friction
        of the link does the same to friction that depends on the load.
        """
        first = with_effects(fit, {scored.effect: scored.values})
        law, joint, found = EFFECTS[scored.effect.effect], scored.effect.joint, [first]
        if not law.underrated or joint is None:
            return found
        compliance = float(fit.x[fit.layout.compliance][joint])
        rough = float(self.context.start(fit.layout).x[fit.layout.compliance][joint])
        for hidden in law.hidden_starts(fit.point.torque[:, joint], compliance, rough):
            x = first.x.copy()
            x[first.layout.effect_slices()[-1][1]] = hidden.values
            x[first.layout.compliance.start + joint] = hidden.compliance
            found.append(Known(first.layout, x))
        return found

    def swaps(self, model: FineModel) -> Iterable[Callable[[FineModel], FineModel]]:
        """Each effect exchanged for a rival; a complete model leaves nothing that one could gain."""
        if self.at_noise(model) or self.complete(model):
            return []
        firm, loud = self.firm(model.layout), self.loud(model)
        return [
            partial(self.swapped, effect=e)
            for e in model.layout.effects
            if e not in firm and (e.joint is None or loud[e.joint])
        ]

    def swapped(self, model: FineModel, effect: ChosenEffect) -> FineModel:
        """The model with the best rival in place of an effect."""
        start = without_effects(model.fit, [effect])
        there = self.fit(start.layout, start.x, 0, model.fit)
        wanted = candidates(start.layout, self.measurements.groups)
        ranked = self.scores(there.fit, wanted, is_episode(effect))
        mine = next((s.gain for s in ranked if s.effect == effect), 0.0)
        others = [s for s in ranked if s.effect != effect]
        rivals = [s for s in others if s.gain > mine / EFFORT.reach][: EFFORT.singles]
        hidden = [s for s in others if s.effect.joint == effect.joint and EFFECTS[s.effect.effect].underrated]
        best = model
        for s in [*rivals, *(s for s in hidden if s not in rivals)]:
            at = with_effects(there.fit, {s.effect: s.values})
            found = self.fit(at.layout, at.x, STEPS, model.fit)
            if credible(found.fit, s.effect, self.raw_step) and self.gain(best, found, 0).accepted:
                best = found
        return best

    def unknowns(self, model: FineModel) -> Iterable[Callable[[FineModel], FineModel]]:
        """None: what is unknown has been found at the coarse resolution, or its place is looked for."""
        return ()


def _points(fit: Fit) -> list[Point]:
    return [point for point in (fit.point, fit.held_out) if point is not None]


def _residuals(point: Point) -> Residuals:
    blocks = point.two_band.blocks
    used = np.broadcast_to(point.used[:, None], point.r.shape)
    return Residuals(point.r, used, half_seconds(blocks), [b.rows for b in blocks])
