"""Charts that are not over time, drawn in a 2D view: they need no timeline, so they are always there.

The viewer plots only over timelines. A residual against position or an error against the number of effects is
therefore drawn: lines in a frame, with the numbers at its edges as labels. Lengths are in the drawing's own
units, y downwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from flexviz.charts import Chart, cividis, rgb
from flexviz.recording.stream import Stream
from flexviz.wording import number

Array = NDArray[np.float64]
HEIGHT = 300.0  # of a frame
WIDE, NARROW = 800.0, 560.0  # width of the only frame, of one of several
ACROSS, DOWN = 980.0, 510.0  # from one frame to the next
ROW = 52.0  # from one label to the next: a label keeps its size on the screen, about 22 pixels
LIFT = 0.5  # of a row: the viewer draws a label below its point
ROWS = 6  # of names beside a frame, then a new column
COLUMN = 300.0  # its width
FRAME = (120, 120, 120)
WORDS = (128, 128, 128)
EDGE = 1.0  # width of a ribbon's edges
CELL = (40, 20)  # width and height of a map's cell
WHITE = (255, 255, 255)


Placed = tuple[float, float, str, tuple[int, int, int]]


@dataclass(frozen=True)
class Words:
    """Text at points of a drawing: positions (M, 2), the texts, their colours."""

    positions: Array
    texts: tuple[str, ...]
    colours: tuple[tuple[int, int, int], ...]

    @staticmethod
    def of(placed: Sequence[Placed], lift: float) -> Words:
        """From (x, y, text, colour) of each, all moved up by `lift`."""
        x, y, texts, colours = zip(*placed, strict=True)
        return Words(np.array([x, y], dtype=float).T - [0.0, lift], texts, colours)

    def send(self, recording: Stream, entity: str, origin: Array | float = 0.0) -> None:
        """Log them, for all times, moved by `origin` (2,)."""
        points = rr.Points2D(
            self.positions + origin,
            labels=list(self.texts),
            colors=list(self.colours),
            radii=[0.0] * len(self.texts),
            show_labels=True,
        )
        recording.log(entity, points, static=True)


def send_charts(recording: Stream, entity: str, charts: Sequence[Chart], columns: int = 2) -> None:
    """Charts in rows of `columns`, those without lines left out."""
    drawn = [chart for chart in charts if any(len(series.x) > 1 for series in chart.series)]
    for place, chart in enumerate(drawn):
        origin = np.array([place % columns * ACROSS, place // columns * DOWN])
        send_chart(recording, f"{entity}/{chart.key}", chart, origin, WIDE if len(drawn) == 1 else NARROW)


def send_chart(recording: Stream, entity: str, chart: Chart, origin: Array, width: float = WIDE) -> None:
    """One chart with its upper left corner at `origin` (2,): entities `entity`/frame, /lines, /words."""
    lines = [(*series.path(), series.colour, series.width) for series in chart.series]
    for ribbon in chart.ribbons:
        lines += [(ribbon.x, edge, ribbon.colour, EDGE) for edge in (ribbon.low, ribbon.high)]
    log = chart.y.logarithmic
    values = [_scaled(y, log) for _, y, _, _ in lines]
    ends = None if chart.y.limits is None else _scaled(np.array(chart.y.limits), log)
    y_low, y_high = limits(np.concatenate(values)) if ends is None else (float(ends[0]), float(ends[1]))
    x = np.concatenate([x for x, _, _, _ in lines])
    x_low, x_high = chart.x.limits or (float(np.nanmin(x)), float(np.nanmax(x)))
    size = np.array([width, HEIGHT])

    def place(x: Array, y: Array) -> Array:
        share = np.stack([(x - x_low) / (x_high - x_low), 1.0 - (y - y_low) / (y_high - y_low)], axis=1)
        return origin + share * size

    strips = [origin + size * np.array([[0, 0], [0, 1], [1, 1], [1, 0], [0, 0]])]
    if y_low < 0.0 < y_high and not log:
        strips.append(place(np.array([x_low, x_high]), np.zeros(2)))
    thin_lines = rr.Radius.ui_points([0.6] * len(strips))
    recording.log(
        f"{entity}/frame",
        rr.LineStrips2D(strips, colors=[FRAME] * len(strips), radii=thin_lines),
        static=True,
    )
    good = [np.isfinite(y) for y in values]
    drawn = rr.LineStrips2D(
        [place(line[0][keep], y[keep]) for line, keep, y in zip(lines, good, values, strict=True)],
        colors=[rgb(colour) for _, _, colour, _ in lines],
        radii=rr.Radius.ui_points([0.6 * width for _, _, _, width in lines]),
    )
    recording.log(f"{entity}/lines", drawn, static=True)
    _words(chart, (x_low, x_high), (y_low, y_high), width).send(recording, f"{entity}/words", origin)


def _words(chart: Chart, x: tuple[float, float], y: tuple[float, float], width: float) -> Words:
    """Title above, the ends of both axes or the ticks, the name of every line beside it; from (0, 0)."""
    ends = [10.0**value for value in y] if chart.y.logarithmic else list(y)
    found: list[Placed] = [
        (width / 2, -1.1 * ROW, chart.heading, WORDS),
        (-1.7 * ROW, 0.3 * ROW, number(ends[1], 2), WORDS),
        (-1.7 * ROW, HEIGHT, number(ends[0], 2), WORDS),
    ]
    shown = chart.x.ticks or [(value, number(value, 3)) for value in x] + [(sum(x) / 2, chart.x.text)]
    for value, text in shown:
        found.append(((value - x[0]) / (x[1] - x[0]) * width, HEIGHT + 0.7 * ROW, text, WORDS))
    for place, series in enumerate(chart.series):
        x_at, y_at = width + (0.6 + place // ROWS) * COLUMN, (0.3 + place % ROWS) * ROW
        found.append((x_at, y_at, series.label, rgb(series.colour)))
    return Words.of(found, 0.0)


def limits(values: Array) -> tuple[float, float]:
    """The lowest and highest of the values with a little room; never the same."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    room = 0.06 * (high - low) or max(abs(high), 1e-12) * 0.1
    return low - room, high + room


