"""A chart as self-contained SVG without scripts, byte-identical on every machine."""

from __future__ import annotations

import html
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.base.arrays import Indices
from flexviz.content.charts.chart import Array, Chart, ChartSeries, Ribbon
from flexviz.content.charts.palette import COLOURS

RIGHT, TOP, BOTTOM = 12, 10, 46  # [px] margins around the plot area, without the legend
CHARACTER_WIDTH = 6.4  # [px] mean, in the legend
WIDEST = 7.0  # [px] mean width of a character, at most
LEGEND_ROW = 20  # [px] height
MAX_LABEL = 42  # characters of a legend entry
LINE_TOLERANCE = 1.2  # [0.1 px] points closer to the simplified line are dropped
ROUNDING_BIAS = 1e-3  # [0.1 px] keeps floating-point noise from deciding a digit
MIN_LOG_HALF_SPAN = 0.35  # [decades] of a logarithmic y axis

Pixels = NDArray[np.int64]  # tenths of a pixel


@dataclass(frozen=True)
class SvgTheme:
    """Size and colours of a drawn chart.

    Attributes:
        width: [px]; the height follows from chart and legend.
        ink: colour of text and grid lines.
        standalone: set size and font, for a separate file instead of an inline picture.
        left: [px] margin, for the labels of y.
    """

    width: int
    ink: str
    standalone: bool
    left: int = 74


PAGE = SvgTheme(720, "#222222", standalone=False)
PICTURE = SvgTheme(720, "#222222", standalone=True)
FILE = SvgTheme(480, COLOURS.reference, standalone=True)


def draw_svg(chart: Chart, key: str, theme: SvgTheme = PAGE) -> str:
    """The chart as SVG; `key` makes its ids unique on a page."""
    places, rows = _legend_places(chart, theme)
    height = chart.height + LEGEND_ROW * rows
    plane = _Plane(chart, theme, TOP + LEGEND_ROW * rows)
    title, description = f"{key}-t", f"{key}-d"
    size = f' width="{theme.width}" height="{height}" font-family="sans-serif" font-size="12"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {theme.width} {height}"'
        f'{size if theme.standalone else ""} role="img" aria-labelledby="{title} {description}" '
        f'fill="{theme.ink}">',
        f'<title id="{title}">{html.escape(chart.title)}</title>',
        f'<desc id="{description}">{html.escape(chart.description)}</desc>',
        *_axes(chart, plane, theme, height),
    ]
    for first, last in chart.highlights or ():
        left, right = plane.x(np.array([first, last]))
        parts.append(
            f'<rect x="{left / 10:g}" y="{plane.top}" width="{max(right - left, 10) / 10:g}" '
            f'height="{plane.bottom - plane.top}" fill="#F0E442" fill-opacity="0.25"/>'
        )
    parts += [_ribbon(ribbon, plane) for ribbon in chart.ribbons]
    parts += [_line(series, plane) for series in chart.series]
    parts += _legend(places)
    return "\n".join([*parts, "</svg>"]) + "\n"


class _Plane:
    """Mapping from values to tenths of a pixel."""

    def __init__(self, chart: Chart, theme: SvgTheme, top: int) -> None:
        self.top, self.bottom = top, top + chart.height - TOP - BOTTOM
        self.left, self.right = theme.left, theme.width - RIGHT
        paths = [series.path() for series in chart.series]
        xs = [x for x, _ in paths] + [r.x for r in chart.ribbons]
        ys = [y for _, y in paths] + [v for r in chart.ribbons for v in (r.low, r.high)]
        self.x_limits = chart.x.limits or limits(xs, 0.02 if chart.x.ticks else 0.0)
        self.logarithmic = chart.y.logarithmic
        if self.logarithmic:
            low, high = limits([np.log10(y[y > 0]) for y in ys])
            middle, half = (low + high) / 2, MIN_LOG_HALF_SPAN
            self.y_limits = min(low, middle - half), max(high, middle + half)
        else:
            self.y_limits = chart.y.limits or limits(ys)

    def x(self, value: float | Array) -> Pixels:
        return _pixels(value, self.x_limits, self.left, self.right)

    def y(self, value: float | Array) -> Pixels:
        if self.logarithmic:
            value = np.log10(np.maximum(value, 1e-300))
        return _pixels(value, self.y_limits, self.bottom, self.top)


