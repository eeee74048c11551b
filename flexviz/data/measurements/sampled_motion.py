"""Motion and torques at a few instants of a recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array
from flexviz.data.measurements.bridging import bridge

WINDOW = 0.05  # [s] half width of the local parabolas that give velocity and acceleration
INSTANTS = 200


@dataclass(frozen=True)
class SampledMotion:
    """Positions, velocities, accelerations, torques and their rates at a few instants, all (M, n)."""

    q: Array
    v: Array
    a: Array
    torque: Array
    rate: Array


def sample_motion(time: Array, theta: Array, tau: Array) -> SampledMotion:
    """The motion at up to `INSTANTS` instants: local parabolas through θ, lines through τ, (N, n)."""
    bridged = bridge(time, np.hstack([theta, tau]))
    time, theta, tau = bridged.time, *np.hsplit(bridged.signals, 2)
    count = len(time)
    step = float(np.median(np.diff(time)))
    half = int(np.clip(round(WINDOW / step), 3, max(3, count // 20)))
    centres = np.linspace(half, count - 1 - half, min(INSTANTS, count - 2 * half)).astype(int)
    offsets = np.arange(-half, half + 1)
    # a gap inside the window would be taken for a fast motion
    regular = time[centres + half] - time[centres - half] < 2.5 * half * step
    centres = centres[regular] if regular.any() else centres
    x = offsets / half
    parabola = np.linalg.pinv(np.stack([np.ones_like(x), x, x**2 / 2], axis=1))  # (3, 2 half + 1)
    rows = centres[:, None] + offsets
    q, v, a = np.einsum("kw,mwn->kmn", parabola, theta[rows])
    width = half * step  # [s]
    rate = np.einsum("w,mwn->mn", parabola[1], tau[rows])
    return SampledMotion(q, v / width, a / width**2, np.mean(tau[rows], axis=1), rate / width)
