"""The optimiser's iterations: cost, step and every parameter."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

from flexviz.charts import rgb
from flexviz.recording.paths import ITERATION, TIME, parameter_path, result_path
from flexviz.recording.signals import send_line, series_colour
from flexviz.recording.stream import Stream

if TYPE_CHECKING:
    from flexviz.identification import Identification
    from flexviz.progress import Iteration

# To keep the solver fast, iterations are gathered for at least MIN_WAIT, longer while sending would take more
# than MAX_LOAD of the program's processor time, but for at most MAX_WAIT.
MIN_WAIT, MAX_WAIT = 0.25, 4.0  # [s]
MAX_LOAD = 0.02
FIRST_COST = 0.005  # [s] processor time assumed for the first batch
RELATIVE_LIMIT = 10.0  # ratios of a parameter to its last value are clipped here


class Optimiser:
    """The iterations of one solve, sent in batches.

    Timelines: `iteration`, counted from 1, and `time` [s] since the start.
    """

    def __init__(self, stream: Stream, number: int) -> None:
        self._stream = stream
        self._number = number
        self.sent: list[Iteration] = []
        self._seconds: list[float] = []
        self._waiting: list[tuple[Iteration, float]] = []
        self._last = time.monotonic()
        self._used = time.process_time()
        self._cost = FIRST_COST  # [s] processor time of the last batch

    def add(self, iteration: Iteration, seconds: float) -> bool:
        """Add an iteration, `seconds` [s] after the start; returns whether the batch was sent."""
        self._waiting.append((iteration, seconds))
        passed, used = time.monotonic() - self._last, time.process_time() - self._used
        due = passed > MAX_WAIT or (passed > MIN_WAIT and used > self._cost / MAX_LOAD)
        if due:
            self.flush()
        return due

    def flush(self) -> None:
        """Send the waiting iterations."""
        begun = time.thread_time()
        waiting, self._waiting = self._waiting, []
        self.send([iteration for iteration, _ in waiting], [seconds for _, seconds in waiting])
        self._last, self._used = time.monotonic(), time.process_time()
        self._cost = time.thread_time() - begun

    def send(self, iterations: Sequence[Iteration], seconds: Sequence[float]) -> None:
        """Send iterations with their times since the start [s]."""
        if not iterations:
            return
        first = len(self.sent)
        self.sent += iterations
        self._seconds += seconds
        rows = list(range(first, len(self.sent)))
        for colour, name in enumerate(("cost", "step")):
            values = np.array([float(getattr(iteration, name)) for iteration in iterations])
            where, indexes = result_path(self._number, "optimiser"), self._indexes(rows)
            send_line(self._stream, f"{where}/{name}", indexes, values)  # in the table, not drawn
            usable = np.isfinite(values) & (values > 0.0)
            logarithm = np.log10(np.where(usable, values, np.nan))
            style = (f"log10 {name}", series_colour(colour)) if first == 0 else ("", "")
            send_line(self._stream, f"{where}/log10_{name}", indexes, logarithm, *style)
        stages = rr.TextLog.columns(text=[iteration.stage for iteration in iterations])
        where = result_path(self._number, "optimiser", "stage")
        self._stream.send_columns(where, self._indexes(rows), stages)
        for name in parameter_names(iterations):
            inside, values = self._values(name, rows)
            entity = parameter_path(self._number, name)
            send_line(self._stream, entity, self._indexes(inside), values)

    def finish(self, iterations: Sequence[Iteration], seconds: float) -> None:
        """End the solve after `seconds` [s]: send the rest, and all parameters relative to their last value.

        Iterations without a time of arrival are spread evenly.
        """
        self.flush()
        rest = list(iterations[len(self.sent) :])
        begun = self._seconds[-1] if self._seconds else 0.0
        self.send(rest, list(begun + (seconds - begun) * (np.arange(len(rest)) + 1) / max(len(rest), 1)))
        names = parameter_names(self.sent)
        if not names:
            return
        relative = np.full((len(self.sent), len(names)), np.nan)
        for place, name in enumerate(names):
            rows, values = self._values(name, range(len(self.sent)))
            relative[rows, place] = np.clip(values / (values[-1] or 1.0), -RELATIVE_LIMIT, RELATIVE_LIMIT)
        entity = result_path(self._number, "optimiser", "relative")
        colours = [rgb(series_colour(place)) for place in range(len(names))]
        style = rr.SeriesLines(names=[name.replace(":", " ") for name in names], colors=colours, widths=1.5)
        self._stream.log(entity, style, static=True)
        indexes = self._indexes(range(len(self.sent)))
        self._stream.send_columns(entity, indexes, rr.Scalars.columns(scalars=relative))

    def _values(self, name: str, rows: Sequence[int]) -> tuple[list[int], np.ndarray]:
        """Rows where a parameter is estimated, and its values."""
        inside = [row for row in rows if name in self.sent[row].names]
        values = [self.sent[row].values[self.sent[row].names.index(name)] for row in inside]
        return inside, np.array(values, dtype=float)

    def _indexes(self, rows: Sequence[int]) -> list[rr.TimeColumn]:
        seconds = [self._seconds[row] for row in rows]
        return [
            rr.TimeColumn(ITERATION, sequence=[row + 1 for row in rows]),
            rr.TimeColumn(TIME, duration=seconds),
        ]


@dataclass(eq=False)
class Solve:
    """One result, running or done; `label` describes its model, `begun` is a monotonic time [s]."""

    number: int
    label: str
    optimiser: Optimiser
    begun: float
    result: Identification | None = None
    mapped: bool = False

    @property
    def residuals(self) -> Collection[str]:
        """Groups with a residual."""
        return () if self.result is None else self.result.residuals


def parameter_names(iterations: Sequence[Iteration]) -> list[str]:
    """All parameters that any iteration estimates."""
    return list(dict.fromkeys(name for iteration in iterations for name in iteration.names))
