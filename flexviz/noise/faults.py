"""Faults of recorded columns: positions that jump, and values that were dropped."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.arrays import Array
from flexviz.measurements import Segment, likely_limits
from flexviz.noise.estimates import new_values, white_noise
from flexviz.noise.thresholds import THRESHOLDS
from flexviz.robot import Robot
from flexviz.wording import number


@dataclass(frozen=True)
class Fault:
    """What is wrong with one column.

    Attributes:
        signal: "theta" or "tau".
        joint: its name.
        time: of the first sample concerned [s].
        count: samples concerned.
        found, cause, expected: the parts of a message.
    """

    signal: str
    joint: str
    time: float
    count: int
    found: str
    cause: str
    expected: str

    @property
    def column(self) -> str:
        """Its name in a set's table."""
        return f"{self.signal}_{self.joint}"


def column_faults(segments: Sequence[Segment], robot: Robot) -> tuple[Fault, ...]:
    """All that is found in one group, the column with the most samples concerned first."""
    found = [*_position_jumps(segments, robot), *_dropped_values(segments, robot)]
    columns = {fault.column: fault for fault in reversed(found)}  # of one column the jumps, which come first
    return tuple(sorted(columns.values(), key=lambda fault: -fault.count))


def sudden(steps: Array) -> Array:
    """The part of each step, shape (N, n), that smooth motion does not explain.

    How much it differs from the steps one before and one after, the smaller counts, so that a new speed is no
    jump; the same two before and two after, so that a jump may take two samples; at most the step itself, so
    that the samples between two jumps are none.
    """
    around = np.pad(steps, ((2, 2), (0, 0)), mode="reflect")
    one, two = (
        np.minimum(
            np.abs(steps - around[2 - k : len(around) - 2 - k]),
            np.abs(steps - around[2 + k : len(around) - 2 + k or None]),
        )
        for k in (1, 2)
    )
    return np.minimum(np.maximum(one, two), np.abs(steps))


def _position_jumps(segments: Sequence[Segment], robot: Robot) -> Iterator[Fault]:
    fastest = THRESHOLDS.jump_speed * likely_limits(robot)[1]
    samples = sum(map(len, segments))
    counts, largest = np.zeros(robot.n, int), np.zeros(robot.n)
    first: dict[int, tuple[Segment, int]] = {}
    for segment in segments:
        theta, held = new_values(segment.theta)
        if len(theta) < 4:
            continue
        steps = np.diff(theta, axis=0)
        jumped = sudden(steps) / (held * segment.step)
        limit = np.maximum(_largest_step(segment.theta, steps) / (held * segment.step), fastest)
        jumps = jumped > limit
        counts += np.count_nonzero(jumps, axis=0)
        largest = np.maximum(largest, np.where(jumps, jumped, 0.0).max(axis=0))
        for j in np.flatnonzero(jumps.any(axis=0)):
            at = round(held * int(np.argmax(jumps[:, j])))
            first.setdefault(int(j), (segment, min(at, len(segment) - 2)))
    for j, (segment, at) in sorted(first.items()):
        before, after = segment.theta[at : at + 2, j]
        unit = "m" if robot.prismatic[j] else "rad"
        yield Fault(
            "theta",
            robot.joints[j],
            float(segment.time[at + 1]),
            int(counts[j]),
            f"the position jumps at {counts[j]} of {samples} instants, by up to {number(largest[j], 3)} "
            f"{unit}/s (here from {number(before)} to {number(after)} {unit})",
            "two publishers on one topic, wrapped, late or dropped values",
            "the continuous motion of one joint",
        )


def _largest_step(theta: Array, steps: Array) -> Array:
    """By which noise and counts of an encoder may move the positions of one segment, shape (n,)."""
    count = [np.median(x[x > 0]) if x.any() else 0.0 for x in np.abs(steps).T]
    usual = np.maximum(THRESHOLDS.jump_noise * white_noise(theta), THRESHOLDS.jump_steps * np.array(count))
    return np.maximum(THRESHOLDS.jump, np.minimum(usual, THRESHOLDS.jump_beyond_noise))


def _dropped_values(segments: Sequence[Segment], robot: Robot) -> Iterator[Fault]:
    for name in ("theta", "tau"):
        for j, joint in enumerate(robot.joints):
            places = [(s, at) for s in segments for at in _dropped(getattr(s, name)[:, j], s.step)]
            if len(places) < THRESHOLDS.dropped:
                continue
            segment, at = places[0]
            before, value = getattr(segment, name)[at - 1 : at + 1, j]
            yield Fault(
                name,
                joint,
                float(segment.time[at]),
                len(places),
                f"{len(places)} times the value is {number(value)} between others far from it (here after "
                f"{number(before)})",
                "dropped values",
                "a measured number in every row; a row without one may be left out and is interpolated",
            )


def _dropped(y: Array, step: float) -> list[int]:
    """Where runs of 0, of the least or of the largest value begin that are far from both neighbours."""
    steps = np.abs(np.diff(y))
    moving = steps[steps > 0]
    if not len(moving):
        return []
    far = THRESHOLDS.dropped_steps * float(np.median(moving))
    longest = max(1, round(THRESHOLDS.dropped_seconds / step))
    found: list[int] = []
    for value in {0.0, float(y.min()), float(y.max())}:
        edges = np.diff((y == value).astype(np.int8), prepend=0, append=0)
        start, stop = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
        inside = (start > 0) & (stop < len(y)) & (stop - start <= longest)
        start, stop = start[inside], stop[inside]
        before, after = y[start - 1] - value, y[stop] - value
        near = np.minimum(np.abs(before), np.abs(after))
        lost = (near > far) & (np.abs(before - after) < near)
        if np.count_nonzero(lost) >= THRESHOLDS.dropped:
            found += start[lost].tolist()
    return sorted(found)
