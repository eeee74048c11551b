"""Brakes and supports: an arm at rest with a torque that cannot hold it.

That is one further from what holds it than the masses' fit errs in motion, and than static friction.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flexviz.checks.masks.means import PUSH, STANDING, TorqueMeans, leaving_out, torque_channel, torques_left
from flexviz.checks.samples import GroupSamples, SampleFinding, mask_of_groups, runs
from flexviz.robot.robot import Robot

HELD = 0.5  # of the torque that would hold the joint, from which one at rest may not hold it
OFF = 6.0  # times the usual error in motion from which a torque at rest does not hold the joint


@mask_of_groups()
def held(recording: GroupSamples, robot: Robot) -> Iterator[SampleFinding]:
    """The joint whose torque at rest is the furthest from holding it, of each stretch of time."""
    left = torques_left(recording, robot)
    if left is None:
        return
    means, worst = left.means, dict[tuple[int, int], tuple[float, int]]()
    for j, fit in enumerate(left.fits):
        if fit is None:
            continue
        least = fit.static + max(OFF * fit.slow, PUSH * float(np.std(means.torque[:, j])))
        for first, last in runs(np.flatnonzero(fit.rest)):
            here, torque = fit.off[first : last + 1], means.torque[first : last + 1, j]
            off, needed = (float(np.median(np.abs(x))) for x in (here, torque - here))
            begin, end = span = _span(recording, means, (first, last), j)
            long = recording.time[end] - recording.time[begin] > STANDING
            further = off / least > worst.get(span, (0.0, 0))[0]
            if long and off > max(least, HELD * needed) and further:
                worst[span] = off / least, j
    by_joint: dict[int, list[tuple[int, int]]] = {}
    for span, (_, j) in worst.items():
        by_joint.setdefault(j, []).append(span)
    for j, spans in by_joint.items():
        fit, first = left.fits[j], spans[0]
        assert fit is not None
        inside = fit.off[slice(*np.searchsorted(means.rows, [first[0], first[1] + 1]))]
        values = {
            "torque": float(np.median(recording.tau[first[0] : first[1] + 1, j])),
            "off": abs(float(np.median(inside))) if len(inside) else 0.0,
            "static": fit.static,
            "unit": "N" if robot.prismatic[j] else "Nm",
        }
        samples = np.concatenate([np.arange(a, b + 1) for a, b in spans])
        channel, remedy = torque_channel(recording, robot, j), leaving_out(recording, spans)
        yield SampleFinding.at(channel, samples, "held", remedy, **values)


def _span(recording: GroupSamples, means: TorqueMeans, run: tuple[int, int], j: int) -> tuple[int, int]:
    """First and last sample of a rest: as long as the position stays where it is."""
    first, last = int(means.rows[run[0]]), int(means.rows[run[1] + 1]) - 1
    theta = recording.theta[:, j]
    low, high = theta[first : last + 1].min(), theta[first : last + 1].max()
    beyond = 0.1 * (high - low) + 1e-12
    stays = (theta >= low - beyond) & (theta <= high + beyond)
    left = np.flatnonzero(~stays)
    k = int(np.searchsorted(left, first))
    return int(left[k - 1]) + 1 if k else 0, int(left[k]) - 1 if k < len(left) else len(theta) - 1
