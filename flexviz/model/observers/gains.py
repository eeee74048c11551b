"""Gains β₁ … β₆ of the extended-state observer, set by hand: poles, stability, filter.

In units of a bandwidth w, u = s/w and g_i = β_i/wⁱ, the observer is ẋ = w (shift − g e₁ᵀ) x + w g y. With
P(u) = u⁶ + g₁u⁵ + … + g₆ its states are x̂_{k+1} = w^k Σ_{i>k} g_i u^(6−i+k) / P(u) y.

Between samples y is a straight line (first-order hold), for which the matrix exponential is exact. The filter
runs in the real Schur form of the observer's matrix: block triangular, so that a real pole is a recursion of
first order and a pair one of second order, and by an orthogonal change of coordinates, so that repeated poles
lose no digits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexviz.base._scipy import sp
from flexviz.base.arrays import Array
from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.model.observers.cascade import ORDER

LEAST_DECAY = 1e-3  # of the slowest pole, relative to the bandwidth: slower ones never settle in a record
LARGEST_STEP = 20.0  # bandwidth × step: beyond, the matrix exponential loses its digits
SAME_SHAPE = 1e-9  # relative difference of gains below which six poles count as equal


def binomial_gains(bandwidth: float) -> Array:
    """β_i = C(6, i) wⁱ, which place all six poles at −w: shape (6,)."""
    return np.array([comb(ORDER, i) * bandwidth**i for i in range(1, ORDER + 1)])


EQUAL = binomial_gains(1.0)


def mean_bandwidth(gains: ArrayLike) -> float:
    """β₆^(1/6), the geometric mean of the poles' distances from the origin [rad/s]."""
    return float(np.asarray(gains, float)[-1] ** (1 / ORDER))


def eso_poles(gains: ArrayLike) -> NDArray[np.complex128]:
    """Roots of s⁶ + β₁s⁵ + … + β₆ for positive gains, shape (6,) [rad/s]."""
    w = mean_bandwidth(gains)
    shape = np.asarray(gains, float) / w ** np.arange(1, ORDER + 1)
    if np.abs(shape / EQUAL - 1.0).max() < SAME_SHAPE:
        return np.full(ORDER, -w, complex)  # a sixfold root loses five sixths of the digits
    roots = np.asarray(np.roots(np.r_[1.0, shape]), np.complex128)
    return w * roots


def why_unusable(gains: Sequence[float]) -> Fact | None:
    """Why an observer cannot have these gains; None if it can."""
    if len(gains) != ORDER:
        return Fact("unusable-gains", "wrong", values={"given": len(gains), "expected": ORDER})
    for i, gain in enumerate(gains, 1):
        if not (np.isfinite(gain) and gain > 0):
            return Fact("unusable-gains", "wrong", values={"number": i, "gain": float(gain)})
    worst = max(eso_poles(gains), key=lambda pole: pole.real)
    if worst.real > -LEAST_DECAY * mean_bandwidth(gains):
        pole = (float(worst.real), abs(float(worst.imag)))
        return Fact("unusable-gains", "wrong", values={"pole": pole})
    return None


@dataclass(frozen=True)
class EsoGains:
    """Gains of the extended-state observer, stable.

    Attributes:
        theta: β₁ … β₆ of the observer of θ [1/sⁱ].
        tau: those of the observer of τ.

    Raises:
        InputError: other than six gains, or an unstable observer.
    """

    theta: tuple[float, ...]
    tau: tuple[float, ...]

    def __post_init__(self) -> None:
        for signal, gains in (("θ", self.theta), ("τ", self.tau)):
            if why := why_unusable(gains):
                raise InputError(f"gains of {signal}: {why}")

    @staticmethod
    def of(theta: ArrayLike, tau: ArrayLike | None = None) -> EsoGains:
        """Gains of θ and τ, the same for both if `tau` is None."""
        given = theta, theta if tau is None else tau
        return EsoGains(*(tuple(np.asarray(gains, float).tolist()) for gains in given))

    @property
    def bandwidth(self) -> float:
        """Geometric mean of the distances of the poles of θ from the origin [rad/s]."""
        return mean_bandwidth(self.theta)

    def scaled(self, bandwidth: float) -> EsoGains:
        """Gains with every pole moved along its ray from the origin, to another bandwidth [rad/s]."""
        factor = (bandwidth / self.bandwidth) ** np.arange(1, ORDER + 1)
        return EsoGains.of(factor * self.theta, factor * self.tau)


