"""Observers: from sampled θ and τ to the derivatives that the identification equation needs."""

from collections.abc import Sequence

from flexviz.base.errors import InputError
from flexviz.model.observers.base import Observer, ObserverStates, largest_divisor
from flexviz.model.observers.eso import CausalEso, EqualDelayEso
from flexviz.model.observers.gains import EsoGains, binomial_gains, eso_poles, why_unusable
from flexviz.model.observers.live import LiveObserver
from flexviz.model.observers.poles import (
    LARGEST_MULTIPLIER,
    LEAST_MULTIPLIER,
    move_pole,
    multiplied,
    multipliers,
    multipliers_of_poles,
)
from flexviz.model.observers.zero_phase import ButterworthZeroPhase, EsoZeroPhase, FlatZeroPhase

OBSERVERS: dict[str, type[Observer]] = {
    cls.name: cls for cls in (ButterworthZeroPhase, CausalEso, EqualDelayEso, EsoZeroPhase, FlatZeroPhase)
}
"""Observer name, as commands call it -> class."""

__all__ = [
    "LARGEST_MULTIPLIER",
    "LEAST_MULTIPLIER",
    "OBSERVERS",
    "ButterworthZeroPhase",
    "CausalEso",
    "EqualDelayEso",
    "EsoGains",
    "EsoZeroPhase",
    "FlatZeroPhase",
    "LiveObserver",
    "Observer",
    "ObserverStates",
    "binomial_gains",
    "eso_poles",
    "largest_divisor",
    "make_observer",
    "move_pole",
    "multiplied",
    "multipliers",
    "multipliers_of_poles",
    "why_unusable",
]


def make_observer(
    name: str, bandwidth: float | Sequence[float] | None = None, gains: EsoGains | None = None
) -> Observer:
    """The observer of that name.

    Args:
        name: one of `OBSERVERS`.
        bandwidth: [rad/s], one number or one per joint; None: that of the gains, or the observer's default.
        gains: set by hand, of the observer "eso" only; a bandwidth scales them.
    """
    if name not in OBSERVERS:
        raise InputError(f"unknown observer {name!r}: choose one of {', '.join(OBSERVERS)}")
    if gains is None:
        return OBSERVERS[name](bandwidth)
    if name != CausalEso.name:
        raise InputError(f"the observer {name!r} has no gains to set: expected {CausalEso.name!r}")
    return CausalEso(bandwidth, gains)