def _pixels(value: float | Array, span: tuple[float, float], start: int, end: int) -> Pixels:
    share = np.clip((np.asarray(value, dtype=float) - span[0]) / (span[1] - span[0]), 0.0, 1.0)
    return np.floor(10 * (start + share * (end - start)) + 0.5 + ROUNDING_BIAS).astype(np.int64)


def limits(values: Sequence[Array], margin: float = 0.04) -> tuple[float, float]:
    """Smallest and largest finite value with a margin; for a constant, a range from zero past the value."""
    found = np.concatenate([np.ravel(v) for v in values]) if values else np.zeros(0)
    found = found[np.isfinite(found)]
    low, high = (float(found.min()), float(found.max())) if found.size else (0.0, 1.0)
    if high - low < 1e-9 * max(abs(low), abs(high)) or high == low:
        return (1.2 * min(low, 0.0), 1.2 * max(high, 0.0)) if high or low else (-1.0, 1.0)
    return low - margin * (high - low), high + margin * (high - low)


def _axes(chart: Chart, plane: _Plane, theme: SvgTheme, height: int) -> Iterator[str]:
    top, bottom, left, right = (10 * edge for edge in (plane.top, plane.bottom, plane.left, plane.right))
    for value, label in log_ticks(*plane.y_limits) if plane.logarithmic else ticks(*plane.y_limits, 5):
        at = int(plane.y(value))
        yield _rule(left, at, right, at, theme.ink, strong=value == 0 and not plane.logarithmic)
        yield _text(left - 70, at + 40, label, "end")
    for value, label in chart.x.ticks or ticks(*plane.x_limits, 7):
        at = int(plane.x(value))
        if not chart.x.ticks:
            yield _rule(at, top, at, bottom, theme.ink, strong=value == 0)
        yield _text(at, bottom + 170, label)
    middle, half = (left + right) // 2, round(5 * WIDEST * len(chart.x.text))
    yield _text(max(min(middle, 10 * theme.width - half), half), 10 * height - 60, chart.x.text)
    middle = (plane.top + plane.bottom) / 2
    most = 2 * min(middle, height - middle)
    yield f'<g transform="translate(14 {middle:g}) rotate(-90)">{_text(0, 0, chart.y.text, most=most)}</g>'


def _ribbon(ribbon: Ribbon, plane: _Plane) -> str:
    out = []
    for rows in stretches(ribbon.x, ribbon.low, ribbon.high):
        x = plane.x(ribbon.x[rows])
        upper = _points(x, plane.y(ribbon.high[rows]))
        lower = _points(x[::-1], plane.y(ribbon.low[rows])[::-1])
        out.append(f'<polygon points="{upper} {lower}" fill="{ribbon.colour}" fill-opacity="0.25"/>')
    return "".join(out)


def _line(series: ChartSeries, plane: _Plane) -> str:
    out = []
    all_x, all_y = series.path()
    for rows in stretches(all_x, all_y):
        x, y = plane.x(all_x[rows]), plane.y(all_y[rows])
        out.append(f'<polyline points="{_points(*thinned(x, y))}" {_stroke(series)}/>')
        if series.points:
            out += [_dot(a, b, series.colour) for a, b in zip(x, y, strict=True)]
    return "".join(out)


def _stroke(series: ChartSeries) -> str:
    dash = f' stroke-dasharray="{" ".join(map(str, series.dash))}"' if series.dash else ""
    colour, width = series.colour, series.width
    return f'fill="none" stroke="{colour}" stroke-width="{width:g}" stroke-linejoin="round"{dash}'


LegendEntry = tuple[int, int, ChartSeries | Ribbon]  # row, x [px], entry


def _legend_places(chart: Chart, theme: SvgTheme) -> tuple[list[LegendEntry], int]:
    """Positions of the legend entries, wrapped into rows, and the number of rows."""
    places: list[LegendEntry] = []
    row, x = 0, theme.left
    for entry in (*chart.series, *chart.ribbons):
        if not entry.label:
            continue
        width = 40 + math.ceil(CHARACTER_WIDTH * len(_short(entry.label)))
        if x > theme.left and x + width > theme.width - RIGHT:
            row, x = row + 1, theme.left
        places.append((row, x, entry))
        x += width
    return places, row + 1 if places else 0


