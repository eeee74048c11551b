"""The search: a greedy walk between models, judged by one number.

From a model, larger models are tried: on each place the best. What the places add is also tried together, and
the model with the lowest J is taken. Then what the criterion would not add any more is dropped. Where nothing
helps, parts are exchanged for rivals, and what stands for much else is tried last. J belongs to a model
(`criterion`), so that the walk only leads down, and ends at the lowest model that was seen. The search knows
nothing about robots: a problem supplies the models.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from flexviz.analysis.diagnosis.criterion import Gain, Score, gain
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS

Model = TypeVar("Model")

LIMITS = THRESHOLDS.search


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
    """Models of a problem and what the criterion says of them.

    Attributes:
        name: of its resolution.
        stages: kinds of moves, each with the models to which they lead, (place, model). A stage is
            asked only where those before it have found nothing.
    """

    @property
    def name(self) -> str: ...

    @property
    def stages(self) -> dict[str, Callable[[Model], Iterable[tuple[Hashable, Model]]]]: ...

    def parts(self, model: Model) -> frozenset[Hashable]:
        """Keys of what a model has."""
        ...

    def score(self, model: Model) -> Score:
        """What the criterion says of a model."""
        ...

    def united(self, model: Model, others: list[Model]) -> Model:
        """A model with what others have more, or instead."""
        ...

    def smaller(self, model: Model) -> Iterable[Model]:
        """Models without parts that are not needed, the least needed first."""
        ...


class Search(Generic[Model]):
    """A walk on one problem, from model to model with ever lower J.

    Args:
        problem: supplies the models.
        made: called with each model that is taken.
        trace: the moves that were tried, continued. The accepted ones lead from the start to the end.
    """

    def __init__(
        self,
        problem: MoveProblem[Model],
        made: Callable[[Model], None] = lambda _: None,
        trace: list[Tried] | None = None,
    ) -> None:
        self.problem, self.made = problem, made
        self.trace: list[Tried] = [] if trace is None else trace

    def run(self, model: Model) -> Model:
        """The model from which no move leads lower."""
        self.made(model)
        for _ in range(LIMITS.rounds):
            found = next(filter(None, (self.moved(model, kind) for kind in self.problem.stages)), None)
            if found is None:
                break
            model = self.pruned(found)
            self.made(model)
        return model

    def moved(self, model: Model, kind: str) -> Model | None:
        """The lowest model to which moves of a kind lead; None if none leads lower."""
        best: dict[Hashable, Model] = {}
        refused: dict[Hashable, tuple[Gain, Model]] = {}
        for place, other in self.problem.stages[kind](model):
            if self.problem.parts(other) == self.problem.parts(model):
                continue
            found = self.gain(model, other)
            if found.accepted and (place not in best or self.gain(best[place], other).delta > 0):
                best[place] = other
            elif not found.accepted and (place not in refused or found.delta > refused[place][0].delta):
                refused[place] = found, other
        for place, (_, other) in refused.items():
            if place not in best:
                self.told(kind, model, other, False)
        if not best:
            return None
        ends = sorted(best.values(), key=lambda m: self.problem.score(m).total)
        if len(ends) > 1 and self.gain(model, together := self.problem.united(model, ends)).accepted:
            ends.append(together)
        end = min(ends, key=lambda m: self.problem.score(m).total)
        self.told(kind, model, end, True)
        return end

    def pruned(self, model: Model) -> Model:
        """The model without what the criterion would not add."""
        while True:
            for other in self.problem.smaller(model):
                if self.told("drop", model, other, self.gain(model, other).accepted):
                    model = other
                    break
            else:
                return model

    def gain(self, before: Model, after: Model) -> Gain:
        """What a move gains."""
        return gain(self.problem.score(before), self.problem.score(after))

    def told(self, kind: str, before: Model, after: Model, accepted: bool) -> bool:
        """Keep a move in the trace; returns whether it is made."""
        old, new = self.problem.parts(before), self.problem.parts(after)
        found = self.gain(before, after)
        self.trace.append(Tried(kind, tuple(new - old), tuple(old - new), found, accepted, self.problem.name))
        return accepted
