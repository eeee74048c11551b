"""A chart as inline SVG: no script, nothing from outside; lines are told apart without colour too."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flexviz.report.chart import Array, Band, Chart, Curve, limits
from flexviz.wording import escape

WIDTH = 720
LEFT, RIGHT, TOP, BOTTOM = 74, 12, 10, 46  # [px] around the plot, legend not counted
GRID, INK, FAINT = "#d9d9d9", "#222222", "#595959"
CHARACTER = 6.4  # [px] mean width of one in the legend
LEGEND_ROW = 20  # [px]
LONGEST = 42  # characters of a legend's entry


def svg(chart: Chart, key: str) -> str:
    """The chart; `key` makes its ids unique on the page."""
    places, rows = _legend_places(chart)
    plane = _Plane(chart, TOP + LEGEND_ROW * rows)
    height = chart.height + LEGEND_ROW * rows
    title, description = f"{key}-t", f"{key}-d"
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" role="img" '
        f'aria-labelledby="{title} {description}">',
        f'<title id="{title}">{escape(chart.title)}</title>',
        f'<desc id="{description}">{escape(chart.description)}</desc>',
        *_axes(chart, plane, height),
        f'<clipPath id="{key}-c"><rect x="{LEFT}" y="{plane.top}" width="{WIDTH - LEFT - RIGHT}" '
        f'height="{plane.bottom - plane.top}"/></clipPath><g clip-path="url(#{key}-c)">',
    ]
    if chart.span is not None:
        left, right = (plane.x(value) for value in chart.span)
        parts.append(
            f'<rect x="{left:.1f}" y="{plane.top}" width="{max(right - left, 1):.1f}" '
            f'height="{plane.bottom - plane.top}" fill="#F0E442" fill-opacity="0.25"/>'
        )
    parts += [_band(band, plane) for band in chart.bands]
    parts += [_curve(curve, plane) for curve in chart.curves]
    parts.append("</g>")
    parts += _legend(places)
    return "".join([*parts, "</svg>"])


class _Plane:
    """Where values lie on the picture."""

    def __init__(self, chart: Chart, top: int) -> None:
        self.top, self.bottom = top, top + chart.height - TOP - BOTTOM
        xs = [line.x for line in (*chart.curves, *chart.bands)]
        ys = [c.y for c in chart.curves] + [v for b in chart.bands for v in (b.low, b.high)]
        self.x_span = limits(xs, 0.0 if chart.x_ticks is None else 0.02)
        self.logarithmic = chart.logarithmic
        if chart.logarithmic:
            low, high = limits([np.log10(y[y > 0]) for y in ys])
            middle = (low + high) / 2
            self.y_span = min(low, middle - 0.35), max(high, middle + 0.35)
        else:
            self.y_span = limits(ys)

    def x(self, value: float | Array) -> float | Array:
        low, high = self.x_span
        return LEFT + (value - low) / (high - low) * (WIDTH - LEFT - RIGHT)

    def y(self, value: float | Array) -> float | Array:
        low, high = self.y_span
        if self.logarithmic:
            value = np.log10(np.maximum(value, 1e-300))
        return self.bottom - (value - low) / (high - low) * (self.bottom - self.top)


def _axes(chart: Chart, plane: _Plane, height: int) -> list[str]:
    out = []
    y_ticks = log_ticks(*plane.y_span) if plane.logarithmic else ticks(*plane.y_span, 5)
    for value, label in y_ticks:
        at = float(plane.y(value))
        out.append(_rule(LEFT, at, WIDTH - RIGHT, at, strong=value == 0 and not plane.logarithmic))
        out.append(_text(LEFT - 7, at + 4, label, "end"))
    x_ticks = ticks(*plane.x_span, 8) if chart.x_ticks is None else chart.x_ticks
    for value, label in x_ticks:
        at = float(plane.x(value))
        if chart.x_ticks is None:
            out.append(_rule(at, plane.top, at, plane.bottom, strong=value == 0))
        out.append(_text(at, plane.bottom + 17, label))
    middle = (LEFT + WIDTH - RIGHT) / 2
    out.append(_text(middle, height - 6, chart.x_label))
    out.append(
        f'<g transform="translate(14 {(plane.top + plane.bottom) / 2:.1f}) rotate(-90)">'
        f"{_text(0, 0, chart.y_label)}</g>"
    )
    return out


def _band(band: Band, plane: _Plane) -> str:
    out = []
    for rows in stretches(band.x, band.low, band.high):
        there = _points(plane.x(band.x[rows]), plane.y(band.high[rows]))
        back = _points(plane.x(band.x[rows][::-1]), plane.y(band.low[rows][::-1]))
        out.append(f'<polygon points="{there} {back}" fill="{band.colour}" fill-opacity="0.25"/>')
    return "".join(out)


def _curve(curve: Curve, plane: _Plane) -> str:
    out = []
    for rows in stretches(curve.x, curve.y):
        x, y = plane.x(curve.x[rows]), plane.y(curve.y[rows])
        out.append(f'<polyline points="{_points(x, y)}" {_stroke(curve)}/>')
        if curve.marks:
            out += [
                f'<circle cx="{a:.1f}" cy="{b:.1f}" r="2.6" fill="{curve.colour}"/>'
                for a, b in zip(np.atleast_1d(x), np.atleast_1d(y), strict=True)
            ]
    return "".join(out)


def _stroke(curve: Curve) -> str:
    dash = f' stroke-dasharray="{curve.dash}"' if curve.dash else ""
    return f'fill="none" stroke="{curve.colour}" stroke-width="{curve.width:g}" stroke-linejoin="round"{dash}'


LegendEntry = tuple[int, float, Curve | Band]  # row, x, what


def _legend_places(chart: Chart) -> tuple[list[LegendEntry], int]:
    """Where the legend's entries stand: as many a row as there is room for; and how many rows."""
    places: list[LegendEntry] = []
    row, x = 0, float(LEFT)
    for entry in (*chart.curves, *chart.bands):
        if not entry.label:
            continue
        width = 40 + CHARACTER * len(_short(entry.label))
        if x > LEFT and x + width > WIDTH - RIGHT:
            row, x = row + 1, float(LEFT)
        places.append((row, x, entry))
        x += width
    return places, row + 1 if places else 0


