"""Base class of the observers: linear filters from a sampled signal to its smoothed derivatives."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.base.errors import InputError
from flexviz.data.measurements import Segment
from flexviz.model.observers.gains import EsoGains
from flexviz.model.observers.live import LiveObserver

THETA_DERIVATIVES = 5  # θ … θ⁗
TAU_DERIVATIVES = 3  # τ, τ̇, τ̈
BANDWIDTH_LIMITS = (0.05, 20000.0)  # [rad/s]


@dataclass(frozen=True)
class ObserverStates:
    """Derivatives of one segment at its own sampling rate.

    Attributes:
        time: shape (N,) [s].
        theta: shape (5, N, n), the motor angle and its derivatives up to the fourth [rad/s^k].
        tau: shape (3, N, n), the motor torque and its derivatives up to the second [Nm/s^k].
        disturbance: shape (N, n), the sixth ESO state of θ [rad/s⁵]; None for observers without one.
        valid: shape (N,), False within the start-up or end transients.
    """

    time: Array
    theta: Array
    tau: Array
    disturbance: Array | None
    valid: Bools


class Observer(ABC):
    """A linear time-invariant filter with transfer functions y → x̂_k, k = 0 … 4.

    The equation needs θ to its fourth derivative and τ to its second: x̂_k = s^k F(s) y with a low-pass F. If
    F is the same for all k and signals, a linear equation still holds for the filtered signals; what remains
    are errors of products where F is not 1 over the motion, and noise that grows as ω^k.

    Attributes:
        bandwidth: one number for all joints or one per joint [rad/s].
        zero_phase: whether its derivatives have no lag.
        has_disturbance_state: whether it estimates a disturbance in addition to the derivatives.
        gains: those set by hand, at the (first joint's) bandwidth; only the extended-state observer has such.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    default_bandwidth: ClassVar[float]
    zero_phase: ClassVar[bool] = False
    has_disturbance_state: ClassVar[bool] = False
    gains: EsoGains | None = None

    def __init__(self, bandwidth: float | Sequence[float] | Array | None = None) -> None:
        value = np.atleast_1d(np.asarray(self.default_bandwidth if bandwidth is None else bandwidth, float))
        low, high = BANDWIDTH_LIMITS
        if value.ndim != 1 or not np.all(np.isfinite(value)) or np.any(value < low) or np.any(value > high):
            raise InputError(
                f"observer bandwidth {bandwidth!r} is not between {low:g} and {high:g} rad/s "
                "(one number or one per joint)"
            )
        self._bandwidth = value

    @property
    def bandwidth(self) -> float | Array:
        """The bandwidth [rad/s]: a float where common to all joints, else shape (n,)."""
        return float(self._bandwidth[0]) if self._bandwidth.size == 1 else self._bandwidth

    def bandwidth_of(self, joints: int) -> Array:
        """The bandwidth of each joint, shape (joints,) [rad/s]."""
        if self._bandwidth.size not in (1, joints):
            raise InputError(
                f"{self._bandwidth.size} bandwidths were given for {joints} joints: "
                f"give one number or {joints} numbers"
            )
        return np.broadcast_to(self._bandwidth, (joints,)).astype(float)

    @property
    def torque(self) -> Self:
        """The observer of τ; another one only if its gains differ from those of θ."""
        return self

    def for_bandwidth(self, bandwidth: float) -> "Observer":
        """The same observer with one bandwidth [rad/s]."""
        return type(self)(bandwidth)

    @abstractmethod
    def transfer(self, omega: Array, order: int) -> Array:
        """Complex gain from the signal to its `order`-th derivative estimate at ω [rad/s], shape (len(ω),).

        Uses the first joint's bandwidth.
        """

    def cutoff(self, order: int) -> float | None:
        """Frequency above which the gain times ω^order is negligible [rad/s]; None when it never is."""
        return None

    @abstractmethod
    def derivatives(
        self, y: Array, step: float, count: int, *,
        position: bool = False, delay: float = 0.0, stride: int = 1,
    ) -> Array:  # fmt: skip
        """Smoothed derivatives 0 … count−1 of a signal.

        Args:
            y: shape (N, n), uniformly sampled.
            step: sampling step [s].
            count: number of derivatives including the zeroth, up to 5.
            position: y is a position, which continues smoothly beyond the segment's ends; else a torque,
                which may jump.
            delay: the signal is delayed by this [s] (used for a torque held by its controller).
            stride: only every stride-th sample is returned.

        Returns:
            shape (count, ceil(N / stride), n).
        """

    def live(self, step: float) -> LiveObserver:
        """The observer fed with one sample every `step` [s]; for τ, `self.torque.live(step)`.

        Raises:
            InputError: for a zero-phase observer, which needs later samples.
        """
        raise InputError(
            f'"{self.name}" needs later samples, expected a causal observer: eso, eso-equal-delay'
        )

    @abstractmethod
    def settling(self) -> tuple[float, float]:
        """Time [s] after the start and before the end of a segment within which the states are transients."""

    def states(self, segment: Segment, torque_hold: float = 0.0) -> ObserverStates:
        """All states at the sampling rate of the segment, for display."""
        return ObserverStates(
            time=segment.time,
            theta=self.derivatives(segment.theta, segment.step, THETA_DERIVATIVES, position=True),
            tau=self.derivatives(segment.tau, segment.step, TAU_DERIVATIVES, delay=torque_hold / 2),
            disturbance=None,
            valid=self.valid(segment.time),
        )

    def valid(self, time: Array) -> Bools:
        """Samples outside the transients, shape (N,)."""
        start, end = self.settling()
        edge = 1e-9 * max(1.0, abs(float(time[-1])))
        return (time >= time[0] + start - edge) & (time <= time[-1] - end + edge)

    def lag(self, step: float, frequency: float = 1.0) -> float:
        """Largest phase delay of the five θ states at a frequency [Hz], in seconds."""
        omega = np.array([2 * np.pi * frequency])
        delays = []
        for k in range(THETA_DERIVATIVES):
            relative = self.transfer(omega, k)[0] / (1j * omega[0]) ** k
            delays.append(-np.angle(relative) / omega[0])
        return float(max(delays, key=abs))

    def noise_gain(self, step: float) -> Array:
        """Standard deviation of each θ derivative per unit of white measurement noise, shape (5,) [1/s^k]."""
        omega = np.linspace(0.0, np.pi / step, 8193)
        gains = [np.abs(self.transfer(omega, k)) ** 2 for k in range(THETA_DERIVATIVES)]
        return np.sqrt([(g.sum() - (g[0] + g[-1]) / 2) / (len(omega) - 1) for g in gains])  # trapezoids


def shifted(y: Array, step: float, delay: float) -> Array:
    """y(t − delay) by linear interpolation, shape (N, n); the first samples are held."""
    if delay == 0.0:
        return y
    whole, part = divmod(delay / step, 1.0)
    index = np.maximum(np.arange(len(y)) - int(whole), 0)
    return (1 - part) * y[index] + part * y[np.maximum(index - 1, 0)]


def largest_divisor(number: int, most: float) -> int:
    """The largest divisor up to `most`, or 1: every how many samples are enough for every number-th one."""
    return max(d for d in range(1, number + 1) if d == 1 or (number % d == 0 and d <= most))
