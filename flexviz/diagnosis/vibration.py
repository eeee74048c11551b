"""A torque that is a sine of time, whatever the robot does: something beside it vibrates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.residuals import SLOW_HERTZ, SlowResidual

Array = NDArray[np.float64]

CYCLES = 3.0  # least number of periods in the longest stretch
FINENESS = 8  # trial frequencies per 1/T, T being the length of the longest stretch
LEAST_SHARE = 0.5  # of a joint's residual that the sine has to explain
MOTION_SHARE = 0.05  # of the velocity, from which the motion at a frequency may cause its harmonics
SUBHARMONICS = (1, 2, 3)


@dataclass(frozen=True)
class Vibration:
    """A sine of time, with a phase of its own in each stretch: frequency [Hz], explained share."""

    hertz: float
    share: float


def vibration(data: SlowResidual, joint: int) -> Vibration | None:
    """The vibration that makes up most of a joint's residual; None if there is none."""
    stretches = [rows.start + np.flatnonzero(data.shown[rows]) for rows in data.stretches]
    stretches = [rows for rows in stretches if len(rows) > 8]
    if not stretches:
        return None
    longest = max(float(data.time[rows[-1]] - data.time[rows[0]]) for rows in stretches)
    hertz = np.arange(CYCLES / longest, SLOW_HERTZ, 1 / (FINENESS * longest))
    if not len(hertz):
        return None
    shares = _shares(data.time, data.residual[:, joint], stretches, hertz)
    best = float(hertz[np.argmax(shares)])
    around = best + np.linspace(-1, 1, 33) / (FINENESS * longest)
    finer = _shares(data.time, data.residual[:, joint], stretches, around)
    found = Vibration(float(around[np.argmax(finer)]), float(finer.max()))
    motion = _shares(
        data.time, data.theta[1, :, joint], stretches, found.hertz / np.array(SUBHARMONICS, float)
    )
    return found if found.share > LEAST_SHARE and motion.max() < MOTION_SHARE else None


def _shares(time: Array, values: Array, stretches: list[NDArray[np.intp]], hertz: Array) -> Array:
    """Share of the sum of squares that a sine of each frequency explains, shape (F,)."""
    total, explained = 0.0, np.zeros(len(hertz))
    for rows in stretches:
        v = values[rows]
        total += float(v @ v)
        phase = 2 * np.pi * hertz[:, None] * (time[rows] - time[rows[0]])
        pair = np.stack((np.sin(phase), np.cos(phase)), axis=1)  # (F, 2, N)
        along = pair @ v
        gram = pair @ pair.transpose(0, 2, 1)
        explained += np.einsum("fi,fi->f", along, np.linalg.solve(gram, along[..., None])[..., 0])
    return explained / max(total, 1e-300)
