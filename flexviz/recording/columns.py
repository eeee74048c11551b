"""Send whole signals as columns, never sample by sample."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from flexviz.charts import COLOURS, rgb
from flexviz.recording.paths import TIME, path
from flexviz.recording.stream import Stream

Array = NDArray[Any]
GAP = 2.5  # an interval longer than this many median ones is a gap: the line is broken there


def stride_for(samples: int, most: int) -> int:
    """Every how many-th sample to send so that at most about `most` are sent."""
    return max(1, -(-samples // most))


def broken_at_gaps(time: Array, values: Array) -> tuple[Array, Array]:
    """`time` (N,) and `values` (N, n) with a NaN row inside every gap, so that no line crosses it."""
    if len(time) < 3:
        return time, values
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > GAP * np.median(steps)) + 1
    if len(gaps) == 0:
        return time, values
    middle = (time[gaps] + time[gaps - 1]) / 2
    return np.insert(time, gaps, middle), np.insert(values, gaps, np.nan, axis=0)


def send_signal(
    recording: Stream,
    where: Sequence[str],
    joints: Sequence[str],
    time: Array,
    values: Array,
    label: str = "",
    colour: str | None = None,
) -> None:
    """One signal of every joint: entity `where`/<joint> on the timeline `time`.

    Parameters
    ----------
    time: (N,) [s].
    values: (N, n); a joint whose values are all NaN is left out.
    label: what the legend calls the line, beside the joint.
    colour: of every line; None: one a joint.
    """
    time, values = broken_at_gaps(np.asarray(time, dtype=float), np.asarray(values, dtype=float))
    if len(time) == 0:
        return
    index = rr.TimeColumn(TIME, duration=time)
    for j, joint in enumerate(joints):
        if np.isnan(values[:, j]).all():
            continue
        send_line(
            recording,
            path(*where, joint),
            [index],
            values[:, j],
            f"{joint} {label}".strip(),
            colour or series(j),
        )


def send_line(
    recording: Stream,
    entity: str,
    indexes: Sequence[rr.TimeColumn],
    values: Array,
    name: str = "",
    colour: str = "",
    width: float = 1.5,
) -> None:
    """One line of a plot: its name, colour and width if it has its own, and all its values (N,)."""
    if name:
        style = rr.SeriesLines(names=name, colors=rgb(colour), widths=width)
        recording.log(entity, style, static=True)
    recording.send_columns(entity, indexes, rr.Scalars.columns(scalars=np.ascontiguousarray(values)))


def series(number: int) -> str:
    """The colour of the number-th line."""
    return COLOURS.series[number % len(COLOURS.series)]
