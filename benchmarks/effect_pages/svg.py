"""Line pictures as SVG text, the same bytes on every machine; readable on a light and on a dark page."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GREY = "#7b7b7b"  # as far from white as from a dark page
COLOURS = ("#0072B2", "#D55E00", "#009E73")  # Okabe-Ito, those with contrast on both
DASHES = ("", "7 4", "2 3")  # told apart without colour too
WIDTH, HEIGHT = 480, 270
LEFT, RIGHT, TOP, BOTTOM = 62, 466, 32, 222  # of the plot [px]
TOLERANCE = 1.2  # a point is left out where the line misses it by less [0.1 px]


@dataclass(frozen=True)
class Line:
    """One curve: x and y of shape (N,), and its name for the legend."""

    x: Array
    y: Array
    label: str = ""


def picture(title: str, x_label: str, y_label: str, lines: Sequence[Line]) -> str:
    """The curves with axes, ticks and, where they have names, a legend."""
    x_ticks = ticks(min(float(c.x.min()) for c in lines), max(float(c.x.max()) for c in lines), 7)
    y_ticks = ticks(min(float(c.y.min()) for c in lines), max(float(c.y.max()) for c in lines), 5)
    middle_x, middle_y = (LEFT + RIGHT) // 2, (TOP + BOTTOM) // 2
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
        f'height="{HEIGHT}" role="img" font-family="sans-serif" font-size="12" fill="{GREY}">',
        f"<title>{html.escape(title)}</title>",
    ]
    for value, text in labels(x_ticks):
        at = coordinate(value, x_ticks, LEFT, RIGHT)
        out.append(_rule(at, TOP * 10, at, BOTTOM * 10, value == 0))
        out.append(_text(at, (BOTTOM + 17) * 10, text))
    for value, text in labels(y_ticks):
        at = coordinate(value, y_ticks, BOTTOM, TOP)
        out.append(_rule(LEFT * 10, at, RIGHT * 10, at, value == 0))
        out.append(_text((LEFT - 8) * 10, at + 40, text, "end"))
    out.append(_text(middle_x * 10, (BOTTOM + 38) * 10, x_label))
    out.append(f'<g transform="translate(14 {middle_y}) rotate(-90)">{_text(0, 0, y_label)}</g>')
    start = LEFT
    for line, colour, dash in zip(lines, COLOURS, DASHES, strict=False):
        points = [
            (coordinate(float(x), x_ticks, LEFT, RIGHT), coordinate(float(y), y_ticks, BOTTOM, TOP))
            for x, y in zip(line.x, line.y, strict=True)
        ]
        style = f'fill="none" stroke="{colour}" stroke-width="2" stroke-linejoin="round"'
        style += f' stroke-dasharray="{dash}"' if dash else ""
        out.append(f'<polyline {style} points="{" ".join(_pair(*p) for p in thinned(points))}"/>')
        if line.label:
            out.append(f'<polyline {style} points="{start},14 {start + 24},14"/>')
            out.append(_text((start + 30) * 10, 180, line.label, "start"))
            start += 44 + 7 * len(line.label)
    return "\n".join([*out, "</svg>"]) + "\n"


def ticks(low: float, high: float, count: int) -> tuple[float, int, int]:
    """Round ticks that enclose low … high: step, first and last as multiples of it."""
    if high - low < 1e-9 * max(abs(low), abs(high), 1e-300):
        low, high = 1.2 * min(low, 0.0), 1.2 * max(high, 0.0)
    rough = (high - low) / count or 1.0
    power = 10.0 ** math.floor(math.log10(rough) + 1e-9)
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= rough * (1 - 1e-9))
    return step, math.floor(low / step + 1e-6), math.ceil(high / step - 1e-6)


def labels(scale: tuple[float, int, int]) -> list[tuple[float, str]]:
    """Value and text of every tick."""
    step, first, last = scale
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    values = [0.0 if k == 0 else k * step for k in range(first, last + 1)]
    return [(value, f"{value:.{decimals}f}".replace("-", "−")) for value in values]


def coordinate(value: float, scale: tuple[float, int, int], start: int, end: int) -> int:
    """Where a value lies [0.1 px]; a little aside, so that rounding errors never decide."""
    step, first, last = scale
    share = (value / step - first) / (last - first)
    return math.floor(10 * (start + share * (end - start)) + 0.5 + 1e-4)


def thinned(points: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """The corners that matter (Ramer–Douglas–Peucker), in whole numbers."""
    keep = {0, len(points) - 1}
    stack = [(0, len(points) - 1)]
    xy = np.array(points, dtype=float)
    while stack:
        first, last = stack.pop()
        if last - first < 2:
            continue
        inner, start, along = xy[first + 1 : last], xy[first], xy[last] - xy[first]
        size = max(float(along @ along), 1e-12)
        share = np.clip((inner - start) @ along / size, 0.0, 1.0)
        distance = np.hypot(*(inner - start - share[:, None] * along).T)
        worst = int(np.argmax(distance > distance.max() - 1e-6))
        if distance[worst] > TOLERANCE:
            middle = first + 1 + worst
            keep.add(middle)
            stack += [(first, middle), (middle, last)]
    return [points[k] for k in sorted(keep)]


def _number(tenths: int) -> str:
    whole, rest = divmod(abs(tenths), 10)
    return ("-" if tenths < 0 else "") + (f"{whole}.{rest}" if rest else f"{whole}")


def _pair(x: int, y: int) -> str:
    return f"{_number(x)},{_number(y)}"


def _rule(x1: int, y1: int, x2: int, y2: int, strong: bool) -> str:
    ends = " ".join(f'{k}="{_number(v)}"' for k, v in (("x1", x1), ("y1", y1), ("x2", x2), ("y2", y2)))
    return f'<line {ends} stroke="{GREY}" stroke-opacity="{"0.9" if strong else "0.3"}"/>'


def _text(x: int, y: int, text: str, anchor: str = "middle") -> str:
    return f'<text x="{_number(x)}" y="{_number(y)}" text-anchor="{anchor}">{html.escape(text)}</text>'
