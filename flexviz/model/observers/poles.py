"""Gains of the extended-state observer as multipliers of those of (s + w)⁶, and poles moved by hand."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexviz.base.arrays import Array
from flexviz.base.errors import InputError
from flexviz.model.observers.gains import binomial_gains

LEAST_MULTIPLIER, LARGEST_MULTIPLIER = 0.3, 3.0  # that are offered: up to one real pole at −3 w
ON_AXIS = 0.06  # [w] distance from the real axis within which a moved pole is put on it
LEAST_REAL = 0.02  # [w] distance from the imaginary axis that a moved pole keeps
ROUNDING = 1e-9  # by which a multiplier may exceed the limits


def multipliers(gains: ArrayLike, bandwidth: float) -> Array:
    """βᵢ ÷ (C(6, i) wⁱ), shape (6,): all 1 if the six poles are at −w."""
    return np.asarray(gains, float) / binomial_gains(bandwidth)


def multiplied(factors: ArrayLike, bandwidth: float) -> tuple[float, ...]:
    """The gains β₁ … β₆ [1/sⁱ] with these multipliers (6,) at a bandwidth w [rad/s]."""
    return tuple((np.asarray(factors, float) * binomial_gains(bandwidth)).tolist())


def multipliers_of_poles(poles: ArrayLike, bandwidth: float) -> Array:
    """Multipliers (6,) that place the poles (6,) [rad/s], conjugate pairs or real.

    Raises:
        InputError: one of them is not offered.
    """
    found = multipliers(np.poly(np.asarray(poles, complex)).real[1:], bandwidth)
    for i, factor in enumerate(found, 1):
        if not LEAST_MULTIPLIER - ROUNDING <= factor <= LARGEST_MULTIPLIER + ROUNDING:
            raise InputError(
                f"β{i} would be {factor:.3g} times that of (s+w)⁶, expected {LEAST_MULTIPLIER:g} to "
                f"{LARGEST_MULTIPLIER:g}"
            )
    return found


def move_pole(poles: ArrayLike, index: int, to: complex, bandwidth: float) -> NDArray[np.complex128]:
    """The poles (6,) [rad/s] after one was moved: they stay stable, and real or in conjugate pairs.

    The conjugate of a pole moves with it. A real pole that leaves the real axis takes the nearest real one
    along as its conjugate; a pair that comes near the axis becomes two equal real poles.
    """
    rest = [complex(pole) for pole in np.asarray(poles, complex)]
    pole = rest.pop(index)
    target = complex(min(to.real, -LEAST_REAL * bandwidth), abs(to.imag))
    on_axis = target.imag < ON_AXIS * bandwidth
    if on_axis and not pole.imag:
        return np.array([*rest, target.real], np.complex128)
    if pole.imag:
        partner = min(rest, key=lambda other: abs(other - pole.conjugate()))
    else:  # of six poles an even number is real
        partner = min((other for other in rest if not other.imag), key=lambda other: abs(other - pole))
    rest.remove(partner)
    pair = (target.real, target.real) if on_axis else (target, target.conjugate())
    return np.array([*rest, *pair], np.complex128)