def _legend(places: Sequence[LegendEntry]) -> Iterator[str]:
    for row, x, entry in places:
        y = TOP + LEGEND_ROW * row + 4
        if isinstance(entry, ChartSeries):
            yield f'<polyline points="{x},{y} {x + 26},{y}" {_stroke(entry)}/>'
            if entry.points:
                yield _dot(10 * x + 130, 10 * y, entry.colour)
        else:
            box = f'x="{x}" y="{y - 6}" width="26" height="12"'
            yield f'<rect {box} fill="{entry.colour}" fill-opacity="0.25"/>'
        yield _text(10 * x + 310, 10 * y + 40, _short(entry.label), "start")


def stretches(x: Array, *columns: Array) -> list[Indices]:
    """Consecutive rows in which x and all columns are finite."""
    rows = np.flatnonzero(np.isfinite(np.stack([x, *columns])).all(axis=0))
    return [part for part in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(part)]


def ticks(low: float, high: float, count: int) -> list[tuple[float, str]]:
    """About `count` round values within low … high, with their labels."""
    rough = (high - low) / count
    power = 10.0 ** math.floor(math.log10(rough) + 1e-9)
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    form = ".3g" if decimals > 4 or max(abs(low), abs(high)) >= 1e6 else f".{decimals}f"
    values = [0.0 if k == 0 else k * step for k in range(first, last + 1)]
    return [(value, f"{value:{form}}".replace("-", "−")) for value in values]


def log_ticks(low: float, high: float) -> list[tuple[float, str]]:
    """Round values between 10^low and 10^high, more per decade for short axes."""
    digits = (1, 2, 3, 4, 5, 6, 8) if high - low < 0.9 else (1, 2, 5) if high - low < 2.5 else (1,)
    every = max(1, math.ceil((high - low) / 7))
    powers = [power for power in range(math.floor(low), math.ceil(high) + 1) if power % every == 0]
    values = [digit * 10.0**power for power in powers for digit in digits]
    shown = [value for value in values if low <= math.log10(value) <= high]
    return [(value, f"{value:g}".replace("e-0", "e-").replace("-", "−")) for value in shown]


def thinned(x: Pixels, y: Pixels) -> tuple[Pixels, Pixels]:
    """The line simplified by Ramer–Douglas–Peucker."""
    xy = np.stack((x, y), axis=1).astype(float)
    keep, stack = {0, len(xy) - 1}, [(0, len(xy) - 1)]
    while stack:
        first, last = stack.pop()
        if last - first < 2:
            continue
        inner, along = xy[first + 1 : last] - xy[first], xy[last] - xy[first]
        share = np.clip(inner @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
        distance = np.hypot(*(inner - share[:, None] * along).T)
        worst = int(np.argmax(distance > distance.max() - 1e-6))
        if distance[worst] > LINE_TOLERANCE:
            middle = first + 1 + worst
            keep.add(middle)
            stack += [(first, middle), (middle, last)]
    rows = sorted(keep)
    return x[rows], y[rows]


def _points(x: Pixels, y: Pixels) -> str:
    return " ".join(f"{a / 10:g},{b / 10:g}" for a, b in zip(x, y, strict=True))


def _dot(x: int, y: int, colour: str) -> str:
    return f'<circle cx="{x / 10:g}" cy="{y / 10:g}" r="2.6" fill="{colour}"/>'


def _rule(x1: int, y1: int, x2: int, y2: int, ink: str, strong: bool) -> str:
    ends = f'x1="{x1 / 10:g}" y1="{y1 / 10:g}" x2="{x2 / 10:g}" y2="{y2 / 10:g}"'
    return f'<line {ends} stroke="{ink}" stroke-opacity="{0.7 if strong else 0.2}"/>'


def _text(x: int, y: int, text: str, anchor: str = "middle", most: float = math.inf) -> str:
    """A text, squeezed into `most` [px]."""
    squeezed = f' textLength="{most:g}" lengthAdjust="spacingAndGlyphs"' if WIDEST * len(text) > most else ""
    place = f'x="{x / 10:g}" y="{y / 10:g}" text-anchor="{anchor}"{squeezed}'
    return f"<text {place}>{html.escape(text)}</text>"


def _short(label: str) -> str:
    return label if len(label) <= MAX_LABEL else label[: MAX_LABEL - 1] + "…"
