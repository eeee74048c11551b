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
from flexviz.checks.faults import Case, Fault, moves, together
from flexviz.checks.reading import Reading
from flexviz.checks.rigid import Comparison
from flexviz.checks.thresholds import LIMITS, SURE
from flexviz.data.logs import Mapping

ALIKE = float(np.log(LIMITS.alike))
FOLLOWED = 3  # best moves of a model, behind which no other is looked at


@dataclass(frozen=True, eq=False)
class Found:
    """A reading and the moves that lead to it."""

    moves: tuple[Fault, ...]
    reading: Reading

    @property
    def parts(self) -> frozenset[Hashable]:
        return frozenset(move.key for move in self.moves)

    def with_(self, move: Fault) -> Found:
        return Found((*self.moves, move), move.change(self.reading))


class Readings:
    """The models of one recording; `start`: the reading in which nothing is wrong."""

    name = "readings"

    def __init__(
        self, mapping: Mapping, comparison: Comparison, start: Reading, payloads_known: bool
    ) -> None:
        self.mapping, self.comparison, self.start = mapping, comparison, start
        self.payloads_known = payloads_known
        self.stages: dict[str, Callable[[Found], Iterable[tuple[Hashable, Found]]]] = {
            "add": self.larger,
            "swap": self.exchanged,
        }
        self._scores: dict[frozenset[Hashable], Score] = {}
        self._promising: dict[frozenset[Hashable], list[Found]] = {}

    @property
    def begin(self) -> Found:
        """The model in which nothing is wrong."""
        return Found((), self.start)

    def parts(self, model: Found) -> frozenset[Hashable]:
        return model.parts

    def score(self, model: Found) -> Score:
        """What the criterion says of a reading; every move has to make it surely more probable."""
        key = model.parts
        if key not in self._scores:
            fits = self.comparison.fits(model.reading)
            nothing = np.zeros(len(fits))
            by_joint = -np.array([fit.score for fit in fits])
            cost = self._cost(model) - self.comparison.penalty(model.reading)
            self._scores[key] = Score(by_joint, nothing, cost)
        return self._scores[key]

    def _cost(self, model: Found) -> float:
        return sum(SURE - move.prior for move in model.moves)

    def larger(self, model: Found) -> Iterator[tuple[Hashable, Found]]:
        """Models with one more thing wrong, by the joints where it is."""
        for other in self.promising(model):
            yield other.moves[-1].place, other

    def exchanged(self, model: Found) -> Iterator[tuple[Hashable, Found]]:
        """Models in which something else is wrong instead of one thing."""
        for move in model.moves if len(model.moves) > 1 else ():
            for other in self.promising(self.without(model, move)):
                if other.moves[-1].key != move.key:
                    yield move.key, other

    def united(self, model: Found, others: list[Found]) -> Found:
        """All that is wrong in any of them, the most probable first, as far as it goes together."""
        for move in (move for other in others for move in other.moves):
            if not any(move.excludes(done) for done in model.moves):
                model = model.with_(move)
        return model

    def smaller(self, model: Found) -> Iterator[Found]:
        """Models without one thing, the least needed first."""
        every = [self.without(model, move) for move in model.moves] if len(model.moves) > 1 else []
        return iter(sorted(every, key=lambda other: self.score(other).total))

    def without(self, model: Found, move: Fault) -> Found:
        """The model without a move."""
        kept = tuple(other for other in model.moves if other is not move)
        return Found(kept, together(kept, self.start))

    def promising(self, model: Found) -> list[Found]:
        """Models with one more move, without those that are certainly none of the best.

        A bound of all scores tells which must be computed; it is compared with its own value for the model.
        """
        if model.parts in self._promising:
            return self._promising[model.parts]
        comparison, room = self.comparison, self.comparison.room(model.reading)
        if float(np.sum(room)) + np.log(LIMITS.fault) < SURE:  # nothing can be that probable
            return self._promising.setdefault(model.parts, [])
        case = Case(self.mapping, comparison, model.reading, self.payloads_known)
        every = [model.with_(move) for move in moves(case) if self._worth(move, model, room)]
        spare = comparison.bound(model.reading, few=False) - comparison.bound(model.reading)
        most, tried = self.score(model).total, list[Found]()

        def least_of(other: Found, quick: bool = False) -> float:
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

    def _worth(self, move: Fault, model: Found, room: Array) -> bool:
        """Whether a move could make a reading that probable, and is none of what was done already."""
        own = room[list(move.joints)] if move.signal == "tau" else room
        possible = float(np.sum(own)) + move.prior >= SURE
        return possible and not any(move.excludes(done) for done in model.moves)

    def explains(self, model: Found) -> bool:
        """Whether the torques of the changed joints are explained, and none less than without a move.

        What is not explained may be improved by chance.
        """
        shares = self._shares(model)
        return all(
            np.median(shares[list(move.joints)]) >= LIMITS.explained
            and np.all(shares > self._shares(self.without(model, move)) - LIMITS.model_error)
            for move in model.moves
        )

    def _shares(self, model: Found) -> Array:
        """(n,) of each joint's torque that is explained, at least nothing."""
        fits = self.comparison.fits(model.reading)
        return np.maximum([fit.share for fit in fits], 0.0)

    def alike(self, model: Found, move: Fault) -> list[Fault]:
        """Moves that explain the torques as well as one of a model, the most probable first."""
        rest, own = self.without(model, move), self.score(model).total
        found = [
            (self.score(other).total, other.moves[-1])
            for other in self.promising(rest)
            if other.moves[-1].key != move.key and self.score(other).total < own + ALIKE
        ]
        return [other for _, other in sorted(found, key=lambda one: one[0])]
