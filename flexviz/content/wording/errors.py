"""The one measure of a model's error: the rms residual of each joint in per cent of its torque, and in Nm.

Per cent are of the spread of the recorded torque: its standard deviation over all groups, which no model
changes (NRMS: rms residual ÷ that spread; 1 − NRMS² is the share of the torque that is explained). Joints of
any size compare. The rms that the sensors' noise alone would leave is a mark on the same axis, never a unit.
Without a known torque the measure is Nm. Of all joints the mean is stated, in Nm the root mean square.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from flexviz.base.units import unit_of_all
from flexviz.content.wording.numbers import listed, number, quantity
from flexviz.content.wording.records import ErrorsLike

PERCENT, TORQUE = "% of the torque", "Nm"  # units of the measure
SAID_AS_SHARES = ("explained", "unexplained")
"""Kinds of notes that the joints' shares of the torque replace."""
MAX_LEFT = 3  # joints named by `left_text`
LEAST_UNEXPLAINED = 1e-5  # a smaller unexplained share of the torque is not resolved


def total_rms(per_joint: Sequence[float]) -> float:
    """Root mean square over the joints' rms values [Nm]."""
    return math.sqrt(sum(value**2 for value in per_joint) / len(per_joint))


def normalised(rms: Sequence[float], spread: Sequence[float]) -> list[float]:
    """NRMS of each joint; NaN where the torque is constant."""
    return [error / width if width > 0 else math.nan for error, width in zip(rms, spread, strict=True)]


def mean_nrms(rms: Sequence[float], spread: Sequence[float]) -> float:
    """Mean of the joints' NRMS; NaN where no torque varies."""
    return _mean(normalised(rms, spread))


def percent(share: float, digits: int = 2) -> str:
    """0.0783 as "7.8 %"."""
    return f"{number(100 * share, digits)} %"


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

    @cached_property
    def torque(self) -> str:
        """Unit of the joints' torque: "Nm", "N", or "N, Nm" where some slide."""
        return unit_of_all(self.units)

    @cached_property
    def unit(self) -> str:
        """PERCENT; that of the torque where its spread is not known."""
        return PERCENT if self.relative else self.torque

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

    def text(self, joint: int | None = None) -> str:
        """ "7.51 % of the torque", of a joint or of all."""
        return f"{number(self.of(joint), 3)} {PERCENT}" if self.relative else self.in_torque(joint)

    def short(self, joint: int | None = None) -> str:
        """ "7.51 %"."""
        return self.text(joint).replace(PERCENT, "%")

    def hover(self, joint: int | None = None) -> str:
        """What else is known of the same error: "51.3 mNm; noise: 0.442 %, 2.10 mNm"."""
        mark = self.mark
        parts = [self.in_torque(joint)] if self.relative else []
        if mark is not None and mark.of(joint) > 0:
            also = f", {mark.in_torque(joint)}" if self.relative else ""
            parts.append(f"noise: {mark.short(joint)}{also}")
        return "; ".join(parts)

    def other(self, joint: int, unit: str) -> str:
        """The error of a joint, not in this unit but in the other one; empty if it is not known there."""
        share = self.shares[joint]
        if unit == PERCENT:
            return self.in_torque(joint)
        return f"{number(share, 3)} {PERCENT}" if math.isfinite(share) else ""

    def whole(self, joint: int | None = None) -> str:
        """ "7.51 % of the torque (51.3 mNm)"."""
        return f"{self.text(joint)} ({self.in_torque(joint)})" if self.relative else self.text(joint)

    def in_torque(self, joint: int | None = None) -> str:
        """ "51.3 mNm", of a joint or of all: of those that turn and those that slide apart."""
        units = self.units or (TORQUE,) * len(self.rms)
        if joint is not None:
            return quantity(self.rms[joint], units[joint])
        kinds: dict[str, list[float]] = {}
        for unit, value in zip(units, self.rms, strict=True):
            kinds.setdefault(unit, []).append(value)
        return " and ".join(quantity(total_rms(some), unit) for unit, some in kinds.items())


def stated_errors(of: ErrorsLike, spread: Sequence[float]) -> JointErrors:
    """Errors of the validation groups where known, else of the fitted ones: what every page states."""
    held_out = of.rms_validation
    rms = held_out if held_out and all(map(math.isfinite, held_out)) else of.rms
    return JointErrors(rms, spread, of.noise_floor, of.units)


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return sum(known) / len(known) if known else math.nan


def noise_text(shares: Mapping[str, float]) -> str:
    """What noise hides, by its share in the torque of each joint named.

    >>> noise_text({"joint1": 0.113, "joint2": 1.0})
    'noise is 11 % of the torque of joint1 and 100 % of the torque of joint2, and hides what is smaller'
    """
    parts = [f"{percent(share)} of the torque of {joint}" for joint, share in shares.items()]
    return f"noise is {listed(parts)}, and hides what is smaller"


def explained(error: float) -> str:
    """Share of the torque that a model of this NRMS explains: "96 %", "99.4 %", "> 99.999 %"."""
    left = error**2
    if not math.isfinite(left):
        return "–"
    if left < LEAST_UNEXPLAINED:
        return "> 99.999 %"
    decimals = max(-math.floor(math.log10(100 * left)), 0)
    return f"{100 * max(1 - left, 0.0):.{decimals}f} %"


def left_text(joints: Sequence[str], errors: JointErrors) -> str:
    """The worst joints first: "joint2 3.00 % of its torque (0.300 Nm)"."""
    parts = (f"{joints[j]} {errors.whole(j)}" for j in errors.order[:MAX_LEFT])
    return "; ".join(parts).replace("of the torque", "of its torque")
