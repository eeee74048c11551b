"""A torque that is a sine of time, whatever the robot does: something beside it vibrates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.residuals import SLOW_HERTZ, SlowResidual
from flexviz.diagnosis.thresholds import THRESHOLDS

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.evidence
CYCLES = 3.0  # least number of periods in the longest stretch
FINENESS = 8  # trial frequencies per 1/T, T being the length of the longest stretch
SUBHARMONICS = (1, 2, 3)  # the motion's frequency, or one of which that of the vibration is a harmonic


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
    power = np.zeros(len(hertz))
    for rows in stretches:
        step, padded = float(data.step[rows[0]]), FINENESS * len(rows)
        there = np.abs(np.fft.rfft(data.residual[rows, joint], padded)) ** 2 / len(rows)
        seen = hertz * len(rows) * step >= CYCLES
        power += seen * np.interp(hertz, np.fft.rfftfreq(padded, step), there)
    best = float(hertz[np.argmax(power)])
    around = best + np.linspace(-1, 1, 33) / (FINENESS * longest)
    finer = _shares(data.time, data.residual[:, joint], stretches, around, CYCLES)
    found = Vibration(float(around[np.argmax(finer)]), float(finer.max()))
    slower = found.hertz / np.array(SUBHARMONICS, float)
    motions = data.theta[1].T  # of all joints: a law may depend on the motion of another
    motion = max(float(_shares(data.time, velocity, stretches, slower).max()) for velocity in motions)
    return found if found.share > LIMITS.vibration_share and motion < LIMITS.motion_share else None


def _shares(
    time: Array, values: Array, stretches: list[NDArray[np.intp]], hertz: Array, cycles: float = 0.0
) -> Array:
    """Share of the sum of squares that a sine of each frequency explains, shape (F,).

    Stretches of fewer periods than `cycles` have none explained: part of a period resembles any slow course.
    """
    total, explained = 0.0, np.zeros(len(hertz))
    for rows in stretches:
        v, elapsed = values[rows], time[rows] - time[rows[0]]
        total += float(v @ v)
        phase = 2 * np.pi * hertz[:, None] * elapsed
        pair = np.stack((np.sin(phase), np.cos(phase)), axis=1)  # (F, 2, N)
        along = pair @ v
        gram = pair @ pair.transpose(0, 2, 1)
        there = np.einsum("fi,fi->f", along, np.linalg.solve(gram, along[..., None])[..., 0])
        explained += there * (hertz * elapsed[-1] >= cycles)
    return explained / max(total, 1e-300)
