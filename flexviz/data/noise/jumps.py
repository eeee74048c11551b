"""Samples that jump: positions that no joint can follow, counters that overflow, numbers that mean nothing.

The cause is what mends it: of the possible repairs, in order, the first after which nothing jumps any more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from flexviz.base.arrays import Array, Indices
from flexviz.base.spelling import number
from flexviz.data.measurements import Segment, likely_limits
from flexviz.data.noise.estimates import white_noise
from flexviz.data.noise.findings import Channel, Remedy, SampleFinding, worst_of_columns
from flexviz.data.noise.registers import BITS, counter_periods, overflow, sign_bit, sign_magnitude, unwrapped
from flexviz.data.noise.repeats import new_rows
from flexviz.data.noise.thresholds import THRESHOLDS
from flexviz.robot.robot import Robot

TURNS = (2 * np.pi, 360.0)
SHORTEST = 32  # samples that a repair has to leave
PASSES = 10  # over samples that jump away and back


def column_findings(segments: Sequence[Segment], robot: Robot) -> tuple[SampleFinding, ...]:
    """All jumps and dropped values of a set's group, the column with the most samples concerned first."""
    time = np.concatenate([s.time for s in segments])
    fastest = THRESHOLDS.jump_speed * likely_limits(robot)[1]
    found: list[SampleFinding] = []
    for name in ("theta", "tau"):
        for j, joint in enumerate(robot.joints):
            values = np.concatenate([getattr(s, name)[:, j] for s in segments])
            channel = Channel(name, joint, time, values)
            found += check_jumps(channel, float(fastest[j]), robot.prismatic[j])
    return worst_of_columns(found)


def check_jumps(channel: Channel, fastest: float, prismatic: bool) -> list[SampleFinding]:
    """What jumps in a channel; `fastest`: a position's largest speed [rad/s], [m/s]."""
    if channel.signal == "theta":
        at = jumped(channel, fastest)
        return [_cause(channel, at, fastest, "m" if prismatic else "rad")] if len(at) else []
    if (bit := sign_bit(channel.values)) is not None:
        return [_signed(channel, bit)]
    if period := overflow(channel.values, counter_periods(channel.values)):
        return [_wrapped(channel, period, np.flatnonzero(np.abs(np.diff(channel.values)) > period / 2) + 1)]
    return [_dropped(channel, value, at) for value, at in dropped(channel)][:1]


def jumped(channel: Channel, fastest: float) -> Indices:
    """Samples (m,) at which a position has jumped: by more than motion, noise and counts explain."""
    theta = channel.values * channel.size
    rows = new_rows(theta)
    if len(rows) < 4:
        return np.zeros(0, dtype=int)
    steps, seconds = np.diff(theta[rows]), np.diff(channel.time[rows])
    count = np.abs(steps)[steps != 0.0]
    usual = max(
        THRESHOLDS.jump_noise * float(white_noise(theta[:, None])[0]),
        THRESHOLDS.jump_steps * float(np.median(count)) if len(count) else 0.0,
    )
    least = max(THRESHOLDS.jump, min(usual, THRESHOLDS.jump_beyond_noise))
    # where time does not go on, another stretch begins
    return rows[1:][(sudden(steps) > np.maximum(least, fastest * seconds)) & (seconds > 0.0)]


def sudden(steps: Array) -> Array:
    """The part of each step, shape (N,), that smooth motion does not explain.

    How much it differs from the steps one before and one after, the smaller counts, so that a new speed is no
    jump; the same two before and two after, so that a jump may take two samples; at most the step itself, so
    that the samples between two jumps are none.
    """
    around = np.pad(steps, 2, mode="reflect")
    one, two = (
        np.minimum(
            np.abs(steps - around[2 - k : len(around) - 2 - k]),
            np.abs(steps - around[2 + k : len(around) - 2 + k or None]),
        )
        for k in (1, 2)
    )
    return np.minimum(np.maximum(one, two), np.abs(steps))


