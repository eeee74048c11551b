"""A zero-phase filter that is exactly flat over the motion's band."""

from typing import ClassVar

import numpy as np

from flexviz.observers.zero_phase import Array, ZeroPhaseObserver


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

    def cutoff(self) -> float:
        return self.ratio * float(self._bandwidth.max())

    def memory(self) -> float:
        return 50.0 / float(self._bandwidth.min())
