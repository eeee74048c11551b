"""Hands and cables: a torque in motion that is off once, and not when the same motion comes again."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.checks.masks.means import PUSH, STANDING, leaving_out, torque_channel, torques_left
from flexviz.checks.samples import GroupSamples, SampleFinding, mask_of_groups, runs
from flexviz.robot.robot import Robot

FAR = 10.0  # times the usual error, from which a torque in motion may come from outside
SAME_MOTION = 0.5  # of their spreads by which position and velocity may differ in the same motion
MOST = 0.25  # share of the recording; more is no exception


@mask_of_groups()
def contacts(recording: GroupSamples, robot: Robot) -> Iterator[SampleFinding]:
    """Stretches in motion that are far from what the same motion takes at other times."""
    left = torques_left(recording, robot)
    if left is None:
        return
    means = left.means
    for j, fit in enumerate(left.fits):
        if fit is None:
            continue
        least = max(FAR * fit.usual, PUSH * float(np.std(means.torque[:, j])))
        far = (np.abs(fit.off) > least) & ~fit.rest
        state = np.stack([x[:, j] / max(float(np.std(x[:, j])), 1e-12) for x in (means.q, means.v)], axis=1)
        spans = []
        for a, b in runs(np.flatnonzero(_closed(far))):
            inside = a > 0 and b + 1 < len(far)  # it begins and ends: no start from rest
            long = inside and means.time[b] - means.time[a] > STANDING
            once = long and _one_sided(means.time, fit.off, a, b, least)
            if once and _not_repeated(state, fit.off, a, b, least):
                spans.append((int(means.rows[a]), max(int(means.rows[b + 1]) - 1, int(means.rows[a]))))
        if not spans or sum(b - a for a, b in spans) > MOST * len(recording.time):
            continue
        samples = np.concatenate([np.arange(a, b + 1) for a, b in spans])
        values = {
            "seconds": len(samples) * float(np.median(np.diff(recording.time))),
            "largest": float(np.max(np.abs(fit.off[far]))),
            "usual": fit.usual,
            "unit": "N" if robot.prismatic[j] else "Nm",
        }
        channel, remedy = torque_channel(recording, robot, j), leaving_out(recording, spans)
        yield SampleFinding.at(channel, samples, "contact", remedy, **values)


def _closed(far: Bools) -> Bools:
    """With single gaps filled."""
    filled = far.copy()
    filled[1:-1] |= far[:-2] & far[2:]
    return filled


def _one_sided(time: Array, off: Array, a: int, b: int, least: float) -> bool:
    """Whether a torque pushes in one direction: a vibration alternates."""
    first, last = np.searchsorted(time, [time[a] - 2 * STANDING, time[b] + 2 * STANDING])
    sign = np.sign(np.sum(off[a : b + 1]))
    return bool(np.min(sign * off[first:last]) > -0.5 * least)


def _not_repeated(state: Array, off: Array, a: int, b: int, least: float) -> bool:
    """Whether position and velocity of the joint in the means a … b take usual torques at other times."""
    others = np.ones(len(off), dtype=bool)
    others[max(0, a - 3) : b + 4] = False
    near = usual = 0
    for i in range(a, b + 1):
        distance = np.max(np.abs(state[others] - state[i]), axis=1)
        close = np.flatnonzero(distance < SAME_MOTION)
        near += len(close) > 0
        usual += len(close) > 0 and bool(np.median(np.abs(off[others][close])) < 0.5 * least)
    return near >= 1 and usual > 0.5 * near