def _cause(channel: Channel, at: Indices, fastest: float, unit: str) -> SampleFinding:
    """Why a position jumps at the samples `at`: by the repair that ends it."""

    def ends(*columns: Array) -> bool:
        time, values = columns
        repaired = replace(channel, time=time, values=values, incomplete=None)
        return len(values) >= SHORTEST and not len(jumped(repaired, fastest))

    time, values = channel.time, channel.values
    if channel.incomplete is not None and ends(time[~channel.incomplete], values[~channel.incomplete]):
        return _messages(channel, at, unit)
    if (bit := sign_bit(values)) is not None and ends(time, sign_magnitude(values, bit)):
        return _signed(channel, bit)
    period = overflow(values, [*TURNS, 2 * np.pi / channel.size, *counter_periods(values)])
    if period is None:
        usual = np.median(
            np.diff(values)[np.clip([at - 2, at], 0, len(values) - 2)], axis=0
        )  # beside the jump
        size = float(np.median(np.abs(values[at] - values[at - 1] - usual)))
        period = overflow(values, [size]) if len(at) > 1 and np.ptp(values) < 1.1 * size else None
    if period is not None and ends(time, unwrapped(values, period)):
        return _wrapped(channel, period, at)
    for value, lost in dropped(channel):
        kept = values != value
        if ends(time[kept], values[kept]):
            return _dropped(channel, value, lost)
    away, left = outliers(channel, fastest)
    found = _jumps_at(channel, at, unit)
    if len(away) and left < 0.01 * len(at):
        often = len(away) > 0.02 * len(values)
        cause = "two publishers on one topic" if often else "late or wrong samples (transmission errors)"
        expected = "the continuous motion of one joint; the samples that jump away and back may be left out"
        return channel.finding("outliers", away, (found, cause, expected), Remedy("drop_jumps", True, "log"))
    cause = "two publishers on one topic, a new zero of the encoder, late or dropped values"
    return channel.finding("jumps", at, (found, cause, "the continuous motion of one joint"))


def _jumps_at(channel: Channel, at: Indices, unit: str) -> str:
    steps = channel.size * np.abs(channel.values[at] - channel.values[at - 1])
    speed = float(np.max(steps / (channel.time[at] - channel.time[at - 1])))
    before, after = channel.size * channel.values[at[0] - 1 : at[0] + 1]
    return (
        f"the position jumps at {len(at)} of {len(channel.values)} instants, by up to {number(speed, 3)} "
        f"{unit}/s (here from {number(before)} to {number(after)} {unit})"
    )


def _messages(channel: Channel, at: Indices, unit: str) -> SampleFinding:
    assert channel.incomplete is not None
    share = f"{np.count_nonzero(channel.incomplete)} of {len(channel.values)} rows lack another signal"
    return channel.finding(
        "messages",
        at,
        (
            f"{_jumps_at(channel, at, unit)}; {share}, and without these rows nothing jumps",
            "two publishers on one topic, or two kinds of message",
            "only the rows that have every signal",
        ),
        Remedy("complete_rows", True, "mapping"),
    )


# -- registers -----------------------------------------------------------------------------------------------


def _wrapped(channel: Channel, period: float, at: Indices) -> SampleFinding:
    names = {2 * np.pi: "2π", 360.0: "360", **{2.0**bits: f"2^{bits}" for bits in BITS}}
    name = next((text for value, text in names.items() if abs(period / value - 1) < 1e-3), number(period, 6))
    before, after = channel.values[at[0] - 1 : at[0] + 1]
    found = (
        f"the value jumps by about {name} {len(at)} times and is continuous otherwise (here from "
        f"{number(before)} to {number(after)})"
    )
    unsigned = "an unsigned or overflowing counter" + (" (16 bit)" if name == "2^16" else "")
    cause = unsigned if channel.signal == "tau" else "a wrapped angle or overflowing counter"
    remedy = Remedy("wrap", float(period))
    return channel.finding("wrapped", at, (found, cause, "the continuous motion or signed torque"), remedy)


