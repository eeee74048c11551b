"""How a set is identified: one record for the command line, the app, sessions, batches and Python."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypedDict, Unpack

import numpy as np

from flexviz.base.names import names_of
from flexviz.model.observers import ButterworthZeroPhase, EsoGains, Observer, make_observer


@dataclass(frozen=True)
class FitSettings:
    """How a set is identified.

    Attributes:
        groups: names of the groups to fit (one alone is a list of one); all but the validation groups where
            None.
        effects: "name" (every joint), "name:joint", "name:payload" or "name:joint@group", in addition to
            those of the set's model; one alone is a list of one.
        observer: one of `OBSERVERS`.
        bandwidth: [rad/s], one number or one per joint. None: the zero-phase Butterworth's is chosen by the
            data (least residual), the others have a fixed default.
        gains: of the observer "eso", set by hand; a bandwidth scales them.
        refine: remove the observer's bias by instrumental variables. Without it, the intervals leave this
            bias out.
        max_iterations: of each solver run.

    Raises:
        InputError: an observer, bandwidth or gains that do not exist.
    """

    groups: tuple[str, ...] | None = None
    effects: tuple[str, ...] = ()
    observer: str = ButterworthZeroPhase.name
    bandwidth: float | tuple[float, ...] | None = None
    gains: EsoGains | None = None
    refine: bool = True
    max_iterations: int = 60

    def __post_init__(self) -> None:
        if np.ndim(self.bandwidth):  # type: ignore[arg-type]  # any sequence will do
            object.__setattr__(self, "bandwidth", tuple(self.bandwidth))  # type: ignore[arg-type]
        for name, names in (("groups", self.groups), ("effects", self.effects)):
            if names is not None:
                object.__setattr__(self, name, names_of(names))
        self.make_observer()

    @property
    def automatic(self) -> bool:
        """Whether the data choose the bandwidth."""
        by_hand = self.bandwidth is not None or self.gains is not None
        return self.observer == ButterworthZeroPhase.name and not by_hand

    @property
    def tuning(self) -> tuple[str, float | tuple[float, ...] | None, EsoGains | None]:
        """Observer, bandwidth and gains."""
        return self.observer, self.bandwidth, self.gains

    def make_observer(self) -> Observer:
        """The observer, with its default bandwidth where none is given."""
        return make_observer(self.observer, self.bandwidth, self.gains)


class FitOptions(TypedDict, total=False):
    """The fields of `FitSettings` as keyword arguments, of which any sequences will do."""

    groups: str | Iterable[str] | None
    effects: str | Iterable[str]
    observer: str
    bandwidth: float | Sequence[float] | None
    gains: EsoGains | None
    refine: bool
    max_iterations: int


def fit_settings(settings: FitSettings | None, **options: Unpack[FitOptions]) -> FitSettings:
    """Settings with some of them changed; None: the defaults."""
    return replace(settings or FitSettings(), **options)  # type: ignore[arg-type]
