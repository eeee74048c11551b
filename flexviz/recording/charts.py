"""Charts and maps drawn in a 2D view, and those of a diagnosis.

The viewer plots over timelines only, so a residual against position, or an error against the number of
effects, is drawn as lines in a frame with labels. Lengths are in drawing units, y downwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import rerun as rr

from flexviz.arrays import Array
from flexviz.charts import COLOURS, Chart, cividis, rgb
from flexviz.diagnosis import Finding, ResidualMap, Step
from flexviz.recording.paths import TIME, path
from flexviz.recording.signals import send_line
from flexviz.recording.stream import Stream
from flexviz.view import MAP_COLUMNS, map_charts, map_of
from flexviz.wording import effect_text_name, finding_name, number

Colour = tuple[int, int, int]
HEIGHT = 300.0  # of a frame
WIDE, NARROW = 800.0, 560.0  # width of a single frame, and of one of several
ACROSS, DOWN = 980.0, 510.0  # pitch of the frames
LABEL_ROW = 52.0  # between labels, which have a fixed size on the screen, about 22 pixels
LABEL_ROWS = 6  # per column of names beside a frame
LABEL_COLUMN = 300.0  # width of such a column
LIFT = 0.5  # of a cell: the viewer draws a label below its point
FRAME_COLOUR: Colour = (120, 120, 120)
LABEL_COLOUR: Colour = (128, 128, 128)
CELL_LABEL_COLOUR: Colour = (255, 255, 255)
THIN = 0.6  # [screen points] radius of a line of width 1
RIBBON_EDGE = 1.0  # width of a ribbon's edges
CELL_WIDTH, CELL_HEIGHT = 40, 20  # of a map
MAX_EVIDENCE = 3  # findings whose evidence is sent


class Label(NamedTuple):
    """A text at a point of a drawing."""

    x: float
    y: float
    text: str
    colour: Colour = LABEL_COLOUR


def send_labels(stream: Stream, entity: str, labels: Sequence[Label], origin: Array | float = 0.0) -> None:
    """Log labels for all times, offset by `origin` (2,)."""
    points = rr.Points2D(
        np.array([(label.x, label.y) for label in labels], dtype=float) + origin,
        labels=[label.text for label in labels],
        colors=[label.colour for label in labels],
        radii=[0.0] * len(labels),
        show_labels=True,
    )
    stream.log(entity, points, static=True)


def send_charts(stream: Stream, entity: str, charts: Sequence[Chart], columns: int = 2) -> None:
    """Charts in rows of `columns`; charts without lines are omitted."""
    drawn = [chart for chart in charts if any(len(series.x) > 1 for series in chart.series)]
    for place, chart in enumerate(drawn):
        origin = np.array([place % columns * ACROSS, place // columns * DOWN])
        send_chart(stream, f"{entity}/{chart.key}", chart, origin, WIDE if len(drawn) == 1 else NARROW)


def send_chart(stream: Stream, entity: str, chart: Chart, origin: Array, width: float = WIDE) -> None:
    """One chart with its upper left corner at `origin` (2,): entities `entity`/frame, /lines, /words."""
    lines = [(*series.path(), series.colour, series.width) for series in chart.series]
    for ribbon in chart.ribbons:
        lines += [(ribbon.x, edge, ribbon.colour, RIBBON_EDGE) for edge in (ribbon.low, ribbon.high)]
    xs, ys, colours, widths = zip(*lines, strict=True)
    ys = [_scaled(y, chart.y.logarithmic) for y in ys]
    if chart.y.limits is None:
        y_low, y_high = _limits(np.concatenate(ys))
    else:
        y_low, y_high = _scaled(np.array(chart.y.limits), chart.y.logarithmic).tolist()
    x_all = np.concatenate(xs)
    x_low, x_high = chart.x.limits or (float(np.nanmin(x_all)), float(np.nanmax(x_all)))
    size = np.array([width, HEIGHT])

    def place(x: Array, y: Array) -> Array:
        share = np.stack([(x - x_low) / (x_high - x_low), 1.0 - (y - y_low) / (y_high - y_low)], axis=1)
        return origin + share * size

    frame = [origin + size * np.array([[0, 0], [0, 1], [1, 1], [1, 0], [0, 0]])]
    if y_low < 0.0 < y_high and not chart.y.logarithmic:
        frame.append(place(np.array([x_low, x_high]), np.zeros(2)))
    strips = [place(x[np.isfinite(y)], y[np.isfinite(y)]) for x, y in zip(xs, ys, strict=True)]
    _send_strips(stream, f"{entity}/frame", frame, [FRAME_COLOUR] * len(frame), [1.0] * len(frame))
    _send_strips(stream, f"{entity}/lines", strips, [rgb(colour) for colour in colours], widths)
    labels = _labels(chart, (x_low, x_high), (y_low, y_high), width)
    send_labels(stream, f"{entity}/words", labels, origin)


def _send_strips(
    stream: Stream, entity: str, strips: list[Array], colours: list[Colour], widths: Sequence[float]
) -> None:
    radii = rr.Radius.ui_points([THIN * width for width in widths])
    stream.log(entity, rr.LineStrips2D(strips, colors=colours, radii=radii), static=True)


def _labels(chart: Chart, x: tuple[float, float], y: tuple[float, float], width: float) -> list[Label]:
    """Title, axis limits or ticks, and line names of a chart at the origin."""
    low, high = (10.0**value for value in y) if chart.y.logarithmic else y
    found = [
        Label(width / 2, -1.1 * LABEL_ROW, chart.heading),
        Label(-1.7 * LABEL_ROW, 0.3 * LABEL_ROW, number(high, 2)),
        Label(-1.7 * LABEL_ROW, HEIGHT, number(low, 2)),
    ]
    for value, text in chart.x.ticks or [*((v, number(v, 3)) for v in x), (sum(x) / 2, chart.x.text)]:
        found.append(Label((value - x[0]) / (x[1] - x[0]) * width, HEIGHT + 0.7 * LABEL_ROW, text))
    for place, series in enumerate(chart.series):
        column, row = divmod(place, LABEL_ROWS)
        at = width + (0.6 + column) * LABEL_COLUMN, (0.3 + row) * LABEL_ROW
        found.append(Label(*at, series.label, rgb(series.colour)))
    return found


def _limits(values: Array) -> tuple[float, float]:
    """Lowest and highest value with a margin; never equal."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    margin = 0.06 * (high - low) or max(abs(high), 1e-12) * 0.1
    return low - margin, high + margin


