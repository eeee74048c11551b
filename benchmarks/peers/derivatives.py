"""Smooth derivatives for the methods that need them: zero-phase Butterworth and central differences.

The usual choice for inverse dynamic models (Gautier 1997; Janot, Vandanjon, Gautier 2014), here also for the
paper's equation, whose own causal observer lags (docs/paper.md).
"""

from __future__ import annotations

import numpy as np
from scipy import signal

from benchmarks.peers.problem import Array, Group, Problem

ORDER = 4
DROPPED = 0.5  # [s] at both ends, where the filter has no past or no future


def smooth(y: Array, hertz: float, step: float) -> Array:
    """y (N, n) forwards and backwards through a low-pass."""
    sections = signal.butter(ORDER, hertz, fs=1 / step, output="sos")
    return np.asarray(signal.sosfiltfilt(sections, y, axis=0))


def differences(y: Array, count: int, step: float) -> list[Array]:
    """y (N, n) and `count` derivatives by central differences."""
    out = [y]
    for _ in range(count):
        out.append(np.gradient(out[-1], step, axis=0))
    return out


def rigid_band(problem: Problem) -> float:
    """[Hz] a quarter of the first elastic mode at the start values, where a rigid model is fair."""
    mode = np.sqrt(problem.stiffness / (2 * problem.motor_inertia)).min() / (2 * np.pi)
    return float(np.clip(0.25 * mode, 0.5, 5.0))


def torque_at_samples(group: Group, hold: float) -> Array:
    """(N, n) τ(t − h/2): the torque that acted around each sample [Nm]."""
    time = group.time - hold / 2
    return np.stack([np.interp(time, group.time, column) for column in group.tau.T], axis=1)


def inner(group: Group, every: float) -> slice:
    """Samples `every` seconds apart, without the ends."""
    ends = round(DROPPED / group.step)
    return slice(ends, len(group.time) - ends, max(1, round(every / group.step)))
