"""Zero-phase observers: a real, even gain G(ω) applied in the frequency domain, derivatives by (iω)^k.

The segment is extended at both ends by reflection: odd for positions, so that value and slope are continuous;
even for torques, because an initial spike of the torque would offset an odd reflection. Errors of the
extension stay within the filter's memory, which `settling` drops.
"""

from abc import abstractmethod
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from flexviz.base.arrays import Array
from flexviz.base.fourier import fast_length
from flexviz.model.observers.base import Observer

NEGLIGIBLE = 1e-8  # gain times a power of ω, relative to that power of the bandwidth, above a cutoff


class _Continued:
    """A record continued by reflection about its trend, of which every `stride`-th sample is wanted.

    Stored as (m, N): transforms and means along contiguous rows are faster.

    Attributes:
        slope: shape (m,), derivative of the trend, which is a line for odd reflection, the mean for even.
        span: length of the continued record [s].
        half: frequencies up to the Nyquist rate of the wanted samples.
    """

    def __init__(self, y: Array, step: float, margin: float, stride: int, odd: bool) -> None:
        self._count, columns = y.shape
        count, rows = self._count, y.T
        # the continuation is a multiple of the stride so that the samples are among those of the whole
        wanted = int(np.ceil(margin / step / stride)) * stride
        pad = min(wanted, (count - 1) // stride * stride)
        self._step, self._stride, self._pad = step, stride, pad
        self.half = fast_length(-(-(count + 2 * pad) // (2 * stride)))
        self._values = np.zeros((columns, 2 * self.half * stride))
        self.span = self._values.shape[1] * step
        body = self._values[:, pad : pad + count]
        if odd:
            self.slope = (y[-1] - y[0]) / max((count - 1) * step, step)
            self._first = y[0]
            np.subtract(rows, self.trend(1).T, out=body)
        else:
            self.slope = np.zeros(columns)
            self._first = np.ascontiguousarray(rows).mean(axis=1)
            np.subtract(rows, self._first[:, None], out=body)
        sign = -1.0 if odd else 1.0
        np.multiply(body[:, pad:0:-1], sign, out=self._values[:, :pad])
        np.multiply(body[:, -2 : -pad - 2 : -1], sign, out=self._values[:, pad + count : 2 * pad + count])

    def trend(self, stride: int) -> Array:
        """What is subtracted before the reflection, at every stride-th sample, shape (N', m)."""
        return self._first + self.slope * (self._step * np.arange(0, self._count, stride))[:, None]

    def spectrum(self, band: float | None) -> NDArray[np.complex128]:
        """Transform up to the first multiple of the wanted samples' Nyquist rate above a band [rad/s].

        Shape (m, F); None: all of it.
        """
        within = self._stride
        if band is not None:
            within = min(within, max(1, int(np.ceil(band * self.span / (2 * np.pi * self.half) - 1e-9))))
        return np.fft.rfft(self._values)[:, : within * self.half + 1]

    def samples(self, spectrum: NDArray[np.complex128], order: int) -> Array:
        """The wanted samples of the record's derivative, shape (N', m), from a spectrum without i^order.

        Their transform is the sum of the parts that they fold onto each other: exactly the samples that a
        transform back of the whole spectrum contains, at the cost of those that are wanted.
        """
        half, factor = self.half, 1j**order / self._stride
        folded = spectrum[:, : half + 1] * factor
        for k, start in enumerate(range(half, spectrum.shape[1] - 1, half)):
            part = spectrum[:, start : start + half + 1] * factor
            folded += part if k % 2 else np.conj(part[:, ::-1])
        first, count = self._pad // self._stride, -(-self._count // self._stride)
        return np.fft.irfft(folded, 2 * half)[:, first : first + count].T


class ZeroPhaseObserver(Observer):
    """A zero-phase low-pass filter, the same on θ and τ: x̂_k(ω) = (iω)^k G(ω) y(ω) with a real, even gain G.

    Nothing lags, so that a narrow band costs only what G takes from the motion. It needs the whole recording.
    """

    zero_phase = True

    @abstractmethod
    def gain(self, omega: Array, bandwidth: Array) -> Array:
        """Real gain at ω (shape (F,)) for each bandwidth (shape (m,)): shape (F, m)."""

    @abstractmethod
    def memory(self) -> float:
        """Length of the filter's impulse response to either side [s]."""

    def transfer(self, omega: Array, order: int) -> Array:
        return self.gain(omega, self._bandwidth[:1])[:, 0] * omega**order * 1j**order  # type: ignore[return-value]

    def settling(self) -> tuple[float, float]:
        return self.memory(), self.memory()

    def derivatives(
        self, y: Array, step: float, count: int, *,
        position: bool = False, delay: float = 0.0, stride: int = 1, every: int = 1,
    ) -> Array:  # fmt: skip
        """As of any observer; of its `count` derivatives every `every`-th, the first being the signal."""
        continued = _Continued(y, step, 3 * self.memory(), stride, odd=position)
        filtered = continued.spectrum(self.cutoff(count - 1))
        grid = filtered.shape[1], continued.span
        if self._bandwidth.size == 1:
            filtered *= _common_gain(self, *grid)
        else:
            filtered *= self.gain(_frequencies(*grid), self.bandwidth_of(y.shape[1])).T
        omega = _frequencies(*grid)
        if delay:
            filtered *= np.exp(-1j * delay * omega)
        filtered[:, -1] = 0.0  # the Nyquist bin has no sign, so its odd derivatives have no meaning
        orders, factor = range(0, count, every), omega**every
        out = np.empty((len(orders), -(-len(y) // stride), y.shape[1]))
        for k, order in enumerate(orders):
            if order:
                filtered *= factor
            out[k] = continued.samples(filtered, order)
        out[0] += continued.trend(stride) - continued.slope * delay
        if count > 1 and every == 1:
            out[1] += continued.slope
        return out


def _frequencies(count: int, span: float) -> Array:
    """The first frequencies of a transform over `span` [s], shape (count,) [rad/s]."""
    return np.arange(count, dtype=float) * (2 * np.pi / span)


@lru_cache(maxsize=8)
def _common_gain(observer: ZeroPhaseObserver, count: int, span: float) -> Array:
    """Gain of an observer of one bandwidth at `_frequencies(count, span)`, shape (count,), read-only."""
    gain = observer.gain(_frequencies(count, span), np.atleast_1d(observer.bandwidth))[:, 0]
    gain.flags.writeable = False
    return gain


class ButterworthZeroPhase(ZeroPhaseObserver):
    """Fourth-order Butterworth run forwards and backwards: gain 1/(1 + (ω/w)⁸).

    Flat over the motion to (ω/w)⁸, steep enough that noise in the fourth derivative does not pull the motor
    inertia to zero: the default for plain fits, with w chosen by the least residual.
    """

    name = "butterworth-zero-phase"
    title = "Butterworth, zero phase"
    default_bandwidth = 2 * np.pi * 5.0
    order = 4

    def gain(self, omega: Array, bandwidth: Array) -> Array:
        fourth = np.square(np.square(omega[:, None] / bandwidth))
        return 1.0 / (1.0 + np.square(fourth))

    def cutoff(self, order: int) -> float:
        return NEGLIGIBLE ** (1 / (order - 8)) * float(self._bandwidth.max())  # (ω/w)^(order − 8)

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

    def cutoff(self, order: int) -> float:
        return NEGLIGIBLE ** (1 / (order - 12)) * float(self._bandwidth.max())  # (ω/w)^(order − 12)

    def memory(self) -> float:
        return 18.0 / float(self._bandwidth.min())


class FlatZeroPhase(ZeroPhaseObserver):
    """Gain 1 up to w, a smooth (infinitely differentiable) transition, 0 from 1.8 w.

    Products of filtered signals are not the filtered products: with a Butterworth gain at 15 Hz, the droop of
    6e-4 at 6 Hz leaves a residual far above the noise of a good encoder. A gain that is exactly one where the
    robot moves leaves none.
    """

    name = "flat-zero-phase"
    title = "Flat band, zero phase"
    default_bandwidth = 2 * np.pi * 14.0
    ratio: ClassVar[float] = 1.8

    def gain(self, omega: Array, bandwidth: Array) -> Array:
        place = (omega[:, None] - bandwidth) / ((self.ratio - 1) * bandwidth)
        u = np.clip(place, 1e-3, 1 - 1e-3)  # beyond, the step differs from 0 and 1 by less than e⁻⁹⁹⁸
        rise = 1.0 / (1.0 + np.exp(np.clip(1 / (1 - u) - 1 / u, -500, 500)))
        return np.where(place <= 0, 1.0, np.where(place >= 1, 0.0, rise))

    def cutoff(self, order: int) -> float:
        return self.ratio * float(self._bandwidth.max())

    def memory(self) -> float:
        return 50.0 / float(self._bandwidth.min())
