"""The one protocol of long computations: what they tell while they work, and how they are stopped.

A function that takes a while has two optional arguments: `progress`, called with a `Progress` record as often
as there is news, and `should_stop`, asked now and then. A stopped function returns a labelled partial result,
or raises `Cancelled` where it has none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
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
class Progress:
    """News of a running computation.

    Attributes:
        text: what is being done.
        share: how much of it is done, 0 … 1; None where the end is not known.
        iteration: the solver's latest step, where a solver runs.
    """

    text: str = ""
    share: float | None = None
    iteration: Iteration | None = None


ProgressCallback = Callable[[Progress], None]
StopCallback = Callable[[], bool]


def ignore(progress: Progress) -> None:
    """The `progress` of a caller who does not want to know."""


def never() -> bool:
    """The `should_stop` of a caller who waits for the end."""
    return False


def part(progress: ProgressCallback, first: float, last: float, text: str = "") -> ProgressCallback:
    """Progress of one part of a computation, mapped to the share from `first` to `last` of the whole.

    `text` replaces the part's own.
    """

    def tell(news: Progress) -> None:
        share = first + (last - first) * (news.share or 0.0)
        progress(replace(news, text=text or news.text, share=share))

    return tell
