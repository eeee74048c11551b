"""Zero-phase observers: a real, even gain G(ω) applied in the frequency domain, derivatives by (iω)^k.

The segment is continued at both ends by reflection: positions odd, so that neither value nor slope jumps;
torques even, because a controller's torque may start with a spike, about which an odd reflection would turn
everything. What the reflection gets wrong stays within the filter's memory, which `settling` drops.
"""

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from flexviz._scipy import fft
from flexviz.observers.base import Observer

Array = NDArray[np.float64]


def spectral_derivatives(
    y: Array, step: float, gain, count: int, *, margin: float, delay: float = 0.0, stride: int = 1,
    band: float | None = None, odd: bool = True,
) -> Array:  # fmt: skip
    """Derivatives 0 … count−1 of y after a zero-phase gain.

    Args:
        y: shape (N, m), uniformly sampled with `step` [s].
        gain: function of ω [rad/s], shape (F,), to the real gain, shape (F,) or (F, m).
        count: number of derivatives including the zeroth.
        margin: length of the reflected continuation at each end [s].
        delay: y is delayed by this [s].
        stride: every stride-th sample is returned.
        band: gain · ω⁴ is negligible above this [rad/s]; None where it never is.
        odd: reflect oddly at the ends (positions), else evenly (torques).

    Returns:
        shape (count, ceil(N / stride), m).
    """
    samples, columns = y.shape
    # Samples are picked from a finer grid that still holds everything the gain lets through: cutting a
    # spectrum
    # that ω⁴ has lifted would ring over the whole segment.
    inner = 1
    if band is not None:
        inner = max(
            d for d in range(1, stride + 1) if stride % d == 0 and (d == 1 or np.pi / (d * step) >= band)
        )
    outer, stride = stride // inner, inner
    # the continuation is a multiple of the stride so that the decimated grid meets the samples
    pad = min(int(np.ceil(margin / step / stride)) * stride, (samples - 1) // stride * stride)
    short = fft.next_fast_len(-(-(samples + 2 * pad) // stride), real=True)
    total = short * stride
    if odd:
        slope = (y[-1] - y[0]) / max((samples - 1) * step, step)
        trend = y[0] + slope * (step * np.arange(samples))[:, None]
    else:
        slope = np.zeros(columns)
        trend = np.broadcast_to(y.mean(axis=0), y.shape)

    padded = np.zeros((total, columns))
    body = y - trend
    padded[pad : pad + samples] = body
    sign = -1.0 if odd else 1.0
    padded[:pad] = sign * body[pad:0:-1]
    padded[pad + samples : 2 * pad + samples] = sign * body[-2 : -pad - 2 : -1]
    spectrum = fft.rfft(padded, axis=0)
    kept = short // 2 + 1
    omega = 2 * np.pi * np.arange(kept) / (total * step)
    weight = np.asarray(gain(omega), float)
    if weight.ndim == 1:
        weight = weight[:, None]
    filtered = spectrum[:kept] * weight / stride
    if delay:
        filtered = filtered * np.exp(-1j * omega * delay)[:, None]
    if short % 2 == 0:
        filtered[-1] = 0.0  # the Nyquist bin has no sign, so its odd derivatives have no meaning
    out = np.empty((count, -(-samples // (stride * outer)), columns))
    first = pad // stride
    picked = slice(first, first + (out.shape[1] - 1) * outer + 1, outer)
    for k in range(count):
        if k:
            filtered = filtered * (1j * omega)[:, None]
        out[k] = fft.irfft(filtered, short, axis=0)[picked]
    out[0] += trend[:: stride * outer] - slope * delay
    if count > 1:
        out[1] += slope
    return out


class ZeroPhaseObserver(Observer):
    """A zero-phase low-pass filter, the same on θ and τ."""

    zero_phase = True

    @abstractmethod
    def gain(self, omega: Array, bandwidth: Array) -> Array:
        """Real gain at ω (shape (F,)) for each bandwidth (shape (m,)): shape (F, m)."""

    @abstractmethod
    def memory(self) -> float:
        """Length of the filter's impulse response to either side [s]."""

    def transfer(self, omega: Array, order: int) -> Array:
        return self.gain(omega, self._bandwidth[:1])[:, 0] * (1j * omega) ** order  # type: ignore[return-value]

    def settling(self) -> tuple[float, float]:
        return self.memory(), self.memory()

    def derivatives(
        self,
        y: Array,
        step: float,
        count: int,
        *,
        position: bool = False,
        delay: float = 0.0,
        stride: int = 1,
    ) -> Array:
        bandwidth = self.bandwidth_of(y.shape[1]) if self._bandwidth.size > 1 else self._bandwidth
        return spectral_derivatives(
            y,
            step,
            lambda omega: self.gain(omega, bandwidth),
            count,
            margin=3 * self.memory(),
            delay=delay,
            stride=stride,
            band=self.cutoff(),
            odd=position,
        )

    def cutoff(self) -> float | None:
        """Frequency above which the gain times ω⁴ is negligible [rad/s]; None when it never is."""
        return None


class ButterworthZeroPhase(ZeroPhaseObserver):
    """Fourth-order Butterworth run forwards and backwards: gain 1/(1 + (ω/w)⁸)."""

    name = "butterworth-zero-phase"
    title = "Butterworth, zero phase"
    default_bandwidth = 2 * np.pi * 5.0
    order = 4

    def gain(self, omega: Array, bandwidth: Array) -> Array:
        return 1.0 / (1.0 + (omega[:, None] / bandwidth) ** (2 * self.order))

    def cutoff(self) -> float:
        return 60.0 * float(self._bandwidth.max())  # (ω/w)⁻⁸⁺⁴ = 1e-7

    def memory(self) -> float:
        # the slowest poles of the fourth-order filter decay at 0.38 w: e^(−0.38·25) = 7e-5, 0.8 s at 5 Hz
        return 25.0 / float(self._bandwidth.min())


class EsoZeroPhase(ZeroPhaseObserver):
    """F = (w/(s+w))⁶ run forwards and backwards: gain (1 + (ω/w)²)⁻⁶; no lag, but a droop of 6(ω/w)²."""

    name = "eso-zero-phase"
    title = "Extended-state observer, zero phase"
    default_bandwidth = 100.0

    def gain(self, omega: Array, bandwidth: Array) -> Array:
        return (1.0 + (omega[:, None] / bandwidth) ** 2) ** -6

    def cutoff(self) -> float:
        return 60.0 * float(self._bandwidth.max())  # ω⁻⁸ of the gain and ω⁴: 1e-7

    def memory(self) -> float:
        return 18.0 / float(self._bandwidth.min())