def _signed(channel: Channel, bit: int) -> SampleFinding:
    at = np.flatnonzero(np.diff(channel.values > 2.0**bit - 0.5)) + 1
    before, after = channel.values[at[0] - 1 : at[0] + 1]
    found = (
        f"the value jumps by 2^{bit} {len(at)} times and is continuous otherwise if the numbers above are "
        f"negative (here from {number(before)} to {number(after)})"
    )
    cause = f"a register in sign-magnitude form, of which bit {bit} is the sign"
    remedy = Remedy("sign_bit", float(bit))
    return channel.finding("wrapped", at, (found, cause, "numbers with their sign"), remedy)


# -- dropped values ------------------------------------------------------------------------------------------


def _dropped(channel: Channel, value: float, at: Indices) -> SampleFinding:
    before = float(channel.values[at[0] - 1])
    found = f"{len(at)} times the value is {number(value)} between others far from it (here after "
    found += f"{number(before)})"
    expected = "a measured number in every row; a row without one may be left out and is interpolated"
    return channel.finding("dropped", at, (found, "dropped values", expected), Remedy("missing", value))


def dropped(channel: Channel) -> Iterator[tuple[float, Indices]]:
    """Values that stand for a missing one, and where runs of them begin.

    They are 0, the least or the largest value, and far from the samples before and after.
    """
    y = channel.values
    steps = np.abs(np.diff(y))
    moving = steps[steps > 0]
    if not len(moving):
        return
    far = THRESHOLDS.dropped_steps * float(np.median(moving))
    step = float(np.median(np.diff(channel.time)))
    longest = max(1, round(THRESHOLDS.dropped_seconds / step))
    for value in sorted({0.0, float(y.min()), float(y.max())}, key=lambda v: -np.count_nonzero(y == v)):
        edges = np.diff((y == value).astype(np.int8), prepend=0, append=0)
        start, stop = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
        inside = (start > 0) & (stop < len(y)) & (stop - start <= longest)
        start, stop = start[inside], stop[inside]
        before, after = y[start - 1] - value, y[stop] - value
        near = np.minimum(np.abs(before), np.abs(after))
        lost = (near > far) & (np.abs(before - after) < near)
        if np.count_nonzero(lost) >= THRESHOLDS.dropped:
            yield value, start[lost]


# -- outliers ------------------------------------------------------------------------------------------------


def outliers(channel: Channel, fastest: float = 0.0) -> tuple[Indices, int]:
    """Samples (m,) between a jump and the jump back, as short as dropped values; jumps that are left then.

    Where two motions cross, single jumps are too small to be seen until the others are taken out.
    """
    away = np.zeros(0, dtype=int)
    for _ in range(PASSES):
        kept = np.setdiff1d(np.arange(len(channel.values)), away)
        if len(kept) < SHORTEST:
            break
        part = replace(channel, time=channel.time[kept], values=channel.values[kept], incomplete=None)
        at = jumped(part, fastest)
        found = _between(part, at)
        if not len(found):
            return away, len(at)
        away = np.sort(np.concatenate([away, kept[found]]))
    return away, len(channel.values)


def _between(channel: Channel, at: Indices) -> Indices:
    """Samples (m,) between a jump and the jump back, of the jumps `at`."""
    y, time = channel.values, channel.time
    longest = max(THRESHOLDS.dropped_seconds, 1.5 * float(np.median(np.diff(time))))
    if not len(at):
        return at
    edges = np.concatenate([[0], at, [len(y)]])
    sizes = np.diff(edges)
    away: list[int] = []
    last = -1  # row before this piece of those that stay
    for first, size, after in zip(edges[:-1], sizes, [*sizes[1:], sizes[-2]], strict=True):
        end = first + size
        short = size <= after and time[min(end, len(y) - 1)] - time[first] <= longest
        comes_back = last < 0 or end == len(y) or abs(y[end] - y[last]) < 0.5 * abs(y[first] - y[last])
        if short and comes_back:
            away += range(int(first), int(end))
        else:
            last = int(end) - 1
    return np.array(away, dtype=int)
