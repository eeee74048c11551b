"""Observers: from sampled θ and τ to the derivatives that the identification equation needs."""

from collections.abc import Sequence

from flexviz.errors import InputError
from flexviz.observers.base import Observer, ObserverStates
from flexviz.observers.eso import CausalEso, EqualDelayEso
from flexviz.observers.zero_phase import ButterworthZeroPhase, EsoZeroPhase, FlatZeroPhase

OBSERVERS: dict[str, type[Observer]] = {
    cls.name: cls for cls in (ButterworthZeroPhase, CausalEso, EqualDelayEso, EsoZeroPhase, FlatZeroPhase)
}
"""Observer name, as commands call it -> class."""

__all__ = [
    "OBSERVERS",
    "ButterworthZeroPhase",
    "CausalEso",
    "EqualDelayEso",
    "EsoZeroPhase",
    "FlatZeroPhase",
    "Observer",
    "ObserverStates",
    "make_observer",
]


def make_observer(name: str, bandwidth: float | Sequence[float] | None = None) -> Observer:
    """The observer of that name with a bandwidth [rad/s] (its default where None)."""
    if name not in OBSERVERS:
        raise InputError(f"unknown observer {name!r}: choose one of {', '.join(OBSERVERS)}")
    return OBSERVERS[name](bandwidth)