def _legend(places: Sequence[LegendEntry]) -> list[str]:
    out = []
    for row, x, entry in places:
        y = TOP + LEGEND_ROW * row + 4
        if isinstance(entry, Curve):
            out.append(f'<polyline points="{x:.1f},{y} {x + 26:.1f},{y}" {_stroke(entry)}/>')
            if entry.marks:
                out.append(f'<circle cx="{x + 13:.1f}" cy="{y}" r="2.6" fill="{entry.colour}"/>')
        else:
            out.append(
                f'<rect x="{x:.1f}" y="{y - 6}" width="26" height="12" fill="{entry.colour}" '
                f'fill-opacity="0.25"/>'
            )
        out.append(_text(x + 31, y + 4, _short(entry.label), "start"))
    return out


def stretches(x: Array, *columns: Array) -> list[NDArray[np.intp]]:
    """Rows between interruptions: where everything is finite."""
    good = np.isfinite(x)
    for column in columns:
        good &= np.isfinite(column)
    rows = np.flatnonzero(good)
    return [part for part in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(part)]


def ticks(low: float, high: float, count: int) -> list[tuple[float, str]]:
    """Round values within low … high, about `count` of them, and their texts."""
    rough = (high - low) / count
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    if decimals > 4 or max(abs(low), abs(high)) >= 1e6:
        shown = [f"{k * step:.3g}" for k in range(first, last + 1)]
    else:
        shown = [f"{k * step:.{decimals}f}" for k in range(first, last + 1)]
    values = [0.0 if k == 0 else k * step for k in range(first, last + 1)]
    return list(zip(values, [text.replace("-", "−") for text in shown], strict=True))


def log_ticks(low: float, high: float) -> list[tuple[float, str]]:
    """Round values between 10^low and 10^high: as many of each decade as there is room for."""
    digits = (1, 2, 3, 4, 5, 6, 8) if high - low < 0.9 else (1, 2, 5) if high - low < 2.5 else (1,)
    every = max(1, math.ceil((high - low) / 7))
    out = []
    for power in range(math.floor(low), math.ceil(high) + 1):
        for digit in digits:
            value = digit * 10.0**power
            if low <= math.log10(value) <= high and power % every == 0:
                out.append((value, f"{value:g}".replace("-", "−")))
    return out


def _points(x: float | Array, y: float | Array) -> str:
    pairs = zip(np.atleast_1d(x), np.atleast_1d(y), strict=True)
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in pairs)


def _rule(x1: float, y1: float, x2: float, y2: float, strong: bool) -> str:
    colour = FAINT if strong else GRID
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{colour}"/>'


def _text(x: float, y: float, text: str, anchor: str = "middle") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{INK}">{escape(text)}</text>'


def _short(label: str) -> str:
    return label if len(label) <= LONGEST else label[: LONGEST - 1] + "…"
