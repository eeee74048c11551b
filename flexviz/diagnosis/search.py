"""The search: one loop of moves, judged by one criterion.

A model is pruned; then what promises most on each place is added, all at once or one at a time, and the model
is pruned again; effects are swapped for rivals. A move is made if the criterion accepts it. Where nothing of
the library is accepted any more, an unknown input is added, and the search goes on with it. The search
knows nothing about robots: a problem supplies the moves and compares models.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from flexviz.diagnosis.criterion import Gain
from flexviz.diagnosis.thresholds import THRESHOLDS

Model = TypeVar("Model")

LIMITS = THRESHOLDS.search


@dataclass(frozen=True)
class Candidate:
    """What may be added.

    Attributes:
        key: its name.
        place: of several candidates of one place, the best is tried.
        promise: what it gains at most, estimated in closed form [nats], less its cost.
        content: for the problem.
        last: whether it can stand in for much, so that everything else is tried before.
    """

    key: Hashable
    place: Hashable
    promise: float
    content: Any = None
    last: bool = False


@dataclass(frozen=True)
class Tried:
    """One move that was tried.

    Attributes:
        kind: "add", "drop", "swap" or "unknown".
        added, removed: keys.
        gain: what it gains.
        accepted: whether it was made.
        resolution: of the problem.
    """

    kind: str
    added: tuple[Any, ...]
    removed: tuple[Any, ...]
    gain: Gain
    accepted: bool
    resolution: str


class MoveProblem(Protocol[Model]):
    """Models, their moves and their comparison.

    Attributes:
        name: of its resolution.
    """

    @property
    def name(self) -> str: ...

    def parts(self, model: Model) -> frozenset[Hashable]:
        """Keys of what a model has."""
        ...

    def candidates(self, model: Model) -> list[Candidate]:
        """What may be added, each with its promise."""
        ...

    def with_added(self, model: Model, chosen: Sequence[Candidate]) -> Model:
        """A larger model, fitted."""
        ...

    def promising(self, before: Model, after: Model) -> bool:
        """Whether a model that is not pruned yet describes the data better at all."""
        ...

    def pruned(self, model: Model) -> Model:
        """The model without the parts that it does not need."""
        ...

    def swaps(self, model: Model) -> Iterable[Callable[[Model], Model]]:
        """Exchanges of parts for rivals."""
        ...

    def mergers(self, model: Model) -> Iterable[Callable[[Model], Model]]:
        """Parts that stand together exchanged for one that may describe both."""
        ...

    def unknowns(self, model: Model) -> Iterable[Callable[[Model], Model]]:
        """The model with an unknown input, the most promising place first."""
        ...

    def gain(self, before: Model, after: Model, tried: int) -> Gain:
        """What a move gains, chosen among so many."""
        ...


class Search(Generic[Model]):
    """A search on one problem: greedy moves between models until the criterion accepts none.

    Each round prunes (what would not be added again is dropped), adds the best candidate of each place, swaps
    effects for rivals, and then tries an unknown input. A move needs Δ > 1.64 standard errors and must not
    harm held-out data, so that the end does not depend on thresholds of the moves.

    Args:
        problem: supplies the moves.
        made: called with each model that is accepted.
        trace: the moves that were tried, continued.
    """

    def __init__(
        self,
        problem: MoveProblem[Model],
        made: Callable[[Model], None] = lambda _: None,
        trace: list[Tried] | None = None,
    ) -> None:
        self.problem, self.made = problem, made
        self.trace: list[Tried] = [] if trace is None else trace
        self._refused = dict[Hashable, float]()  # candidates, and what they promised
        self._swapped = set[frozenset[Hashable]]()  # models of which no part is exchanged ...
        self._alone = set[frozenset[Hashable]]()  # ... and with which no unknown input is accepted
        self._scored: tuple[Model, list[Candidate]] | None = None  # the last model that was scored

    def run(self, model: Model, inner: bool = False) -> Model:
        """The model from which no move is accepted; `inner`: no unknown input is added."""
        model, idle = self.problem.pruned(model), 0
        self.made(model)
        for _ in range(LIMITS.rounds):
            scored = self.candidates(model)
            worth = [c for c in scored if self.worth(c)]
            found, chosen = None, best_of_each_place(c for c in worth if not c.last)
            if not chosen or idle >= LIMITS.idle:
                found = self.exchanged(model, inner)
                chosen = best_of_each_place(c for c in worth if c.last) if found is None else []
                if found is None and not chosen:
                    break
            if chosen:
                found = self.enlarged(model, chosen, len(scored))
            idle = idle + 1 if found is None else 0
            if found is not None:
                model = found
                self.made(model)
        return self.problem.pruned(model)

    def candidates(self, model: Model) -> list[Candidate]:
        """What may be added to a model, which is scored once."""
        if self._scored is None or self._scored[0] is not model:
            self._scored = model, self.problem.candidates(model)
        return self._scored[1]

    def worth(self, candidate: Candidate) -> bool:
        """Whether to try a candidate: not one that was refused, unless it promises much more by now."""
        return candidate.promise > LIMITS.reach * self._refused.get(candidate.key, 0.0)

    def enlarged(self, model: Model, chosen: Sequence[Candidate], tried: int) -> Model | None:
        """The model with the candidates, all at once or the first one by one that is accepted."""
        singles = [[c] for c in chosen[: LIMITS.singles]] if len(chosen) > 1 else []
        for some in [list(chosen), *singles]:
            larger = self.problem.with_added(model, some)
            if self.problem.promising(model, larger):
                larger = self.problem.pruned(larger)
                if self.accepted("add", model, larger, tried):
                    return larger
            if len(some) == 1:
                self._refused[some[0].key] = some[0].promise
        return None

    def exchanged(self, model: Model, inner: bool) -> Model | None:
        """The model with a part exchanged for a rival, or with an unknown input; None if none is accepted."""
        parts = self.problem.parts(model)
        for merge in self.problem.mergers(model) if parts not in self._swapped else ():
            other = merge(model)
            if self.accepted("swap", model, other, 0, simpler=True):
                return other
        for swap in self.problem.swaps(model) if parts not in self._swapped else ():
            other = swap(model)
            if self.accepted("swap", model, other, 0):
                return other
        self._swapped.add(parts)
        if inner or parts in self._alone:
            return None
        found = self.with_unknown(model)
        if found is None:
            self._alone.add(parts)
        return found

    def with_unknown(self, model: Model) -> Model | None:
        """The model with an unknown input and what shows given it; None if none is accepted."""
        for unknown in self.problem.unknowns(model):
            larger = unknown(model)
            if self.problem.parts(larger) == self.problem.parts(model):
                continue
            before, self._refused = self._refused, {}
            larger = self.run(larger, inner=True)
            if self.accepted("unknown", model, larger, 1):
                return larger
            self._refused = before
        return None

    def accepted(self, kind: str, before: Model, after: Model, tried: int, simpler: bool = False) -> bool:
        """Whether a move is accepted; it is kept in the trace. `simpler`: unless its reversal would be."""
        old, new = self.problem.parts(before), self.problem.parts(after)
        if new == old:
            return False
        if new < old or simpler:  # a part stays only where the criterion would add it
            gain = self.problem.gain(after, before, tried)
            kind, accepted, gain = kind if simpler else "drop", not gain.accepted, gain.reversed
        else:
            gain = self.problem.gain(before, after, tried)
            accepted = gain.accepted
        self.trace.append(Tried(kind, tuple(new - old), tuple(old - new), gain, accepted, self.problem.name))
        return accepted


def best_of_each_place(candidates: Iterable[Candidate]) -> list[Candidate]:
    """The best candidate of each place that promises anything, the best first."""
    chosen: dict[Hashable, Candidate] = {}
    for candidate in sorted(candidates, key=lambda c: -c.promise):
        if candidate.promise > 0:
            chosen.setdefault(candidate.place, candidate)
    return list(chosen.values())
