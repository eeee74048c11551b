"""The paper's linear extended-state observer, causal, and the equally delayed variant.

Paper, section 3.1, with g(e) = e:  x̂̇_i = x̂_{i+1} + β_i e,  x̂̇₆ = β₆ e,  β_i = C(6, i) wⁱ unless gains are
set by hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb
from typing import ClassVar

import numpy as np
from numpy.polynomial import polynomial

from flexviz.base.arrays import Array
from flexviz.data.measurements import Segment
from flexviz.model.observers.base import Observer, ObserverStates, shifted
from flexviz.model.observers.cascade import ORDER, cascade, combine, evaluate, one_step
from flexviz.model.observers.gains import EsoGains, StateFilter
from flexviz.model.observers.live import LiveObserver, LiveStep

# an error in the initial state fades as (wt)⁵e^(−wt)/5!, and the k-th derivative starts with w^k of it
SETTLED = 25.0


def _eso_coefficients() -> Array:
    """x̂_{k+1} / w^k as polynomials in Z = w/(s+w), k = 0 … 5: shape (6, 6), column j−1 for Z^j.

    e = (1−Z)⁶ y; x̂₁ = (1 − (1−Z)⁶) y; s/w = (1−Z)/Z turns the observer's equations into
    x̂_{k+1} = (1−Z)/Z x̂_k − C(6, k) e. The constant terms cancel: no state feeds through.
    """
    error = polynomial.polypow([1.0, -1.0], ORDER)
    state = -error
    state[0] += 1.0
    rows = [state]
    for k in range(1, ORDER):
        state = polynomial.polymul([1.0, -1.0], rows[-1][1:]) - comb(ORDER, k) * error
        rows.append(state)
    return np.array([row[1:] for row in rows], dtype=np.float64)


def _equal_delay_coefficients() -> Array:
    """(s/w)^k F with F = Z⁶, k = 0 … 5: (1−Z)^k Z^(6−k), shape (6, 6)."""
    rows = []
    for k in range(ORDER):
        row = polynomial.polymul(polynomial.polypow([1.0, -1.0], k), np.eye(ORDER + 1)[ORDER - k])
        rows.append(row[1 : ORDER + 1])
    return np.array(rows)


class _PoleObserver(Observer):
    """All poles at −w: the states are combinations of the cascade's sections."""

    coefficients: ClassVar[Array]

    def transfer(self, omega: Array, order: int) -> Array:
        w = float(self._bandwidth[0])
        return w**order * evaluate(self.coefficients[order], omega, w)  # type: ignore[return-value]

    def settling(self) -> tuple[float, float]:
        return SETTLED / float(self._bandwidth.min()), 0.0

    def _states(self, y: Array, step: float, orders: range, stride: int = 1) -> Array:
        bandwidth = self.bandwidth_of(y.shape[1])
        groups = [np.flatnonzero(bandwidth == w) for w in np.unique(bandwidth)]
        parts = []
        for columns in groups:
            w = float(bandwidth[columns[0]])
            parts.append(self._filtered(y[:, columns] if len(groups) > 1 else y, step, w, orders, stride))
        if len(parts) == 1:
            return parts[0]
        out = np.empty((len(orders), parts[0].shape[1], y.shape[1]))
        for columns, part in zip(groups, parts, strict=True):
            out[:, :, columns] = part
        return out

    def _filtered(self, y: Array, step: float, w: float, orders: range, stride: int) -> Array:
        """Every stride-th sample of the states `orders` at one bandwidth, shape (len(orders), N, m)."""
        scaled = self.coefficients[orders.start : orders.stop] * (w ** np.array(orders))[:, None]
        return combine(cascade(y, step, w, stride), scaled)

    def live(self, step: float) -> LiveObserver:
        return LiveObserver([self._one_step(step, w) for w in self._bandwidth.tolist()])

    def _one_step(self, step: float, w: float) -> LiveStep:
        scaled = self.coefficients * (w ** np.arange(ORDER))[:, None]
        return LiveStep(*one_step(w * step), scaled)

    def derivatives(
        self, y: Array, step: float, count: int, *,
        position: bool = False, delay: float = 0.0, stride: int = 1,
    ) -> Array:  # fmt: skip
        own = self if position else self.torque
        return own._states(shifted(y, step, delay), step, range(count), stride)


class CausalEso(_PoleObserver):
    """The paper's observer: a chain of integrators corrected by the innovation, x̂̇_i = x̂_{i+1} + β_i (y − x̂₁).

    It is causal, so that it can run in a controller. Each state lags by a different time: one equation then
    mixes different instants, which biases stiffness and motor inertia at any bandwidth.
    With gains set by hand the bandwidth, where given, scales them: every pole moves along its ray.
    """

    name = "eso"
    title = "Extended-state observer (the paper's, causal)"
    default_bandwidth = 20.0
    has_disturbance_state = True
    coefficients = _eso_coefficients()

    def __init__(
        self, bandwidth: float | Sequence[float] | Array | None = None, gains: EsoGains | None = None
    ) -> None:
        super().__init__(gains.bandwidth if bandwidth is None and gains is not None else bandwidth)
        self.gains = None if gains is None else gains.scaled(float(self._bandwidth[0]))
        self._filter: StateFilter | None = None
        self._torque: CausalEso = self
        if gains is None:
            return
        unit = gains.scaled(1.0)
        self._filter = StateFilter(np.array(unit.theta))
        if unit.tau != unit.theta:
            self._torque = CausalEso(self._bandwidth)
            self._torque._filter = StateFilter(np.array(unit.tau))

    @property
    def torque(self) -> CausalEso:
        return self._torque

    def for_bandwidth(self, bandwidth: float) -> CausalEso:
        return CausalEso(bandwidth, self.gains)

    def transfer(self, omega: Array, order: int) -> Array:
        if self._filter is None:
            return super().transfer(omega, order)
        return self._filter.transfer(omega, float(self._bandwidth[0]), order)  # type: ignore[return-value]

    def settling(self) -> tuple[float, float]:
        slowest = min(f.decay for f in (self._filter, self._torque._filter) if f) if self._filter else 1.0
        return SETTLED / (slowest * float(self._bandwidth.min())), 0.0

    def _filtered(self, y: Array, step: float, w: float, orders: range, stride: int) -> Array:
        if self._filter is None:
            return super()._filtered(y, step, w, orders, stride)
        return self._filter.states(y, step, w, orders)[:, ::stride]

    def _one_step(self, step: float, w: float) -> LiveStep:
        if self._filter is None:
            return super()._one_step(step, w)
        moved, before, after, _, orthogonal = self._filter.one_step(step, w)
        return LiveStep(moved, before, after, orthogonal * (w ** np.arange(ORDER))[:, None])

    def states(self, segment: Segment, torque_hold: float = 0.0) -> ObserverStates:
        states = self._states(segment.theta, segment.step, range(ORDER))
        tau = self.derivatives(segment.tau, segment.step, 3, delay=torque_hold / 2)
        return ObserverStates(segment.time, states[:5], tau, states[5], self.valid(segment.time))


class EqualDelayEso(_PoleObserver):
    """F = (w/(s+w))⁶ on both θ and τ, derivatives sᵏF.

    All signals have the same delay 6/w, so that the equation stays consistent; the gain droops by 3(ω/w)²
    over the motion, which biases the parameters where w is not far above the motion's frequencies.
    """

    name = "eso-equal-delay"
    title = "Extended-state observer with equal delay"
    default_bandwidth = 50.0
    coefficients = _equal_delay_coefficients()
