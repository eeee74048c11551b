"""What a link encoder shows of a joint's stiffness."""

from __future__ import annotations

from typing import Literal

from pydantic.dataclasses import dataclass

from flexviz.base.fields import RECORD, Nullable, Number
from flexviz.content.wording import number, si_scale


@dataclass(frozen=True, config=RECORD)
class LinkSide:
    """The stiffness of one joint by its link encoder, which no fit has seen.

    Attributes:
        joint: its name.
        torque: that in the joint is "measured" by a sensor or "computed" by the rigid link.
        stiffness: [Nm/rad]; None where the deflection shows at most a lower limit.
        low, high: 95 % interval [Nm/rad]; None where it is open.
        hysteresis: of the deflection, by direction [rad].
        lag: of the link encoder behind the motor's [s], with viscous friction of the link.
        agrees: false where the intervals of both sides exclude each other.
    """

    joint: str
    torque: Literal["measured", "computed"]
    stiffness: Nullable
    low: Nullable
    high: Nullable
    hysteresis: Number
    lag: Number
    agrees: bool

    @property
    def text(self) -> str:
        """ "10.9 (6.74 … 28.5) MNm/rad, do not trust the motor side" """
        size = self.stiffness or self.low or self.high
        factor, unit = si_scale(size, "Nm/rad") if size else (1.0, "Nm/rad")
        low, high = (None if v is None else number(factor * v, 3) for v in (self.low, self.high))
        if self.stiffness is not None:
            shown = f"{number(factor * self.stiffness, 3)} ({low} … {high}) {unit}"
        else:
            shown = "not shown" if low is None else f"at least {low} {unit}"
        return shown + ("" if self.agrees else ", do not trust the motor side")
