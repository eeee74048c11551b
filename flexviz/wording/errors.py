"""Errors as per cent of a joint's torque, in Nm, and as multiples of the sensor's noise.

The normalised error (NRMS) of a joint is its rms residual divided by the spread of its torque, the standard
deviation of the recorded torque over all groups; 1 − NRMS² is the share of the torque that is explained.
Without a known spread the texts give Nm only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from flexviz.wording.numbers import listed, number

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
    known = [share for share in normalised(rms, spread) if math.isfinite(share)]
    return sum(known) / len(known) if known else math.nan


def percent(share: float, digits: int = 2) -> str:
    """0.0783 as "7.8 %"."""
    return f"{number(100 * share, digits)} %"


def torque_error_text(rms: Sequence[float], spread: Sequence[float] = ()) -> str:
    """ "7.8 % of the torque (0.310 Nm)": the joints' mean NRMS and total rms; only Nm without a spread."""
    torque = f"{number(total_rms(rms), 3)} Nm"
    share = mean_nrms(rms, spread) if spread else math.nan
    return f"{percent(share)} of the torque ({torque})" if math.isfinite(share) else torque


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


def left_text(
    joints: Sequence[str], rms: Sequence[float], spread: Sequence[float], floor: Sequence[float]
) -> str:
    """Errors of the worst joints, the largest share of the torque first; the noise comes last."""
    parts = []
    for j in by_share(rms, spread)[:MAX_LEFT]:
        noise = f", {number(rms[j] / floor[j], 2)} times the noise" if floor and floor[j] > 0 else ""
        share = normalised(rms, spread)[j] if spread else math.nan
        torque = f"{number(rms[j], 3)} Nm{noise}"
        known = math.isfinite(share)
        parts.append(
            f"{joints[j]} {percent(share)} of its torque ({torque})" if known else f"{joints[j]} {torque}"
        )
    return "; ".join(parts)


def by_share(rms: Sequence[float], spread: Sequence[float]) -> list[int]:
    """Joints by the share of their torque that stays, the largest first; by Nm without a spread."""
    size = [s if math.isfinite(s) else 0.0 for s in normalised(rms, spread)] if spread else list(rms)
    return sorted(range(len(size)), key=lambda j: -size[j])
