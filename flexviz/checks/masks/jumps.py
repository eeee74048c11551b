"""Samples that jump: positions that no joint can follow, counters that overflow, numbers that mean nothing.

The cause is what mends it: of the possible repairs, in order, the first after which nothing jumps any more.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from flexviz.base.arrays import Array, Indices
from flexviz.base.facts import Remedy
from flexviz.checks.dropped import dropped
from flexviz.checks.limits import likely_limits
from flexviz.checks.registers import counter_periods, has_sign_bit, overflow, sign_bit
from flexviz.checks.samples import GroupSamples, SampleFinding, mask_of_groups
from flexviz.data.noise import SHORTEST, Channel, jumped, outliers, sign_magnitude, unwrapped
from flexviz.robot.robot import Robot

TURNS = (2 * np.pi, 360.0)
FASTER = 2.0  # times its likely speed limit, by which a joint does not move


@mask_of_groups(spoils=True)
def jumps(recording: GroupSamples, robot: Robot) -> Iterator[SampleFinding]:
    fastest = FASTER * likely_limits(robot)[1]
    for channel in recording.needed:
        j = robot.joints.index(channel.joint)
        for found in check_jumps(channel, float(fastest[j]), robot.prismatic[j]):
            if found.remedy is not None and found.remedy.key == "sign_bit":
                same = _same_bus(recording, channel, int(found.values["bit"]))
                found = replace(found, values={**found.values, "same_bus": same})
            yield found


def _same_bus(recording: GroupSamples, channel: Channel, bit: int) -> tuple[tuple[str, str], ...]:
    """The same signal of other joints, and the reference, which do not jump but have the sign bit."""
    signals = {channel.signal, "theta_ref"} if channel.signal == "theta" else {channel.signal}
    others = (other for other in recording.channels if other.signal in signals and other is not channel)
    return tuple((other.joint, other.signal) for other in others if has_sign_bit(other.values, bit))


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


def _cause(channel: Channel, at: Indices, fastest: float, unit: str) -> SampleFinding:
    """Why a position jumps at the samples `at`: by the repair that ends it."""

    def ends(*columns: Array) -> bool:
        time, values = columns
        repaired = replace(channel, time=time, values=values, incomplete=None)
        return len(values) >= SHORTEST and not len(jumped(repaired, fastest))

    time, values, incomplete = channel.time, channel.values, channel.incomplete
    if incomplete is not None and ends(time[~incomplete], values[~incomplete]):
        remedy, lacking = Remedy("complete_rows", True, "mapping"), int(np.count_nonzero(incomplete))
        steps = _steps(channel, at, unit)
        return SampleFinding.at(channel, at, "messages", remedy, **steps, incomplete=lacking)
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
    steps = _steps(channel, at, unit)
    if len(away) and left < 0.01 * len(at):
        often = len(away) > 0.02 * len(values)
        remedy = Remedy("drop_jumps", True, "log")
        return SampleFinding.at(channel, away, "outliers", remedy, **steps, often=often)
    return SampleFinding.at(channel, at, "jumps", **steps)


def _steps(channel: Channel, at: Indices, unit: str) -> dict[str, Any]:
    """How often and how fast a position jumps."""
    steps = channel.size * np.abs(channel.values[at] - channel.values[at - 1])
    speed = float(np.max(steps / (channel.time[at] - channel.time[at - 1])))
    here = {name: channel.size * x for name, x in _here(channel, at).items()}
    return {"jumps": len(at), "instants": len(channel.values), "speed": speed, **here, "unit": unit}


def _here(channel: Channel, at: Indices) -> dict[str, float]:
    """The values before and after the first jump, in the unit of the column."""
    before, after = channel.values[at[0] - 1 : at[0] + 1]
    return {"before": float(before), "after": float(after)}


def _wrapped(channel: Channel, period: float, at: Indices) -> SampleFinding:
    remedy, numbers = Remedy("wrap", float(period)), _here(channel, at)
    return SampleFinding.at(channel, at, "wrapped", remedy, period=float(period), **numbers)


def _signed(channel: Channel, bit: int) -> SampleFinding:
    at = np.flatnonzero(np.diff(channel.values > 2.0**bit - 0.5)) + 1
    numbers = _here(channel, at)
    return SampleFinding.at(channel, at, "wrapped", Remedy("sign_bit", float(bit)), bit=bit, **numbers)


def _dropped(channel: Channel, value: float, at: Indices) -> SampleFinding:
    before = float(channel.values[at[0] - 1])
    return SampleFinding.at(channel, at, "dropped", Remedy("missing", value), value=value, before=before)
