"""What both resolutions share: models with their score, candidates, and which parts a model needs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.candidates import (
    candidates,
    credible,
    is_episode,
    offsets_of_springs,
    without,
)
from flexviz.analysis.diagnosis.criterion import Criterion, ModelScore, Residuals
from flexviz.analysis.diagnosis.elimination import Linearised, needs
from flexviz.analysis.diagnosis.fit_context import Judged
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.diagnosis.unknown_curve import is_curve
from flexviz.analysis.estimation import Projection, ScoredCandidate, Weigh, best_intervals, score
from flexviz.base.facts import Fact
from flexviz.base.parallel import shared
from flexviz.base.search import Gain, gain
from flexviz.checks import seen_limits
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import DECOYS, EFFECTS, ChosenEffect, kin
from flexviz.model.equation import Chain, Layout, OperatingPoint

Array = NDArray[np.float64]
AnyFit = TypeVar("AnyFit", bound=Judged)
Moves = Iterable[tuple[Hashable, "Model[AnyFit]"]]

LIMITS, EFFORT = THRESHOLDS.criterion, THRESHOLDS.search


@dataclass(frozen=True, eq=False)
class Model(Generic[AnyFit]):
    """A fitted model with its score."""

    fit: AnyFit
    score: ModelScore

    @property
    def layout(self) -> Layout:
        """The model's effects and parameters."""
        return self.fit.layout


@dataclass(frozen=True, eq=False)
class Scoring:
    """What the score test of a fit needs: operating point, chain, weights and projection."""

    point: OperatingPoint
    chain: Chain
    weigh: Weigh
    projection: Projection