def _scaled(values: Array, logarithmic: bool) -> Array:
    if not logarithmic:
        return np.asarray(values, dtype=float)
    return np.log10(np.where(np.asarray(values) > 0.0, values, np.nan))


def send_map(
    recording: Stream, entity: str, title: str, rows: Sequence[str], columns: Sequence[str], shares: Array
) -> None:
    """Shares (rows, columns) of 0 … 1 as coloured cells with their numbers; NaN where there is none."""
    wide, high = CELL
    colours = np.array([[cividis(float(share)) for share in row] for row in shares], dtype=np.uint8)
    picture = np.repeat(np.repeat(colours, high, axis=0), wide, axis=1)
    picture[high - 1 :: high] = picture[:, wide - 1 :: wide] = 0
    recording.log(f"{entity}/cells", rr.Image(picture), static=True)
    texts = [[f"{100 * share:.0f} %" if np.isfinite(share) else "–" for share in row] for row in shares]
    across, down = (np.arange(len(columns)) + 0.5) * wide, (np.arange(len(rows)) + 0.5) * high
    words = [(x, y, texts[i][j], WHITE) for i, y in enumerate(down) for j, x in enumerate(across)]
    words += [(x, -0.5 * high, name, WORDS) for x, name in zip(across, columns, strict=True)]
    words += [(-0.6 * wide, y, name, WORDS) for y, name in zip(down, rows, strict=True)]
    words.append((picture.shape[1] / 2, -1.5 * high, title, WORDS))
    Words.of(words, LIFT * high).send(recording, f"{entity}/words")
