"""A torque that is a sine of time, whatever the robot does: something beside it vibrates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.residual_location import HARMONICS
from flexviz.analysis.diagnosis.residuals import SlowResidual
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.estimation import NARROW_HERTZ
from flexviz.base._scipy import sp


def vibration(data: SlowResidual, joint: int) -> float | None:
    """Frequency [Hz] of the sine that explains more of a joint's residual than it leaves; None without one.

    It has a phase of its own in each stretch. Stretches that do not last longer than the harmonics of one
    motion explain nothing: part of a period resembles any slow course.
    """
    stretches = [rows.start + np.flatnonzero(data.shown[rows]) for rows in data.stretches]
    stretches = [rows for rows in stretches if len(rows)]
    lengths = [float(np.ptp(data.time[rows])) for rows in stretches]
    longest, own = max(lengths, default=0.0), data.residual[:, [joint]]
    if NARROW_HERTZ * longest <= HARMONICS:
        return None

    def share(hertz: float, values: NDArray[np.float64] = own, periods: float = HARMONICS) -> float:
        """Largest share of the sum of squares of values (N, K) that a sine of so many periods explains."""
        total, explained = np.zeros((2, values.shape[1]))
        for rows, length in zip(stretches, lengths, strict=True):
            phase = 2 * np.pi * hertz * data.time[rows]
            total += np.sum(values[rows] ** 2, axis=0)
            if hertz * length >= periods:
                pair = np.stack((np.sin(phase), np.cos(phase)), axis=1)
                explained += np.sum((pair @ np.linalg.lstsq(pair, values[rows])[0]) ** 2, axis=0)
        return float(np.max(explained / np.maximum(total, 1e-300)))

    hertz = np.arange(HARMONICS / longest, NARROW_HERTZ, 0.5 / longest)
    at = max(hertz.tolist(), key=share)
    near = at - 0.5 / longest, at + 0.5 / longest
    best = sp.optimize.minimize_scalar(lambda f: -share(f), bounds=near, method="bounded")
    # a law may depend on the motion of another joint
    slower = max(share(best.x / (k + 1), data.theta[1], 0.0) for k in range(HARMONICS))
    return float(best.x) if -2 * best.fun > 1 and slower < THRESHOLDS.evidence.share else None