class Resolution(ABC, Generic[AnyFit]):
    """Models of one set at one resolution: a `MoveProblem` of the search.

    Args:
        measurements: the set.
        own: its own model, whose effects stay.
        say: called with a progress message; may raise to stop.
        many: whether effects are candidates that only show where many are missing.

    Attributes:
        banned: effects for which there was no evidence; they are tried no more.
        decoys: whether candidates that cannot be right compete (`flexviz.model.effects.DECOYS`).
    """

    name: ClassVar[str]
    decoys: bool = False
    banned: frozenset[ChosenEffect] = frozenset()

    def __init__(
        self, measurements: MeasurementSet, own: Layout, say: Callable[[Fact | str], None], many: bool
    ) -> None:
        self.measurements, self.own, self.say, self.many = measurements, own, say, many
        self.raw_step = max(s.step for g in measurements.groups for s in g.segments)

    @property
    def choices(self) -> int:
        """Number of effects that may be added to the set's own model."""
        return len(self.wanted(self.own)) + self.own.n * len(self.measurements.groups)

    def wanted(self, layout: Layout) -> list[ChosenEffect]:
        """The effects that a model lacks, and the decoys if they compete."""
        decoys = [
            ChosenEffect(name, joint)
            for name, law in DECOYS.items()
            if self.decoys and self.own.n >= law.fewest_joints
            for joint in range(self.own.n)
        ]
        have, seen = set(layout.effects), {limit.joint for limit in seen_limits(self.measurements)}
        real = [
            e
            for e in candidates(layout, self.measurements.groups, self.many)
            if not (EFFECTS[e.effect].limits_torque and e.joint in seen)
        ]
        return [e for e in (*real, *(d for d in decoys if d not in have)) if e not in self.banned]

    def check(self) -> None:
        """Raise if the search is to stop."""
        self.say("")

    # -- what a resolution supplies

    @property
    @abstractmethod
    def criterion(self) -> Criterion:
        """J of every model of the recording."""

    @property
    @abstractmethod
    def stages(self) -> dict[str, Callable[[Model[AnyFit]], Moves[AnyFit]]]:
        """Kinds of moves."""

    @abstractmethod
    def refit(self, model: Model[AnyFit], layout: Layout, x: Array) -> Model[AnyFit]:
        """Another model fitted from x, shape (P,), near this one."""

    @abstractmethod
    def residuals(self, fit: AnyFit) -> list[Residuals]:
        """Residuals of the fit groups, and of the validation groups if there are any."""

    @abstractmethod
    def linearised(self, model: Model[AnyFit]) -> Linearised:
        """The model as a linear function of its parameters."""

    @abstractmethod
    def scoring(self, fit: AnyFit) -> Scoring:
        """What the score test needs."""

    @abstractmethod
    def towards(self, model: Model[AnyFit], x: Array, smaller: Layout) -> Array:
        """Feasible start of a smaller model on the way to x, shape (P,)."""

    # -- judging

    def score(self, model: Model[AnyFit]) -> ModelScore:
        """What the criterion says of a model."""
        return model.score

    def parts(self, model: Model[AnyFit]) -> frozenset[ChosenEffect]:
        """The model's effects."""
        return frozenset(model.layout.effects)

    def cost(self, layout: Layout) -> float:
        """Of a model's effects; free curves are priced by their fit [nats].

        A law that is not the simplest of its family is one of several, among which it is chosen. A torque
        offset that stands for a spring's rest angle is no effect of its own.
        """
        stand_ins = offsets_of_springs(layout) - set(self.own.effects)
        at_mean = {e.joint for e in offsets_of_springs(layout)}
        total = 0.0
        for effect in layout.effects:
            law = EFFECTS[effect.effect]
            if is_curve(effect):
                continue
            fixed = law.offset_parameter is not None and effect.joint in at_mean
            places = EFFORT.intervals if is_episode(effect) else 1
            total += self.criterion.cost(len(law.parameters) - fixed, effect not in stand_ins, places)
            total += float(np.log(kin(effect.effect)))
        return total

    def cost_of(self, effect: ChosenEffect) -> float:
        """What an effect costs [nats]."""
        return self.cost(self.own.with_effects([effect]))

    def saved(self, layout: Layout, effect: ChosenEffect) -> float:
        """What a model costs less without an effect [nats]."""
        return self.cost(layout) - self.cost(without(layout, [effect]))

    def above(self, model: Model[AnyFit]) -> Array:
        """What moves may gain on each joint: all that is above noise and tolerance, shape (n,) [nats]."""
        return model.score.by_joint - self.criterion.nats(np.zeros(self.own.n))

    def loud(self, model: Model[AnyFit]) -> NDArray[np.bool_]:
        """Joints that leave enough for an effect of one parameter, shape (n,)."""
        return self.above(model) > self.criterion.cost(1, 1)

    def doubtful(self, model: Model[AnyFit], known: Layout) -> list[ChosenEffect]:
        """Effects that a known model lacks and that are impossible, or not visible in the motion."""
        new = [e for e in model.layout.effects if e not in known.effects and not is_curve(e)]
        quiet = ~self.loud(model)
        return [e for e in new if not credible(model.fit, e, self.raw_step, bool(np.all(quiet[e.joint])))]

    # -- candidates

    def scores(
        self, fit: AnyFit, wanted: Sequence[ChosenEffect], episodes: bool = False
    ) -> list[ScoredCandidate]:
        """Scores of effects, or of the best episodes, the best first."""
        at = self.scoring(fit)

        def of_joint(joint: int | None) -> list[ScoredCandidate]:
            self.check()
            mine = [e for e in wanted if e.joint == joint]
            found = score(at.point, at.chain, mine, at.weigh, at.projection)
            if episodes and joint is not None:
                longest = EFFORT.longest_episode
                found += best_intervals(at.point, joint, at.weigh, at.projection, longest=longest)
            return [s for s in found if s.effect not in fit.layout.effects]

        parts = shared(of_joint, [*range(self.own.n), None])
        return sorted((s for part in parts for s in part), key=lambda s: -s.gain)

    # -- drops

    def firm(self, layout: Layout) -> set[ChosenEffect]:
        """Effects that are not dropped: the set's own ones, and those that others require."""
        needed = {(EFFECTS[e.effect].beside, e.joint) for e in layout.effects}
        return {*self.own.effects, *(e for e in layout.effects if (e.effect, e.joint) in needed)}

    def gains(self, model: Model[AnyFit]) -> dict[ChosenEffect, Gain]:
        """What each effect gains given the others: in closed form, by a fit without one that has no size."""
        found = {e: g for e, (g, _) in needs(self.linearised(model), model.score, self).items()}
        for effect in [e for e in found if not (EFFECTS[e.effect].size_at or is_curve(e))]:
            smaller = without(model.layout, [effect])
            other = self.refit(model, smaller, smaller.vector(model.layout.model(model.fit.x)))
            found[effect] = gain(other.score, model.score)
        return found

    def smaller(
        self, model: Model[AnyFit], among: Collection[ChosenEffect] | None = None
    ) -> Iterable[Model[AnyFit]]:
        """Models without effects that cost more than they gain, the least needed first.

        Only without those of `among`, if given.
        """
        firm = self.firm(model.layout)
        found = needs(self.linearised(model), model.score, self)
        weak = [e for e, (g, _) in found.items() if e not in firm and (among is None or e in among)]
        for effect in sorted(weak, key=lambda e: found[e][0].delta):
            need, x = found[effect]
            if need.delta > EFFORT.reach * self.cost_of(effect):
                break
            smaller = without(model.layout, [effect])
            other = self.refit(model, smaller, self.towards(model, x, smaller))
            if len(self.doubtful(other, self.own)) <= len(self.doubtful(model, self.own)):
                yield other
