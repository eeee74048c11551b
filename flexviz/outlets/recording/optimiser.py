"""A solve: its result, and the optimiser's iterations with cost, step and every parameter."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence

import numpy as np
import rerun as rr

from flexviz.analysis.identification import Identification
from flexviz.base.iteration import Iteration
from flexviz.base.statistics import NORMAL_95
from flexviz.content.charts import rgb
from flexviz.content.view import falling_cost
from flexviz.outlets.recording.paths import ITERATION, TIME, estimate_path, parameter_path, path
from flexviz.outlets.recording.signals import send_line, series_colour
from flexviz.outlets.recording.stream import Stream

RELATIVE_LIMIT = 10.0  # ratios of a parameter to its last value are clipped here


class Solve:
    """One result, running or done, with the iterations that led to it.

    Timelines: `iteration`, counted from 1, and `time` [s] since the start.

    Attributes:
        number: counted from 1.
        label: description of the model.
        begun: start, a monotonic time [s].
        result: None while running.
        mapped: whether its residual maps were sent.
    """

    def __init__(self, stream: Stream, number: int, label: str) -> None:
        self.number = number
        self.label = label
        self.begun = time.monotonic()
        self.result: Identification | None = None
        self.mapped = False
        self._stream = stream
        self._iterations: list[Iteration] = []
        self._seconds: list[float] = []
        self._sent = 0  # iterations

    @property
    def residuals(self) -> Collection[str]:
        """Groups with a residual."""
        return () if self.result is None else self.result.residuals

    @property
    def seconds(self) -> float:
        """From the start to the last iteration [s]."""
        return self._seconds[-1] if self._seconds else 0.0

    def add(self, iteration: Iteration, seconds: float | None = None) -> None:
        """Add an iteration, `seconds` [s] after the start (None: now); `flush` sends it."""
        self._iterations.append(iteration)
        self._seconds.append(time.monotonic() - self.begun if seconds is None else seconds)

    def flush(self) -> None:
        """Send the iterations since the last flush."""
        first, self._sent = self._sent, len(self._iterations)
        iterations, rows = self._iterations[first:], range(first, self._sent)
        if not iterations:
            return
        for colour, name in enumerate(("cost", "step")):
            values = np.array([float(getattr(iteration, name)) for iteration in iterations])
            where, indexes = path("results", self.number, "optimiser"), self._indexes(rows)
            send_line(self._stream, f"{where}/{name}", indexes, values)  # in the table, not drawn
            shown = falling_cost(self._iterations)[first:] if name == "cost" else values
            usable = np.isfinite(shown) & (shown > 0.0)
            logarithm = np.log10(np.where(usable, shown, np.nan))
            style = (f"log10 {name}", series_colour(colour)) if first == 0 else ("", "")
            send_line(self._stream, f"{where}/log10_{name}", indexes, logarithm, *style)
        where = path("results", self.number, "optimiser", "stage")
        stages = rr.StateChange.columns(state=[iteration.stage for iteration in iterations])
        self._stream.send_columns(where, self._indexes(rows), stages)
        for name in parameter_names(iterations):
            inside, values = self._values(name, rows)
            send_line(self._stream, parameter_path(self.number, name), self._indexes(inside), values)

    def finish(self, result: Identification) -> None:
        """Send the rest of the result's iterations, and all parameters relative to their last value.

        Iterations without a time of arrival are spread evenly.
        """
        self.result = result
        self._send_estimates(result)
        rest = result.iterations[len(self._iterations) :]
        begun = self._seconds[-1] if self._seconds else 0.0
        for place, iteration in enumerate(rest, 1):
            self.add(iteration, begun + (result.seconds - begun) * place / len(rest))
        self.flush()
        stages = list(dict.fromkeys(iteration.stage for iteration in self._iterations))
        if stages:  # Rerun's own colours end in red, as if the last stage had failed
            colours = [rgb(series_colour(place)) for place in range(len(stages))]
            lanes = rr.StateConfiguration(values=stages, colors=colours)
            self._stream.log(path("results", self.number, "optimiser", "stage"), lanes, static=True)
        names = parameter_names(self._iterations)
        if not names:
            return
        relative = np.full((len(self._iterations), len(names)), np.nan)
        errors = {p.label: p.std for p in result.parameters}
        ends = np.full((len(self._iterations), 2 * len(names)), np.nan)
        for place, name in enumerate(names):
            rows, values = self._values(name, range(len(self._iterations)))
            relative[rows, place] = np.clip(values / (values[-1] or 1.0), -RELATIVE_LIMIT, RELATIVE_LIMIT)
            half = min(abs(NORMAL_95 * errors.get(name, np.nan) / (values[-1] or 1.0)), 1.0)
            ends[:, 2 * place : 2 * place + 2] = 1.0 - half, 1.0 + half
        entity = path("results", self.number, "optimiser", "relative")
        colours = [rgb(series_colour(place)) for place in range(len(names))]
        style = rr.SeriesLines(names=[name.replace(":", " ") for name in names], colors=colours, widths=1.5)
        self._stream.log(entity, style, static=True)
        indexes = self._indexes(range(len(self._iterations)))
        self._stream.send_columns(entity, indexes, rr.Scalars.columns(scalars=relative))
        known = np.isfinite(ends).all(axis=0)
        if known.any():  # Rerun draws no bands: both ends as thin lines in the parameter's colour
            entity, chosen = path("results", self.number, "optimiser", "interval"), np.flatnonzero(known)
            labels = [f"{names[k // 2].replace(':', ' ')} ± 95 %" for k in chosen]
            style = rr.SeriesLines(names=labels, colors=[colours[k // 2] for k in chosen], widths=0.5)
            self._stream.log(entity, style, static=True)
            self._stream.send_columns(entity, indexes, rr.Scalars.columns(scalars=ends[:, known]))

    def _send_estimates(self, result: Identification) -> None:
        """Every parameter's value and variance, for all times."""
        for p in result.parameters:
            values = rr.AnyValues(value=p.value, variance=p.std**2, unit=p.unit, identifiable=p.identifiable)
            self._stream.log(estimate_path(self.number, p.label), values, static=True)

    def _values(self, name: str, rows: Sequence[int]) -> tuple[list[int], np.ndarray]:
        """Rows where a parameter is estimated, and its values."""
        inside = [row for row in rows if name in self._iterations[row].names]
        values = [self._iterations[row].values[self._iterations[row].names.index(name)] for row in inside]
        return inside, np.array(values, dtype=float)

    def _indexes(self, rows: Sequence[int]) -> list[rr.TimeColumn]:
        count = rr.TimeColumn(ITERATION, sequence=[row + 1 for row in rows])
        return [count, rr.TimeColumn(TIME, duration=[self._seconds[row] for row in rows])]


def parameter_names(iterations: Sequence[Iteration]) -> list[str]:
    """All parameters that any iteration estimates."""
    return list(dict.fromkeys(name for iteration in iterations for name in iteration.names))
