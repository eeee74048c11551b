"""The one protocol of long computations: what they tell while they work, and how they are stopped.

A function that takes a while has two optional arguments: `progress`, called with a `Progress` record as often
as there is news, and `should_stop`, asked now and then. A stopped function returns a labelled partial result,
or raises `Cancelled` where it has none.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Iteration:
    """One step of a solver.

    Attributes:
        number: counted from 0 (the start) over all stages.
        stage: what the solver is doing.
        cost: ½ Σ (r/σ)² + prior.
        step: length of the step in standard deviations of the parameters.
        values: shape (P,), parameters in the units of the result (stiffness, not compliance).
        names: shape (P,), "stiffness:joint1".
    """

    number: int
    stage: str
    cost: float
    step: float
    values: NDArray[np.float64]
    names: tuple[str, ...]


@dataclass(frozen=True)
class BestSoFar:
    """The best model of a search that goes on: no verdict, it is still to be checked.

    Attributes:
        model: what it adds, "Coulomb friction on joint2"; empty for a model without additions.
        error: "validation error 25 % → 0.6 % of the torque".
    """

    model: str
    error: str

    @property
    def running(self) -> str:
        """For whoever waits."""
        return (
            f"so far: {self.model} (being checked): {self.error}" if self.model else f"so far: {self.error}"
        )

    @property
    def stopped(self) -> str:
        """For whoever has stopped the search."""
        if not self.model:
            return f"stopped before any candidate was tried; {self.error}"
        return f"best so far, not confirmed: {self.model}: {self.error}"


@dataclass(frozen=True)
class Progress:
    """News of a running computation.

    Attributes:
        text: what is being done.
        share: how much of it is done, 0 … 1; None where the end is not known.
        iteration: the solver's latest step, where a solver runs.
        rest: expected time to the end [s]; None where it is not known.
        so_far: the best model of a search; None until there is one.
        alone: effect → share of its joint's error that it alone would remove, as far as estimated.
    """

    text: str = ""
    share: float | None = None
    iteration: Iteration | None = None
    rest: float | None = None
    so_far: BestSoFar | None = None
    alone: Mapping[str, float] = field(default_factory=dict)

    @property
    def rest_text(self) -> str:
        """ "about 40 s left"; empty if not known."""
        if self.rest is None:
            return ""
        if self.rest >= 90:
            return f"about {self.rest / 60:.0f} min left"
        return f"about {max(5 * round(self.rest / 5), 5)} s left" if self.rest > 5 else "a few seconds left"


ProgressCallback = Callable[[Progress], None]
StopCallback = Callable[[], bool]


def ignore(progress: Progress) -> None:
    """The `progress` of a caller who does not want to know."""


def never() -> bool:
    """The `should_stop` of a caller who waits for the end."""
    return False


class Pace:
    """Progress of a computation whose number of stages is unknown, from the time that it takes.

    No duration is expected until the first stage has ended, then a multiple of that stage. The share never
    falls.

    Args:
        first: duration of the whole relative to the first stage.
        least: time that is expected to the end at any stage, relative to the longest stage so far.
        known: text of a stage -> share that is done when it begins.
        clock: the time [s].
    """

    def __init__(
        self,
        first: float,
        least: float,
        known: Mapping[str, float],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._total, self._first, self._least, self._known, self._clock = 0.0, first, least, known, clock
        self._began, self._share, self._stages = clock(), 0.0, 0
        self._last, self._longest = 0.0, 0.0  # [s] beginning of the latest stage, and the longest one

    def news(self, text: str) -> Progress:
        """A stage begins."""
        elapsed = self._clock() - self._began
        self._stages += 1
        if self._stages > 1:
            self._longest = max(self._longest, elapsed - self._last)
        if self._stages == 2:
            self._total = self._first * self._longest
        self._last = elapsed
        if text in self._known:
            self._total = elapsed / self._known[text]
        elif self._stages > 1:
            self._total = max(self._total, elapsed + self._least * self._longest)
        self._share = max(self._share, min(elapsed / self._total, 1.0)) if self._total > 0 else 0.0
        return Progress(text, self._share, rest=self._total - elapsed if self._total > elapsed else None)

    def done(self) -> Progress:
        """The end, with the time it took."""
        return Progress(f"done in {self._clock() - self._began:.0f} s", 1.0)


def part(progress: ProgressCallback, first: float, last: float, text: str = "") -> ProgressCallback:
    """Progress of one part of a computation, mapped to the share from `first` to `last` of the whole.

    `text` replaces the part's own.
    """

    def tell(news: Progress) -> None:
        share = first + (last - first) * (news.share or 0.0)
        progress(replace(news, text=text or news.text, share=share))

    return tell
