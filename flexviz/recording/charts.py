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

from flexviz.charts import COLOURS, Plot, cividis, rgb
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


def send_charts(
    recording: Stream,
    entity: str,
    plots: Sequence[Plot],
    columns: int = 2,
    ticks: Sequence[tuple[float, str]] = (),
) -> None:
    """Charts in rows of `columns`, those without lines left out; `ticks`: (x, text) below each of them."""
    drawn = [plot for plot in plots if plot.lines and len(plot.x) > 1]
    for place, plot in enumerate(drawn):
        origin = np.array([place % columns * ACROSS, place // columns * DOWN])
        width = WIDE if len(drawn) == 1 else NARROW
        send_chart(recording, f"{entity}/{plot.key}", plot, origin, width, ticks)


def send_chart(
    recording: Stream,
    entity: str,
    plot: Plot,
    origin: Array,
    width: float = WIDE,
    ticks: Sequence[tuple[float, str]] = (),
) -> None:
    """One chart with its upper left corner at `origin` (2,): entities `entity`/frame, /lines, /words."""
    values = [_scaled(line.values, plot.logarithmic) for line in plot.lines]
    y_low, y_high = limits(np.concatenate(values), _ends(plot))
    x_low, x_high = plot.span or (float(plot.x[0]), float(plot.x[-1]))
    size = np.array([width, HEIGHT])

    def place(x: Array, y: Array) -> Array:
        share = np.stack([(x - x_low) / (x_high - x_low), 1.0 - (y - y_low) / (y_high - y_low)], axis=1)
        return origin + share * size

    corners = origin + size * np.array([[0, 0], [0, 1], [1, 1], [1, 0], [0, 0]])
    strips, colours = [corners], [FRAME]
    if y_low < 0.0 < y_high and not plot.logarithmic:
        strips.append(place(np.array([x_low, x_high]), np.zeros(2)))
        colours.append(FRAME)
    frame = rr.LineStrips2D(strips, colors=colours, radii=rr.Radius.ui_points([0.6] * len(strips)))
    recording.log(f"{entity}/frame", frame, static=True)
    good = [np.isfinite(y) for y in values]
    lines = rr.LineStrips2D(
        [place(plot.x[keep], y[keep]) for keep, y in zip(good, values, strict=True)],
        colors=[rgb(line.colour) for line in plot.lines],
        radii=rr.Radius.ui_points([0.6 * line.width for line in plot.lines]),
    )
    recording.log(f"{entity}/lines", lines, static=True)
    _words(plot, (x_low, x_high), (y_low, y_high), width, ticks).send(recording, f"{entity}/words", origin)


def _words(
    plot: Plot,
    x: tuple[float, float],
    y: tuple[float, float],
    width: float,
    ticks: Sequence[tuple[float, str]],
) -> Words:
    """Title above, the ends of both axes or the ticks, the name of every line beside it; from (0, 0)."""
    ends = [10.0**value for value in y] if plot.logarithmic else list(y)
    found: list[Placed] = [
        (width / 2, -1.1 * ROW, plot.title, WORDS),
        (-1.7 * ROW, 0.3 * ROW, number(ends[1], 2), WORDS),
        (-1.7 * ROW, HEIGHT, number(ends[0], 2), WORDS),
    ]
    shown = ticks or [(value, number(value, 3)) for value in x] + [(sum(x) / 2, plot.x_label)]
    for value, text in shown:
        found.append(((value - x[0]) / (x[1] - x[0]) * width, HEIGHT + 0.7 * ROW, text, WORDS))
    named = [line for line in plot.lines if line.colour != COLOURS.reference or len(plot.lines) < 3]
    for place, line in enumerate(named):
        x_at, y_at = width + (0.6 + place // ROWS) * COLUMN, (0.3 + place % ROWS) * ROW
        found.append((x_at, y_at, line.label, rgb(line.colour)))
    return Words(np.array([f[:2] for f in found]), tuple(f[2] for f in found), tuple(f[3] for f in found))


def limits(values: Array, ends: tuple[float, float] | None = None) -> tuple[float, float]:
    """The lowest and highest of the values with a little room; never the same."""
    if ends is not None:
        return ends
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    room = 0.06 * (high - low) or max(abs(high), 1e-12) * 0.1
    return low - room, high + room


def _ends(plot: Plot) -> tuple[float, float] | None:
    if plot.range is None:
        return None
    low, high = _scaled(np.array(plot.range), plot.logarithmic)
    return float(low), float(high)


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
