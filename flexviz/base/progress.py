"""The one protocol of long computations: what they tell while they work, and how they are stopped.

A function that takes a while has two optional arguments: `progress`, called with a `Progress` record as often
as there is news, and `should_stop`, asked now and then. A stopped function returns a labelled partial result,
or raises `Cancelled` where it has none.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flexviz.base.iteration import Iteration

SHORT = 5.0  # [s]
CLOSE = 1.5  # ratio of two times that are said as one
VAGUE = 6.0  # ratio of two times of which only the smaller is said


@dataclass(frozen=True)
class BestSoFar:
    """The best model of a search that goes on: no verdict, it is still to be checked.

    Attributes:
        model: what it adds, "Coulomb friction on joint2"; empty for a model without additions.
        error: "validation error 25 % → 0.6 % of the torque (31 mNm)".
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
        rest: expected time to the end [s], at least and at most; None where it is not known.
        so_far: the best model of a search; None until there is one.
        alone: effect → share of its joint's error that it alone would remove, as far as estimated.
    """

    text: str = ""
    share: float | None = None
    iteration: Iteration | None = None
    rest: tuple[float, float] | None = None
    so_far: BestSoFar | None = None
    alone: Mapping[str, float] = field(default_factory=dict)

    @property
    def rest_text(self) -> str:
        """ "about 40 s left", "20 s to 2 min left" or "at least 20 s left" as it is known; else empty."""
        if self.rest is None:
            return ""
        low, high = self.rest
        if high <= SHORT:
            return "a few seconds left"
        if high <= CLOSE * low:
            return f"about {_time_text(math.sqrt(low * high))} left"
        least, most = _time_text(low), _time_text(high)
        if low < SHORT or least == most:
            return f"up to {most} left"
        if high > VAGUE * low:
            return f"at least {least} left"
        unit = most.partition(" ")[2]
        return f"{least.removesuffix(f' {unit}')} to {most} left"

    @property
    def line(self) -> str:
        """What is being done, and the time left."""
        return ", ".join(part for part in (self.text, self.rest_text) if part)

    def later(self, waited: float) -> Progress:
        """The same after a time without news [s]."""
        if self.rest is None:
            return self
        low, high = self.rest
        return replace(self, rest=(max(low - waited, 0.0), max(high - waited, 0.0)))


def _time_text(seconds: float) -> str:
    """A time in full minutes, or below 90 s in steps of 5 s."""
    return f"{seconds / 60:.0f} min" if seconds >= 90 else f"{max(5 * round(seconds / 5), 5)} s"


ProgressCallback = Callable[[Progress], None]
StopCallback = Callable[[], bool]


def ignore(progress: Progress) -> None:
    """The `progress` of a caller who does not want to know."""


def never() -> bool:
    """The `should_stop` of a caller who waits for the end."""
    return False


class Pace:
    """Progress of a computation whose number of stages is unknown, from the time that it takes.

    From earlier runs it is known which share is done when a stage begins, and when it ends: the time since
    the start bounds the whole. Before the first such stage nothing is expected. The share never falls.

    Args:
        known: text of a stage → share that is done when it begins, at least and at most, and at most when it
            ends. Other texts are news within a stage.
        clock: the time [s].
    """

    def __init__(
        self, known: Mapping[str, tuple[float, float, float]], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._known, self._clock, self._began = known, clock, clock()
        self._whole, self._end, self._share = (0.0, math.inf), 1.0, 0.0  # whole: bounds [s]

    def news(self, text: str) -> Progress:
        """What is being done from now on."""
        elapsed = self._clock() - self._began
        if text in self._known:
            least, most, self._end = self._known[text]
            low, high = max(self._whole[0], elapsed / most), min(self._whole[1], elapsed / least)
            self._whole = (low, high) if low < high else (elapsed / most, elapsed / least)
        low = max(self._whole[0], elapsed / self._end)
        high = max(self._whole[1], low)
        if not 0.0 < high < math.inf:
            return Progress(text, self._share)
        self._share = max(self._share, min(elapsed / math.sqrt(low * high), 1.0))
        return Progress(text, self._share, rest=(low - elapsed, high - elapsed))

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
