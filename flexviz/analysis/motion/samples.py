"""Samples of a motion: in its band, and which count."""

from __future__ import annotations

from dataclasses import replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.estimation import LONGEST_EDGE
from flexviz.analysis.motion.thresholds import MOTION
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.model.equation import Signals, build_signals
from flexviz.model.observers import ButterworthZeroPhase

Phases = NDArray[np.int8]

HERTZ = 7.0  # band of the motion
SAMPLES = 1000  # of a record, with eight to four of a cycle at the edge of the band


def motion_signals(measurements: MeasurementSet, groups: tuple[Group, ...]) -> Signals:
    """Signals of some groups in the band of the motion. InputError if they are too short for it."""
    duration = sum(float(np.ptp(s.time)) for g in groups for s in g.segments)
    made = build_signals(
        measurements, groups, ButterworthZeroPhase(2 * np.pi * HERTZ),
        sample_step=float(np.clip(duration / SAMPLES, 1 / (8 * HERTZ), 1 / (4 * HERTZ))),
        exact_step=True, longest_edge=LONGEST_EDGE,
    )  # fmt: skip
    return replace(made, sharp=True)


class Phase(IntEnum):
    """Of a joint's motion. Where standstill is left out, a joint has the number of the first that counts."""

    REST = 0
    START = 1  # moving, but not yet by more than `MOTION.start_angle` from where it rested
    MOTION = 2


def phases(signals: Signals) -> Phases:
    """The `Phase` of each sample and joint, shape (N, n)."""
    position, speed = signals.theta[0], np.abs(signals.theta[1])
    moving = speed > MOTION.still * np.quantile(speed, 0.95, axis=0)
    phase = np.where(moving, Phase.MOTION, Phase.REST).astype(np.int8)
    for block in signals.blocks:
        rows = block.rows
        for j in range(moving.shape[1]):
            part = moving[rows, j]
            starts = rows.start + np.flatnonzero(np.diff(part.astype(int), prepend=0) > 0)
            for start in starts:
                away = np.abs(position[start : rows.stop, j] - position[start, j]) > MOTION.start_angle
                stop = start + (int(np.argmax(away)) if away.any() else rows.stop - start)
                phase[start:stop, j] = np.minimum(phase[start:stop, j], Phase.START)
    return phase
