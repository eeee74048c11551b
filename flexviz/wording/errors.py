"""The one measure of a model's error: the rms residual of each joint in multiples of its noise floor.

The noise floor is the rms that the sensors' noise alone would leave: a joint is well described at 1, and
joints of any size compare. On hover, or in brackets, the same error is told in per cent of the joint's torque
(NRMS: rms residual ÷ standard deviation of the recorded torque over all groups; 1 − NRMS² is the share of the
torque that is explained) and in Nm. Without a known noise floor the measure is per cent, without a known
torque Nm. Of all joints the mean is told, in Nm the root mean square.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from flexviz.wording.numbers import listed, number, quantity
from flexviz.wording.records import ErrorsLike

TIMES, PERCENT, TORQUE = "× noise floor", "% of the torque", "Nm"  # units of the measure
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
        floor: shape (n,), the rms that noise alone would leave [Nm]; empty: unknown.
        spread: shape (n,), standard deviation of the joints' torque [Nm]; empty: unknown.
    """

    rms: Sequence[float]
    floor: Sequence[float] = ()
    spread: Sequence[float] = ()

    @cached_property
    def unit(self) -> str:
        """TIMES; PERCENT or TORQUE where less is known."""
        if len(self.floor) == len(self.rms) and all(floor > 0 for floor in self.floor):
            return TIMES
        return PERCENT if len(self.spread) == len(self.rms) else TORQUE

    @cached_property
    def values(self) -> list[float]:
        """The error of each joint in `unit`; NaN where it has none, or no torque."""
        if self.unit == TIMES:
            times, known = normalised(self.rms, self.floor), len(self.spread) == len(self.rms)
            return [
                math.nan if known and not self.spread[j] and not self.rms[j] else value
                for j, value in enumerate(times)
            ]
        return self.shares if self.unit == PERCENT else list(self.rms)

    @cached_property
    def shares(self) -> list[float]:
        """Per cent of each joint's torque; NaN where that is unknown."""
        known = self.spread if len(self.spread) == len(self.rms) else [math.nan] * len(self.rms)
        return [100 * share for share in normalised(self.rms, known)]

    @cached_property
    def mean(self) -> float:
        """The error of all joints in `unit`."""
        if self.unit == TORQUE:
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
        """ "9.03 × noise floor", of a joint or of all."""
        value, unit = self.of(joint), self.unit
        return quantity(value, unit) if unit == TORQUE else f"{number(value, 3)} {unit}"

    def short(self, joint: int | None = None) -> str:
        """ "9.03 ×", "7.5 %"."""
        return self.text(joint).replace(TIMES, "×").replace(PERCENT, "%")

    def hover(self, joint: int | None = None) -> str:
        """What else is known of the same error: "0.442 % of the torque, 51.3 mNm"."""
        share = _mean(self.shares) if joint is None else self.shares[joint]
        parts = [f"{number(share, 3)} {PERCENT}"] if self.unit != PERCENT and math.isfinite(share) else []
        if self.unit != TORQUE:
            parts.append(quantity(total_rms(self.rms) if joint is None else self.rms[joint], "Nm"))
        return ", ".join(parts)

    def whole(self, joint: int | None = None) -> str:
        """ "9.03 × noise floor (0.442 % of the torque, 51.3 mNm)"."""
        rest = self.hover(joint)
        return f"{self.text(joint)} ({rest})" if rest else self.text(joint)


def stated_errors(of: ErrorsLike, spread: Sequence[float]) -> JointErrors:
    """Errors of the validation groups where known, else of the fitted ones: what every page states."""
    held_out = of.rms_validation
    rms = held_out if held_out and all(map(math.isfinite, held_out)) else of.rms
    return JointErrors(rms, of.noise_floor, spread)


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
    """The worst joints first: "joint2 15.0 × noise floor (3.00 % of its torque, 0.300 Nm)"."""
    parts = (f"{joints[j]} {errors.whole(j)}" for j in errors.order[:MAX_LEFT])
    return "; ".join(parts).replace("of the torque", "of its torque")
