"""The errors of a model's joints in words: in per cent of the torque, and in Nm."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from flexviz.base.spelling import listed, number
from flexviz.content.records import TORQUE, JointErrors, total_rms
from flexviz.content.wording.numbers import quantity

SAID_AS_SHARES = ("explained", "unexplained")
"""Kinds of notes that the joints' shares of the torque replace."""
MAX_LEFT = 3  # joints named by `left_text`
LEAST_UNEXPLAINED = 1e-5  # a smaller unexplained share of the torque is not resolved


def percent(share: float, digits: int = 2) -> str:
    """0.0783 as "7.8 %"."""
    return f"{number(100 * share, digits)} %"


def error_text(errors: JointErrors, joint: int | None = None) -> str:
    """ "7.51 % of the torque", of a joint or of all."""
    if not errors.relative:
        return error_in_torque(errors, joint)
    return f"{number(errors.of(joint), 3)} {errors.percent}"


def error_short(errors: JointErrors, joint: int | None = None) -> str:
    """ "7.51 %"."""
    return error_text(errors, joint).replace(errors.percent, "%")


def error_whole(errors: JointErrors, joint: int | None = None) -> str:
    """ "7.51 % of the torque (51.3 mNm)"."""
    text = error_text(errors, joint)
    return f"{text} ({error_in_torque(errors, joint)})" if errors.relative else text


def error_hover(errors: JointErrors, joint: int | None = None) -> str:
    """What else is known of the same error: "51.3 mNm; noise: 0.442 %, 2.10 mNm"."""
    mark = errors.mark
    parts = [error_in_torque(errors, joint)] if errors.relative else []
    if mark is not None and mark.of(joint) > 0:
        also = f", {error_in_torque(mark, joint)}" if errors.relative else ""
        parts.append(f"noise: {error_short(mark, joint)}{also}")
    return "; ".join(parts)


def error_in_torque(errors: JointErrors, joint: int | None = None) -> str:
    """ "51.3 mNm", of a joint or of all: of those that turn and those that slide apart."""
    units = errors.units or (TORQUE,) * len(errors.rms)
    if joint is not None:
        return quantity(errors.rms[joint], units[joint])
    kinds: dict[str, list[float]] = {}
    for unit, value in zip(units, errors.rms, strict=True):
        kinds.setdefault(unit, []).append(value)
    return " and ".join(quantity(total_rms(some), unit) for unit, some in kinds.items())


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
    parts = (f"{joints[j]} {error_whole(errors, j)}" for j in errors.order[:MAX_LEFT])
    return "; ".join(parts).replace("% of the ", "% of its ")
