"""What the checks of recorded signals find in good sets: `python -m benchmarks.signal_checks SET…`.

A line per set, or per set in a folder of sets: refused or the largest share of noise in a joint's torque;
whether and up to where the log counts as filtered; the time of both on one core. With `--filter`, copies of
each set are low-passed by four filters at 5, 10 and 20 Hz, and those not recognised are listed.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from benchmarks import filtered_logs
from benchmarks.command import command
from benchmarks.filtered_logs import low_pass, moving_average
from benchmarks.real import sets_in
from flexviz import read_set
from flexviz.base.errors import InputError
from flexviz.checks import check_signals, filtered_before_writing
from flexviz.data.measurements import Segment

HERTZ = (5.0, 10.0, 20.0)
Low = Callable[[np.ndarray, float, float], np.ndarray]  # signal (N, n), rate [Hz], cut-off [Hz]


def butterworth(y: np.ndarray, rate: float, hertz: float) -> np.ndarray:
    """Fourth order, forwards and backwards."""
    return filtered_logs.butterworth(y, rate, hertz, order=4)


def exponential(y: np.ndarray, rate: float, hertz: float) -> np.ndarray:
    """y ← y + a (x − y), twice: nearly flat in the last octave."""
    a = -np.expm1(-2 * np.pi * hertz / rate)
    for _ in range(2):
        y = np.asarray(lfilter([a], [1, a - 1], y, axis=0, zi=(1 - a) * y[:1])[0])
    return y


FILTERS: tuple[Low, ...] = (butterworth, low_pass, exponential, moving_average)


def low_passed(segments: list[Segment], low: Low, hertz: float) -> list[Segment]:
    """A log as it would have been written behind a filter."""
    return [
        replace(s, theta=low(s.theta, 1 / s.step, hertz), tau=low(s.tau, 1 / s.step, hertz)) for s in segments
    ]


@command
def main(sets: list[Path], *, filter: bool = False) -> None:
    """Print the lines and counts."""
    count = refused = recognised = tried = 0
    for folder in (one for path in sets for one in sets_in(path)):
        measurements = read_set(folder, logged=False)
        segments = [s for group in measurements.groups for s in group.segments]
        began = time.perf_counter()
        try:
            result = f"noise at most {100 * max(check_signals(measurements)):.2f} % of a torque"
        except InputError as error:
            result, refused = f"refused: {error}", refused + 1
        hertz = filtered_before_writing(segments).hertz
        took = 1e3 * (time.perf_counter() - began)
        content = "not filtered" if hertz is None else f"filtered, nothing above {hertz:.0f} Hz"
        print(f"{folder.name}: {result}; {content}; {took:.0f} ms", flush=True)
        count += 1
        for low in FILTERS if filter else ():
            for hertz in HERTZ:
                tried += 1
                found = filtered_before_writing(low_passed(segments, low, hertz)).hertz
                recognised += found is not None
                if found is None:
                    print(f"  {low.__name__} at {hertz:g} Hz is not recognised")
    print(f"{refused} of {count} sets refused")
    if tried:
        print(f"{recognised} of {tried} filtered copies recognised")


if __name__ == "__main__":
    sys.exit(main())
