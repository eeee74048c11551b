"""The one measure of a model's error: the rms residual of each joint in per cent of its torque, and in Nm.

Per cent are of the spread of the recorded torque: its standard deviation over all groups, which no model
changes (NRMS: rms residual ÷ that spread; 1 − NRMS² is the share of the torque that is explained). Joints of
any size compare. The rms that the sensors' noise alone would leave is a mark on the same axis, never a unit.
Without a known torque the measure is Nm. Of joints that follow goals it is the error of their motion: rad,
and per cent of how far the goals are ahead. Of all joints the mean is stated, in Nm the root mean square.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from flexviz.base.units import unit_of_all
from flexviz.content.records.protocols import ErrorsLike

PERCENT, TORQUE = "% of the torque", "Nm"  # units of the measure
FOLLOWING = "% of the following error"  # of joints that follow goals: of how far the goals are ahead [rad]


def total_rms(per_joint: Sequence[float]) -> float:
    """Root mean square over the joints' rms values [Nm]."""
    return math.sqrt(sum(value**2 for value in per_joint) / len(per_joint))


def percent_of(units: Sequence[str]) -> str:
    """What per cent are of, of joints with these units: PERCENT, or FOLLOWING where they are angles."""
    return FOLLOWING if units and set(units) <= {"rad", "m"} else PERCENT


def normalised(rms: Sequence[float], spread: Sequence[float]) -> list[float]:
    """NRMS of each joint; NaN where the torque is constant."""
    return [error / width if width > 0 else math.nan for error, width in zip(rms, spread, strict=True)]


def mean_nrms(rms: Sequence[float], spread: Sequence[float]) -> float:
    """Mean of the joints' NRMS; NaN where no torque varies."""
    return _mean(normalised(rms, spread))


@dataclass(frozen=True)
class JointErrors:
    """Errors of the joints with one model.

    Attributes:
        rms: shape (n,) [Nm].
        spread: shape (n,), standard deviation of the joints' torque [Nm]; empty: unknown.
        noise: shape (n,), the rms that the sensors' noise alone would leave [Nm]; empty: unknown.
        units: shape (n,), "N" of joints that slide, for rms, spread and noise; empty: all are in Nm.
    """

    rms: Sequence[float]
    spread: Sequence[float] = ()
    noise: Sequence[float] = ()
    units: Sequence[str] = ()

    def __str__(self) -> str:
        return f"{self.mean:.3g} {self.unit}"

    @cached_property
    def torque(self) -> str:
        """Unit of the joints' torque: "Nm", "N", or "N, Nm" where some slide."""
        return unit_of_all(self.units)

    @cached_property
    def unit(self) -> str:
        """PERCENT, or FOLLOWING; that of the torque where its spread is not known."""
        return self.percent if self.relative else self.torque

    @property
    def percent(self) -> str:
        """What per cent are of."""
        return percent_of(self.units)

    @property
    def relative(self) -> bool:
        """Whether the errors are in per cent: the spread of the torque is known."""
        return len(self.spread) == len(self.rms)

    @cached_property
    def values(self) -> list[float]:
        """The error of each joint in `unit`; NaN where it has no torque."""
        return self.shares if self.relative else list(self.rms)

    @cached_property
    def mark(self) -> JointErrors | None:
        """The noise as an error of the same kind; None if it is unknown."""
        known = len(self.noise) == len(self.rms) and all(math.isfinite(one) for one in self.noise)
        return JointErrors(self.noise, self.spread, (), self.units) if known else None

    @cached_property
    def shares(self) -> list[float]:
        """Per cent of each joint's torque; NaN where that is unknown."""
        known = self.spread if self.relative else [math.nan] * len(self.rms)
        return [100 * share for share in normalised(self.rms, known)]

    @cached_property
    def mean(self) -> float:
        """The error of all joints in `unit`."""
        if not self.relative:
            return total_rms(self.rms)
        return _mean(self.values)

    def of(self, joint: int | None = None) -> float:
        """The error of a joint, or of all (None), in `unit`."""
        return self.mean if joint is None else self.values[joint]

    @cached_property
    def order(self) -> list[int]:
        """The joints, the largest error first."""
        size = [value if math.isfinite(value) else -1.0 for value in self.values]
        return sorted(range(len(size)), key=lambda j: -size[j])


def stated_errors(of: ErrorsLike, spread: Sequence[float]) -> JointErrors:
    """Errors of the validation groups where known, else of the fitted ones: what every page states."""
    held_out = of.rms_validation
    rms = held_out if held_out and all(map(math.isfinite, held_out)) else of.rms
    return JointErrors(rms, spread, of.noise_floor, of.units)


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return sum(known) / len(known) if known else math.nan
