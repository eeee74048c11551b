"""Whether time can be in seconds."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from flexviz.base.arrays import Array
from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.data.measurements.sampled_motion import sample_motion

SLOWEST = 0.2  # [s] slower sampling cannot show a flexible joint
SLOW = 0.05  # [s] slower sampling is odd, and not in seconds of a robot that hardly moves:
RESTING = 5e-3  # [rad/s]
FAST = 2e-5  # [s] faster sampling is odd


def wrong_time_unit(step: float, speed: float) -> str | None:
    """The unit that a time with this median step seems to be in; None where it can be seconds.

    Args:
        step: as if it were in seconds.
        speed: largest joint speed that it implies [rad/s].
    """
    if step > SLOWEST or (step > SLOW and speed < RESTING):
        return "milliseconds" if step < 100 else "microseconds" if step < 1e5 else "nanoseconds"
    return None


def check_time_unit(time: Array, theta: Array, file: Path) -> Iterator[Fact]:
    """A step that is odd; InputError for a time (N,) that is not in seconds, by the motion of θ (N, n)."""
    step = float(np.median(np.diff(time)))
    if unit := wrong_time_unit(step, float(np.max(np.abs(sample_motion(time, theta, theta).v)))):
        message = f"the median step is {step:g}: is time in {unit}? expected seconds"
        raise InputError(message, file=file, place="column time")
    if not FAST <= step <= SLOW:
        yield Fact("odd-step", "odd", values={"step": step})
