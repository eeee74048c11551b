"""Readings of a recording as models that the common search walks between.

J of a reading is minus the logarithm of its probability: of the torques given the reading, and of what it
says to be wrong. Moves are tried jointly: what helps on different joints is also taken together.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array
from flexviz.base.search import Score
from flexviz.checks.faults import Case, Fault, possible_faults, together
from flexviz.checks.reading import Reading
from flexviz.checks.rigid import Comparison
from flexviz.checks.thresholds import LIMITS, SURE
from flexviz.data.logs import Mapping

ALIKE = float(np.log(LIMITS.alike))
FOLLOWED = 3  # best further faults of a model, behind which no other is looked at


@dataclass(frozen=True, eq=False)
class ReadingModel:
    """One model of the search: the faults that are supposed, and the reading of the columns with them."""

    faults: tuple[Fault, ...]
    reading: Reading

    @property
    def parts(self) -> frozenset[Hashable]:
        return frozenset(fault.key for fault in self.faults)

    def with_(self, fault: Fault) -> ReadingModel:
        return ReadingModel((*self.faults, fault), fault.change(self.reading))


class Readings:
    """The models of one recording; `start`: the reading in which nothing is wrong."""

    name = "readings"

    def __init__(
        self, mapping: Mapping, comparison: Comparison, start: Reading, payloads_known: bool
    ) -> None:
        self.mapping, self.comparison, self.start = mapping, comparison, start
        self.payloads_known = payloads_known
        self.stages: dict[str, Callable[[ReadingModel], Iterable[tuple[Hashable, ReadingModel]]]] = {
            "add": self.larger,
            "swap": self.exchanged,
        }
        self._scores: dict[frozenset[Hashable], Score] = {}
        self._promising: dict[frozenset[Hashable], list[ReadingModel]] = {}

    @property
    def begin(self) -> ReadingModel:
        """The model in which nothing is wrong."""
        return ReadingModel((), self.start)

    def parts(self, model: ReadingModel) -> frozenset[Hashable]:
        return model.parts

    def score(self, model: ReadingModel) -> Score:
        """What the criterion says of a reading; every fault has to make it surely more probable."""
        key = model.parts
        if key not in self._scores:
            fits = self.comparison.fits(model.reading)
            nothing = np.zeros(len(fits))
            by_joint = -np.array([fit.score for fit in fits])
            cost = self._cost(model) - self.comparison.penalty(model.reading)
            self._scores[key] = Score(by_joint, nothing, cost)
        return self._scores[key]

    def _cost(self, model: ReadingModel) -> float:
        return sum(SURE - fault.prior for fault in model.faults)

    def larger(self, model: ReadingModel) -> Iterator[tuple[Hashable, ReadingModel]]:
        """Models with one more thing wrong, by the joints where it is."""
        for other in self.promising(model):
            yield other.faults[-1].place, other

    def exchanged(self, model: ReadingModel) -> Iterator[tuple[Hashable, ReadingModel]]:
        """Models in which something else is wrong instead of one thing."""
        for fault in model.faults if len(model.faults) > 1 else ():
            for other in self.promising(self.without(model, fault)):
                if other.faults[-1].key != fault.key:
                    yield fault.key, other

    def united(self, model: ReadingModel, others: list[ReadingModel]) -> ReadingModel:
        """All that is wrong in any of them, the most probable first, as far as it goes together."""
        for fault in (fault for other in others for fault in other.faults):
            if not any(fault.excludes(done) for done in model.faults):
                model = model.with_(fault)
        return model

    def smaller(self, model: ReadingModel) -> Iterator[ReadingModel]:
        """Models without one thing, the least needed first."""
        every = [self.without(model, fault) for fault in model.faults] if len(model.faults) > 1 else []
        return iter(sorted(every, key=lambda other: self.score(other).total))

    def without(self, model: ReadingModel, fault: Fault) -> ReadingModel:
        """The model without a fault."""
        kept = tuple(other for other in model.faults if other is not fault)
        return ReadingModel(kept, together(kept, self.start))

    def promising(self, model: ReadingModel) -> list[ReadingModel]:
        """Models with one more fault, without those that are certainly none of the best.

        A bound of all scores tells which must be computed; it is compared with its own value for the model.
        """
        if model.parts in self._promising:
            return self._promising[model.parts]
        comparison, room = self.comparison, self.comparison.room(model.reading)
        if float(np.sum(room)) + np.log(LIMITS.fault) < SURE:  # nothing can be that probable
            return self._promising.setdefault(model.parts, [])
        case = Case(self.mapping, comparison, model.reading, self.payloads_known)
        every = [model.with_(fault) for fault in possible_faults(case) if self._worth(fault, model, room)]
        spare = comparison.bound(model.reading, few=False) - comparison.bound(model.reading)
        most, tried = self.score(model).total, list[ReadingModel]()

        def least_of(other: ReadingModel, quick: bool = False) -> float:
            return self._cost(other) - comparison.bound(other.reading, quick=quick) - spare

        every = [other for other in every if least_of(other, quick=True) <= most + ALIKE]
        least = [least_of(other) for other in every]
        best: list[float] = []  # totals of those that were tried, in order
        for i in np.argsort(least):
            if least[i] > most + ALIKE:
                break
            tried.append(every[i])
            insort(best, self.score(every[i]).total)
            most = min([most, *best[FOLLOWED - 1 : FOLLOWED]])
        self._promising[model.parts] = tried
        return tried

    def _worth(self, fault: Fault, model: ReadingModel, room: Array) -> bool:
        """Whether a fault could make a reading that probable, and is none of what was done already."""
        own = room[list(fault.joints)] if fault.signal == "tau" else room
        possible = float(np.sum(own)) + fault.prior >= SURE
        return possible and not any(fault.excludes(done) for done in model.faults)

    def explains(self, model: ReadingModel) -> bool:
        """Whether the torques of the changed joints are explained, and none less than without a fault.

        What is not explained may be improved by chance.
        """
        shares = self._shares(model)
        return all(
            np.median(shares[list(fault.joints)]) >= LIMITS.explained
            and np.all(shares > self._shares(self.without(model, fault)) - LIMITS.model_error)
            for fault in model.faults
        )

    def _shares(self, model: ReadingModel) -> Array:
        """(n,) of each joint's torque that is explained, at least nothing."""
        fits = self.comparison.fits(model.reading)
        return np.maximum([fit.share for fit in fits], 0.0)

    def alike(self, model: ReadingModel, fault: Fault) -> list[Fault]:
        """Faults that explain the torques as well as one of a model, the most probable first."""
        rest, own = self.without(model, fault), self.score(model).total
        found = [
            (self.score(other).total, other.faults[-1])
            for other in self.promising(rest)
            if other.faults[-1].key != fault.key and self.score(other).total < own + ALIKE
        ]
        return [other for _, other in sorted(found, key=lambda one: one[0])]
