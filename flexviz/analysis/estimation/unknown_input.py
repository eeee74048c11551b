"""Unknown input: an arbitrary torque at one place of the robot, as noise of large variance.

A fit given an unknown input relies only on what the input cannot change. If a law that no model describes
acts at this place, everything else agrees with the noise; an input at another place leaves a residual. (The
decoupling of unknown-input observers that isolate faults: J. Chen and R. J. Patton, Robust Model-Based Fault
Diagnosis for Dynamic Systems, 1999.)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from flexviz.analysis.estimation.noise_propagation import TAU, NoisePath, path_through, signal_sensitivity
from flexviz.base.arrays import Array
from flexviz.model.equation import Layout, LinkTerms, local_compliance, time_constants

Side = Literal["motor", "transmission", "link"]
SIDES: tuple[Side, ...] = ("motor", "transmission", "link")


@dataclass(frozen=True)
class UnknownInput:
    """An arbitrary torque u.

    On the motor side, u adds to the motor torque: it passes to the link and deflects the joint. In the
    transmission, u/K adds to the deflection alone. On the link side, u adds to the torque of the link alone.

    Attributes:
        joint: index.
        side: of the transmission, or within it.
        deviation: standard deviation of u per raw sample [Nm].
    """

    joint: int
    side: Side
    deviation: float

    @property
    def variance(self) -> Array:
        """Variance of the raw samples, shape (1,)."""
        return np.array([self.deviation**2])

    def path(self, layout: Layout, x: Array, link: LinkTerms) -> NoisePath:
        """Path of u through the equation."""
        compliance = local_compliance(layout, x, link.torque)
        direct, elastic = (part[TAU] for part in signal_sensitivity(layout, x, link, compliance))
        lag = float(time_constants(layout, x)[self.joint])
        if self.side == "transmission":
            direct = np.zeros_like(direct)
        if self.side == "link":
            elastic, lag = np.zeros_like(elastic), 0.0
        return path_through(TAU, np.array([self.joint]), direct, elastic, lag, link.seen)
