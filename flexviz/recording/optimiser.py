"""The optimiser's way: cost, step and every parameter of each iteration."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

from flexviz.charts import rgb
from flexviz.recording.columns import send_line, series
from flexviz.recording.paths import ITERATION, TIME, parameter_path, result_path
from flexviz.recording.stream import Stream

if TYPE_CHECKING:
    from flexviz.progress import Iteration

BATCH = 0.25  # [s] iterations are gathered before they are sent; so that a solve is not slowed down,
SHARE = 0.02  # they wait while sending would take more than this share of the program's processor time,
COST = 0.005  # [s] that it takes, until that is known
LONGEST = 4.0  # [s] but no longer than this
RELATIVE = 10.0  # parameters farther from their last value than this factor are drawn there


class Optimiser:
    """The iterations of one solve, gathered a little and sent as they come, or all at once.

    They are on `iteration`, counted from 1, and on `time`: seconds since the start.
    """

    def __init__(self, recording: Stream, number: int) -> None:
        self._recording = recording
        self._number = number
        self.sent: list[Iteration] = []
        self._seconds: list[float] = []
        self._waiting: list[tuple[Iteration, float]] = []
        self._last = time.monotonic()
        self._used = time.process_time()
        self._cost = COST  # [s] processor time of the last sending

    def add(self, iteration: Iteration, seconds: float) -> bool:
        """One more, `seconds` [s] after the solve began; says whether what was waiting has been sent."""
        self._waiting.append((iteration, seconds))
        passed, used = time.monotonic() - self._last, time.process_time() - self._used
        due = passed > LONGEST or (passed > BATCH and used > self._cost / SHARE)
        if due:
            self.flush()
        return due

    def flush(self) -> None:
        """Send what is waiting."""
        begun = time.thread_time()
        waiting, self._waiting = self._waiting, []
        self.send([iteration for iteration, _ in waiting], [seconds for _, seconds in waiting])
        self._last, self._used = time.monotonic(), time.process_time()
        self._cost = time.thread_time() - begun

    def send(self, iterations: Sequence[Iteration], seconds: Sequence[float]) -> None:
        """More of them, with the time of each since the solve began [s]."""
        if not iterations:
            return
        first = len(self.sent)
        self.sent += iterations
        self._seconds += seconds
        rows = list(range(first, len(self.sent)))
        for colour, name in enumerate(("cost", "step")):
            values = np.array([float(getattr(iteration, name)) for iteration in iterations])
            self._line(("optimiser", name), rows, values)  # in the table, not drawn
            usable = np.isfinite(values) & (values > 0.0)
            logarithm = np.log10(np.where(usable, values, np.nan))
            style = (f"log10 {name}", series(colour)) if first == 0 else ("", "")
            self._line(("optimiser", f"log10_{name}"), rows, logarithm, *style)
        stages = rr.TextLog.columns(text=[iteration.stage for iteration in iterations])
        where = result_path(self._number, "optimiser", "stage")
        self._recording.send_columns(where, self._indexes(rows), stages)
        for name in parameter_names(iterations):
            inside, values = self._values(name, rows)
            entity = parameter_path(self._number, name)
            send_line(self._recording, entity, self._indexes(inside), values)

    def finish(self, iterations: Sequence[Iteration], seconds: float) -> None:
        """The solve is over after `seconds` [s]: those that were not sent, and all relative to the last.

        Those that came before this are evenly spread over the time where they were not sent one by one.
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
            relative[rows, place] = np.clip(values / (values[-1] or 1.0), -RELATIVE, RELATIVE)
        entity = result_path(self._number, "optimiser", "relative")
        colours = [rgb(series(place)) for place in range(len(names))]
        style = rr.SeriesLines(names=[name.replace(":", " ") for name in names], colors=colours, widths=1.5)
        self._recording.log(entity, style, static=True)
        indexes = self._indexes(range(len(self.sent)))
        self._recording.send_columns(entity, indexes, rr.Scalars.columns(scalars=relative))

    def _values(self, name: str, rows: Sequence[int]) -> tuple[list[int], np.ndarray]:
        """Where a parameter is moved, and its values."""
        inside = [row for row in rows if name in self.sent[row].names]
        values = [self.sent[row].values[self.sent[row].names.index(name)] for row in inside]
        return inside, np.array(values, dtype=float)

    def _indexes(self, rows: Sequence[int]) -> list[rr.TimeColumn]:
        seconds = [self._seconds[row] for row in rows]
        return [
            rr.TimeColumn(ITERATION, sequence=[row + 1 for row in rows]),
            rr.TimeColumn(TIME, duration=seconds),
        ]

    def _line(
        self,
        where: tuple[str, ...],
        rows: Sequence[int],
        values: np.ndarray,
        name: str = "",
        colour: str = "",
    ) -> None:
        entity = result_path(self._number, *where)
        send_line(self._recording, entity, self._indexes(rows), values, name, colour)


def parameter_names(iterations: Sequence[Iteration]) -> list[str]:
    """Every parameter that some iteration moves."""
    return list(dict.fromkeys(name for iteration in iterations for name in iteration.names))
