"""What both resolutions share: models with their likelihood, and how moves between them are judged."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.candidates import candidates, credible, is_episode, without
from flexviz.diagnosis.criterion import Gain, Likelihood, Residuals, chance, gain
from flexviz.diagnosis.elimination import Elimination, Linearised, eliminate
from flexviz.diagnosis.fit_context import Judged
from flexviz.diagnosis.search import Candidate
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import DECOYS, EFFECTS, ChosenEffect
from flexviz.equation import Chain, Layout, OperatingPoint
from flexviz.estimation import Prior, Projection, ScoredCandidate, Weigh, best_intervals, score
from flexviz.measurements import MeasurementSet
from flexviz.parallel import shared

Array = NDArray[np.float64]
AnyFit = TypeVar("AnyFit", bound=Judged)

LIMITS, EFFORT = THRESHOLDS.criterion, THRESHOLDS.search


@dataclass(frozen=True, eq=False)
class Model(Generic[AnyFit]):
    """A fitted model with its likelihood."""

    fit: AnyFit
    likelihood: Likelihood

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
        tried: number of candidates of the set's own model.
        decoys: whether candidates that cannot be right compete (`flexviz.effects.DECOYS`).
        reference: likelihood of the model from which the search begins.
        explained: shape (n,), what that explains [nats].
        noise: shape (n,), standard deviation of each joint's residual that noise explains.
    """

    name: ClassVar[str]
    noise: Array
    decoys: bool = False
    reference: Likelihood | None = None
    explained: Array | float = 0.0

    def __init__(
        self, measurements: MeasurementSet, own: Layout, say: Callable[[str], None], many: bool
    ) -> None:
        self.measurements, self.own, self.say, self.many = measurements, own, say, many
        self.raw_step = max(s.step for g in measurements.groups for s in g.segments)
        self.tried = len(candidates(own, measurements.groups, many)) + own.n * len(measurements.groups)

    @property
    def floor(self) -> Array:
        """The largest standard deviation that noise may explain, shape (n,): `noise` is roughly known."""
        return (1 + LIMITS.noise_known) * self.noise

    def wanted(self, layout: Layout) -> list[ChosenEffect]:
        """The effects that a model lacks, and the decoys if they compete."""
        decoys = [
            ChosenEffect(name, joint)
            for name, law in DECOYS.items()
            if self.decoys and self.own.n >= law.fewest_joints
            for joint in range(self.own.n)
        ]
        have = set(layout.effects)
        real = candidates(layout, self.measurements.groups, self.many)
        return [*real, *(d for d in decoys if d not in have)]

    def check(self) -> None:
        """Raise if the search is to stop."""
        self.say("")

    # -- what a resolution supplies

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

    def judged(self, like: Likelihood, prior: Prior, x: Array) -> Likelihood:
        """A likelihood in which torques are scaled as often as there are independent samples."""
        other = like.other
        for k, count in prior.scales:
            where = next(e for e, at in prior.layout.effect_slices() if at.start <= k < at.stop)
            scaled = count * float(np.log(max(1 + x[k], 1e-9)))
            other += (1 - 1 / like.times[where.place.own_joint]) * scaled
        return replace(like, other=other)

    # -- moves

    def parts(self, model: Model[AnyFit]) -> frozenset[ChosenEffect]:
        """The model's effects."""
        return frozenset(model.layout.effects)

    def gain(self, before: Model[AnyFit], after: Model[AnyFit], tried: int) -> Gain:
        """What a move gains, chosen among so many."""
        new = self.parts(after) - self.parts(before)
        episode = bool(new) and all(map(is_episode, new))
        trace = self.trace(before, new) if tried else 0.0
        return gain(before.likelihood, after.likelihood, tried * self.places(episode), trace)

    def trace(self, model: Model[AnyFit], new: Collection[ChosenEffect]) -> float:
        """What the laws of a model may leave on the joints of new effects, as none is exact [nats]."""
        if self.reference is None or not new:
            return 0.0
        explained = np.maximum(gain(self.reference, model.likelihood).by_joint, 0.0) + self.explained
        joints = [e.joint for e in new if e.joint is not None]
        most = explained[joints].max() if len(joints) == len(new) else explained.max()
        return LIMITS.exactness * float(most)

    def places(self, episode: bool) -> int:
        """In how many places an effect may act: an episode at many times."""
        return EFFORT.intervals if episode else 1

    def least(self) -> float:
        """What the move of an effect costs at least [nats]."""
        return chance(self.tried)

    def promising(self, before: Model[AnyFit], after: Model[AnyFit]) -> bool:
        """Whether a model that is not pruned yet describes the data better at all."""
        return float(gain(before.likelihood, after.likelihood).by_joint.sum()) > self.least()

    def above(self, model: Model[AnyFit]) -> float:
        """How much moves may gain together: all that is above the noise [nats]."""
        return float(self.above_by_joint(model).sum())

    def above_by_joint(self, model: Model[AnyFit]) -> Array:
        """The part of each joint, shape (n,) [nats]."""
        like = model.likelihood
        count = sum(part.used.sum(axis=0) for part in self.residuals(model.fit))
        return np.asarray(count * np.log(np.maximum(like.deviation / self.noise, 1.0)) / like.times)

    def loud(self, model: Model[AnyFit]) -> NDArray[np.bool_]:
        """Joints that leave enough above the noise for an effect there, shape (n,)."""
        return self.above_by_joint(model) > self.least()

    def at_noise(self, model: Model[AnyFit]) -> bool:
        """Whether no move can gain what it costs."""
        return self.above(model) < self.least()

    def candidates(self, model: Model[AnyFit]) -> list[Candidate]:
        """What may be added, each with what it promises at most."""
        above = self.above_by_joint(model)
        if above.sum() < self.least():
            return []
        fit, like, loud = model.fit, model.likelihood, above > self.least()
        wanted = [e for e in self.wanted(fit.layout) if e.joint is None or loud[e.joint]]
        found = self.scores(fit, wanted)
        out = []
        for s in found:
            law, joint = EFFECTS[s.effect.effect], s.effect.joint
            if joint is not None and not loud[joint]:
                continue  # an episode
            if law.expected and not credible(fit, s.effect, self.raw_step, s.values):
                continue
            units = np.ones(self.own.n) if law.underrated else self.units(like)
            time = (like.times * units)[slice(None) if joint is None else joint].min()
            tried = len(found) * self.places(is_episode(s.effect))
            cost = chance(tried) + 0.5 * len(law.parameters) * np.log(like.samples)
            promise = EFFORT.reach * 0.5 * s.gain / time - cost - self.trace(model, {s.effect})
            last = is_episode(s.effect)  # of the right size and length, it explains a part of anything
            out.append(Candidate(s.effect, self.rivalry(s.effect), float(promise), s, last))
        return out

    def units(self, like: Likelihood) -> Array:
        """Variance of a joint's residual in units of the weights of the scores, shape (n,)."""
        return np.ones(self.own.n)

    def rivalry(self, effect: ChosenEffect) -> object:
        """Effects of which only the best is added at a time."""
        return effect.joint

    def scores(
        self, fit: AnyFit, wanted: Sequence[ChosenEffect], episodes: bool = True
    ) -> list[ScoredCandidate]:
        """Scores of effects and of the best episodes, the best first."""
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

    def mergers(self, model: Model[AnyFit]) -> Iterable[Callable[[Model[AnyFit]], Model[AnyFit]]]:
        """Each effect in place of those on its joint that it merges, where all of them were found."""
        found = set(model.layout.effects) - set(self.own.effects)
        return [
            partial(self.merged, new=ChosenEffect(name, joint))
            for name, law in EFFECTS.items()
            for joint in range(self.own.n)
            if law.merges and {ChosenEffect(part, joint) for part in law.merges} <= found
        ]

    def merged(self, model: Model[AnyFit], new: ChosenEffect) -> Model[AnyFit]:
        """The model with an effect in place of those that it merges; the model itself if it is impossible."""
        law, fit = EFFECTS[new.effect], model.fit
        gone = {name: ChosenEffect(name, new.joint) for name in law.merges}
        layout = without(fit.layout, gone.values())
        layout = layout.with_effects((*layout.effects, new))
        x = layout.vector(fit.layout.model(fit.x))
        x[layout.effect_slice(new)] = law.merged(
            {name: fit.x[fit.layout.effect_slice(e)] for name, e in gone.items()}
        )
        other = self.refit(model, layout, x)
        return other if credible(other.fit, new, self.raw_step) else model

    # -- drops

    def impossible(self, fit: AnyFit) -> list[ChosenEffect]:
        """Effects whose parameters could not be real."""
        return [e for e in fit.layout.effects if not credible(fit, e, self.raw_step)]

    def firm(self, layout: Layout) -> set[ChosenEffect]:
        """Effects that are not dropped: the set's own ones, and those that others require."""
        needed = {(EFFECTS[e.effect].beside, e.joint) for e in layout.effects}
        return {*self.own.effects, *(e for e in layout.effects if (e.effect, e.joint) in needed)}

    def gains(self, model: Model[AnyFit]) -> dict[ChosenEffect, Gain]:
        """What each effect gains given the others."""
        return self.eliminated(model, lambda layout: layout.effects, ()).kept

    def eliminated(
        self,
        model: Model[AnyFit],
        firm: Callable[[Layout], Collection[ChosenEffect]],
        impossible: Collection[ChosenEffect],
    ) -> Elimination:
        """The model without what it does not need: an effect stays only where it would be added."""
        return eliminate(
            self.linearised(model), firm, impossible, self.tried, lambda e: self.trace(model, {e})
        )

    def pruned(self, model: Model[AnyFit]) -> Model[AnyFit]:
        """The model without the effects that it does not need."""
        for _ in range(EFFORT.rounds):
            found = self.eliminated(model, self.firm, self.impossible(model.fit))
            if not found.dropped:
                return model
            smaller = without(model.layout, found.dropped)
            model = self.refit(model, smaller, self.towards(model, found.x, smaller))
        return model
