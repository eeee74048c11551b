"""The fine resolution: all of the band, in units of the propagated measurement noise."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.candidates import is_episode, with_effects
from flexviz.analysis.diagnosis.criterion import Criterion, Residuals, criterion_of
from flexviz.analysis.diagnosis.elimination import Linearised
from flexviz.analysis.diagnosis.fit_context import STEPS, Fit, FitContext
from flexviz.analysis.diagnosis.resolution import EFFORT, LIMITS, Model, Moves, Resolution, Scoring
from flexviz.analysis.estimation import Point, ScoredCandidate, torque_scale
from flexviz.analysis.motion import MOTION, Known
from flexviz.model.effects import EFFECTS
from flexviz.model.equation import Chain, Layout

Array = NDArray[np.float64]
FineModel = Model[Fit]


class Fine(Resolution[Fit]):
    """Models of one set in units of the noise.

    The residual of the whole band is whitened by the noise of θ and τ propagated through filter and equation,
    so that a complete model leaves unit variance and small effects show. No law is exact: each leaves a trace
    of what it explains, below which nothing counts.
    """

    name = "fine"

    def __init__(self, context: FitContext, own: Layout, say: Callable[[str], None]) -> None:
        super().__init__(context.measurements, own, say, many=False)
        self.context = context
        self._criterion: Criterion | None = None
        self.settled = 0.0  # change of an objective that ends a trial

    @property
    def criterion(self) -> Criterion:
        """Of the recording, by the model from which the search begins."""
        assert self._criterion is not None, "the search has not begun"
        return self._criterion

    def begin(self, layout: Layout, x: Array, iterations: int = STEPS) -> FineModel:
        """The model from which on J is measured."""
        fit = self.context.fit(layout, x, iterations=iterations, check=self.check)
        bare = self.context.without_effects(fit)
        explained = np.mean(self.residuals(bare)[0].values ** 2, axis=0)
        least = (1 + MOTION.noise_known) * np.sqrt(1 + LIMITS.exactness**2 * explained)
        parts = self.residuals(fit)
        self._criterion = criterion_of(parts, least, self.choices)
        self.settled = self._criterion.settled(sum(float(part.used.sum()) for part in parts))
        return self.model(fit)

    # -- fits

    def fit(self, layout: Layout, x: Array, iterations: int = STEPS, near: Fit | None = None) -> FineModel:
        """A model fitted from x, shape (P,); `near`: a fit whose whiteners can be reused."""
        return self.model(self.context.fit(layout, x, iterations=iterations, check=self.check, near=near))

    def refit(self, model: FineModel, layout: Layout, x: Array) -> FineModel:
        return self.fit(layout, x, near=model.fit)

    def model(self, fit: Fit) -> FineModel:
        """A fit with its score; unknown pulses cost what they explain on average."""
        pulses = sum(sum(w.log_determinant for w in p.weightings) + p.transients for p in _points(fit))
        cost = self.cost(fit.layout) + 0.5 * pulses
        cost += sum(EFFECTS[e.effect].surprise(fit.x[where]) for e, where in fit.layout.effect_slices())
        return Model(fit, self.criterion.score(self.residuals(fit), cost, torque_scale(fit.layout, fit.x)))

    def towards(self, model: FineModel, x: Array, smaller: Layout) -> Array:
        start = smaller.vector(model.layout.model(x))
        feasible = self.context.start(smaller).prior.feasible(start)
        return start if feasible else smaller.vector(model.layout.model(model.fit.x))

    def residuals(self, fit: Fit) -> list[Residuals]:
        return list(map(_residuals, _points(fit)))

    def linearised(self, model: FineModel) -> Linearised:
        fit, start = model.fit, self.context.start(model.layout)
        flat = fit.point.z.reshape(-1, fit.layout.size)
        gradient, hessian = start.prior.gradient_and_hessian(fit.x)
        held = (fit.x <= start.bounds.lower) | (fit.x >= start.bounds.upper)
        held[: fit.layout.effect_start] = False
        return Linearised(
            fit.layout, fit.x, self.residuals(fit), [p.z for p in _points(fit)],
            flat.T @ flat + hessian, (gradient, hessian), held, start.bounds,
        )  # fmt: skip

    def scoring(self, fit: Fit) -> Scoring:
        point = fit.point
        narrow = self.context.two_band.with_layout(fit.layout).narrow.at(fit.x)
        lay = fit.layout
        chain = Chain(fit.x[lay.compliance], fit.x[lay.link_viscous], point.link)
        return Scoring(narrow, chain, point.weigh, self.context.projection(fit))

    def errs(self, model: FineModel, noise: Array, least: Array) -> bool:
        """Whether a model leaves more above the `noise` (n,) than counts, `least` (n,), on any joint [Nm]."""
        above = np.maximum(model.score.deviation**2 - self.criterion.least**2, 0.0)
        return bool(np.any(np.sqrt(above) * noise > least))

    # -- moves

    @property
    def stages(self) -> dict[str, Callable[[FineModel], Moves[Fit]]]:
        return {"add": self.larger, "episode": self.episodes}

    def larger(self, model: FineModel) -> Iterator[tuple[Hashable, FineModel]]:
        """Best-scored effects, one at a time, and those whose scores mean little.

        Of all joints: what an elastic effect leaves may show more on others than on its own.
        """
        if not self.loud(model).any():
            return
        scored = [s for s in self.scores(model.fit, self.wanted(model.layout)) if self.promising(model, s)]
        hidden = [s for s in scored[EFFORT.best :] if EFFECTS[s.effect.effect].underrated]
        for s in [*scored[: EFFORT.best], *hidden[: EFFORT.best]]:
            other = self.with_added(model, s)
            if not self.doubtful(other, model.layout):
                yield "", other

    def episodes(self, model: FineModel) -> Iterator[tuple[Hashable, FineModel]]:
        """The best-scored episode."""
        loud = self.loud(model)
        scored = self.scores(model.fit, [], episodes=True) if loud.any() else []
        for s in [s for s in scored if loud[s.effect.place.own_joint] and self.promising(model, s)][:1]:
            other = self.with_added(model, s)
            if not self.doubtful(other, model.layout):
                yield "", other

    def promising(self, model: FineModel, scored: ScoredCandidate) -> bool:
        """Whether an effect may lower J, by the decrease of χ² that its score promises."""
        law, joint = EFFECTS[scored.effect.effect], scored.effect.joint
        if law.underrated and not is_episode(scored.effect):
            return True
        count = sum(part.used.sum(axis=0) for part in self.residuals(model.fit))
        share = self.criterion.samples / count / model.score.deviation**2
        nats = 0.5 * scored.gain * float(np.max(share[slice(None) if joint is None else joint]))
        return EFFORT.reach * nats > self.cost_of(scored.effect)

    def with_added(self, model: FineModel, scored: ScoredCandidate) -> FineModel:
        """The model with a candidate, from the best of its starts."""
        self.say(f"testing candidate: {EFFECTS[scored.effect.effect].title}")
        starts = self.starts(model.fit, scored)
        if len(starts) > 1:  # far from the noise, steps from a bad start lead nowhere
            begun = [self.trial(at, model.fit, EFFORT.first_steps) for at in starts]
            starts = [min(begun, key=lambda fit: fit.objective)]
        return self.model(self.trial(starts[0], model.fit, STEPS))

    def trial(self, start: Known | Fit, near: Fit, iterations: int) -> Fit:
        """A fit as close as its J needs."""
        return self.context.fit(
            start.layout, start.x, iterations=iterations, settled=self.settled, check=self.check, near=near
        )

    def united(self, model: FineModel, others: list[FineModel]) -> FineModel:
        return others[0]  # they are of one place

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


def _points(fit: Fit) -> list[Point]:
    return [point for point in (fit.point, fit.held_out) if point is not None]


def _residuals(point: Point) -> Residuals:
    return Residuals(point.r, point.counted, [b.rows for b in point.two_band.blocks])
