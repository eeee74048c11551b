"""Values that are written again: a log faster than its drive, a value that is stale, a column that rests."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flexviz.base.arrays import Bools, Indices
from flexviz.base.facts import Remedy
from flexviz.checks.samples import GroupSamples, SampleFinding, mask_of_groups, runs
from flexviz.data.noise import Channel, Repeats, repeats_of, smallest_step
from flexviz.robot.robot import Robot

REPEATED = 1.1  # rows per new value from which a signal is one recorded more slowly
LONGEST = 0.05  # [s] a value that stands longer than this, and this many times as long as
RUNS = 10.0  # nearly all others, is stale where the joint moves
COUNTS = 4.0  # by which a column jumps before or after: a slow one goes on by single counts


@mask_of_groups()
def repeats(recording: GroupSamples, _: Robot) -> Iterator[SampleFinding]:
    for channel in recording.needed:
        yield from check_repeats(channel, recording.moves(channel))


def check_repeats(channel: Channel, moves: Bools) -> Iterator[SampleFinding]:
    """Repeated values, or a value that stands still while the joint moves; `moves` (N,): where it does."""
    y = channel.values
    if np.ptp(y) == 0.0:
        yield SampleFinding.at(channel, np.arange(len(y)), "constant", value=float(y[0]))
        return
    found, remedy = repeats_of(y), Remedy("fresh", True)
    if found.lasts >= REPEATED:
        repeated = np.setdiff1d(np.arange(len(y)), found.rows)
        rate = 1 / (found.lasts * float(np.median(np.diff(channel.time))))
        yield SampleFinding.at(channel, repeated, "repeated", remedy, lasts=found.lasts, rate=rate)
    if len(stale := _stale(channel, found, moves)):
        first, last = max(runs(stale), key=lambda run: run[1] - run[0])
        longest = float(channel.time[last] - channel.time[first])
        yield SampleFinding.at(channel, stale, "stale", remedy, longest=longest)


def _stale(channel: Channel, found: Repeats, moves: Bools) -> Indices:
    """Samples (m,) that repeat the one before for much longer than others do, while the joint moves."""
    y = channel.values
    ends = np.append(found.rows, len(y))
    lengths = np.diff(ends)
    usual = np.quantile(lengths, 0.95)
    least = max(RUNS * usual, LONGEST / float(np.median(np.diff(channel.time))))
    extremes = (y[found.rows] == y.min()) | (y[found.rows] == y.max())  # a limit of the drive, if not zero
    extremes &= y[found.rows] != 0.0
    moved = np.concatenate([[0], np.cumsum(moves)])
    mostly = (moved[ends[1:]] - moved[ends[:-1]]) > 0.5 * lengths
    jumps = np.abs(np.diff(y[found.rows]))
    then = np.maximum(np.append(jumps, 0.0), np.append(0.0, jumps))
    long = (lengths > least) & mostly & ~extremes & (then > COUNTS * smallest_step(np.abs(np.diff(y))))
    spans = [np.arange(a + 1, b) for a, b in zip(ends[:-1][long], ends[1:][long], strict=True)]
    return np.concatenate(spans) if spans else np.zeros(0, dtype=int)