def _scaled(values: Array, logarithmic: bool) -> Array:
    if not logarithmic:
        return np.asarray(values, dtype=float)
    return np.log10(np.where(np.asarray(values) > 0.0, values, np.nan))


def send_map(
    stream: Stream, entity: str, title: str, rows: Sequence[str], columns: Sequence[str], shares: Array
) -> None:
    """Shares (rows, columns) in 0 … 1 as coloured cells with percentages; NaN is drawn as –."""
    colours = np.array([[cividis(float(share)) for share in row] for row in shares], dtype=np.uint8)
    picture = np.repeat(np.repeat(colours, CELL_HEIGHT, axis=0), CELL_WIDTH, axis=1)
    picture[CELL_HEIGHT - 1 :: CELL_HEIGHT] = picture[:, CELL_WIDTH - 1 :: CELL_WIDTH] = 0
    stream.log(f"{entity}/cells", rr.Image(picture), static=True)
    across = [(j + 0.5) * CELL_WIDTH for j in range(len(columns))]
    down = [(i + 0.5 - LIFT) * CELL_HEIGHT for i in range(len(rows))]
    labels = [Label(x, -(0.5 + LIFT) * CELL_HEIGHT, name) for x, name in zip(across, columns, strict=True)]
    labels += [Label(-0.6 * CELL_WIDTH, y, name) for y, name in zip(down, rows, strict=True)]
    labels.append(Label(picture.shape[1] / 2, -(1.5 + LIFT) * CELL_HEIGHT, title))
    for (i, j), share in np.ndenumerate(shares):
        text = f"{100 * share:.0f} %" if np.isfinite(share) else "–"
        labels.append(Label(across[j], down[i], text, CELL_LABEL_COLOUR))
    send_labels(stream, f"{entity}/words", labels)


def send_maps(stream: Stream, where: str, joints: tuple[str, ...], maps: Sequence[ResidualMap]) -> None:
    """Where a model fails: `where`/map of all joints, and `where`/curves/<joint>."""
    if not maps:
        return
    shares = np.full((len(joints), len(MAP_COLUMNS)), np.nan)
    for i, joint in enumerate(joints):
        for j, variable in enumerate(MAP_COLUMNS):
            one = map_of(maps, joint, variable)
            if one is not None:
                shares[i, j] = max(one.explained, 0.0)
    title = "share of each joint's residual that each variable explains, out of sample"
    send_map(stream, f"{where}/map", title, joints, list(MAP_COLUMNS.values()), shares)
    for joint in joints:
        send_charts(stream, where + path("curves", joint), map_charts(maps, joint), columns=3)


def step_names(steps: Sequence[Step]) -> list[str]:
    """The effect each step has added, from its finding or else from its model."""
    names: list[str] = []
    before: set[str] = set()
    for place, step in enumerate(steps):
        now = before if step.model is None else {effect.text for effect in step.model.effects}
        added = sorted(effect_text_name(text) for text in now - before)
        if step.added is not None:
            added = [finding_name(step.added)]
        names.append(
            "initial model" if place == 0 else f"+ {', '.join(added)}" if added else "without an effect"
        )
        before = now
    return names


def send_evidence(stream: Stream, number: int, rank: int, finding: Finding) -> None:
    """The residual of a finding's joint before the effect is added, and the effect's signature in it."""
    evidence = finding.evidence
    if evidence is None:
        return
    for group, first, last in evidence.groups:
        index = rr.TimeColumn(TIME, duration=evidence.time[first:last])
        for name, values, colour, width in (
            ("residual", evidence.residual, COLOURS.residual, 4.0),
            ("signature", evidence.signature, COLOURS.model, 1.5),
        ):
            entity = path("diagnoses", number, "evidence", rank, group, name)
            label = f"{name} {evidence.joint}"
            send_line(stream, entity, [index], np.asarray(values[first:last]), label, colour, width)