class StateFilter:
    """States of the observer with one set of gains.

    Args:
        shape: g_1 … g_6, the gains in units of the bandwidth.
    """

    def __init__(self, shape: Array) -> None:
        self.shape = shape
        poles = eso_poles(shape)
        self.decay = float(-poles.real.max())  # of the slowest pole, in units of the bandwidth

    def one_step(self, step: float, bandwidth: float) -> tuple[Array, Array, Array, Array, Array]:
        """A (6, 6), b₀ and b₁ (6,) of z ← A z + b₀ y_k + b₁ y_{k+1}, and the Schur form T, Q (6, 6).

        z = Qᵀx with x in units of the bandwidth: x̂_{k+1} = w^k x_k.
        """
        if bandwidth * step > LARGEST_STEP:
            found = f"gains set by hand for {bandwidth:g} rad/s, with a sample every {step:g} s"
            raise InputError(f"{found}: expected at most {LARGEST_STEP / step:g} rad/s")
        matrix = np.eye(ORDER, k=1)
        matrix[:, 0] -= self.shape
        form: Any = sp.linalg.schur(matrix)
        triangular, orthogonal = form
        held = np.zeros((ORDER + 2, ORDER + 2))
        held[:ORDER, :ORDER] = bandwidth * step * triangular
        held[:ORDER, ORDER] = bandwidth * step * orthogonal.T @ self.shape
        held[ORDER, ORDER + 1] = 1.0
        moved = sp.linalg.expm(held)
        constant, ramp = moved[:ORDER, ORDER], moved[:ORDER, ORDER + 1]
        return moved[:ORDER, :ORDER], constant - ramp, ramp, triangular, orthogonal

    def states(self, y: Array, step: float, bandwidth: float, orders: range) -> Array:
        """x̂_{k+1} for k in `orders`, shape (len(orders), N, m), of y (N, m), constant before it begins."""
        moved, before, after, triangular, orthogonal = self.one_step(step, bandwidth)
        rows = np.ascontiguousarray((y - y[0]).T)  # (m, N): at rest in the beginning, time along memory
        z = np.zeros((ORDER, *rows.shape))
        flat, end = z.reshape(ORDER, -1), ORDER
        while end:
            pair = end > 1 and triangular[end - 1, end - 2] != 0.0
            block = slice(end - 2 if pair else end - 1, end)
            f = moved[block, block]
            into = (moved[block, end:] @ flat[end:]).reshape(-1, *rows.shape)
            into += before[block, None, None] * rows
            into[:, :, :-1] += after[block, None, None] * rows[:, 1:]
            if pair:  # (λ − F)⁻¹ by the adjugate
                later = np.array([[-f[1, 1], f[0, 1]], [f[1, 0], -f[0, 0]]]) @ into.reshape(2, -1)
                into[:, :, 1:] += later.reshape(into.shape)[:, :, :-1]
                poles = [1.0, -f[0, 0] - f[1, 1], f[0, 0] * f[1, 1] - f[0, 1] * f[1, 0]]
            else:
                poles = [1.0, -f[0, 0]]
            z[block, :, 1:] = sp.signal.lfilter([1.0], poles, into[:, :, :-1], axis=-1)
            end = block.start
        scaled = orthogonal[orders.start : orders.stop] * (bandwidth ** np.array(orders))[:, None]
        x = (scaled @ flat).reshape(-1, *rows.shape).transpose(0, 2, 1)
        if orders.start == 0:
            x[0] += y[0]
        return x

    def transfer(self, omega: Array, bandwidth: float, order: int) -> NDArray[np.complex128]:
        """Gain from y to x̂_{order+1} at ω [rad/s], shape (len(ω),)."""
        u = 1j * omega / bandwidth
        above = np.r_[self.shape[order:], np.zeros(order)]  # Σ_{i>k} g_i u^(6−i+k), highest power first
        return bandwidth**order * np.polyval(above, u) / np.polyval(np.r_[1.0, self.shape], u)
