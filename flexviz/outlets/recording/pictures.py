"""Charts as PNG pictures, whose text is scaled with them, for the viewer's 2D views.

The viewer plots against time only, and its labels keep their size on the screen, so that they cover a small
drawing. The pictures are the charts' SVG: the few kinds of elements that `draw_svg` writes are drawn.
"""

from __future__ import annotations

import io
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from xml.etree import ElementTree

from PIL import Image, ImageColor, ImageDraw, ImageFont

from flexviz.base.arrays import Array
from flexviz.content.charts import PAGE, Chart, cividis, draw_svg

WIDTHS = {1: 720, 2: 480, 3: 400}  # [px] of a chart in so many columns
SCALE, FINE = 2, 2  # pixels per unit of the SVG, and drawn ones per pixel
GAP, TITLE = 16, 24  # [px] between charts, and for the title above each
FONT = 12.5  # [px]
CELL = (96.0, 26.0)  # [px] of a map
BACK, DARK = "#ffffff", "#222222"
BRIGHT = 400  # red + green + blue, from which on text is dark
# what the built-in font lacks
WRITTEN = {"−": "-", "–": "-", "×": "x", "√": "sqrt ", "²": "^2", "³": "^3", "⁵": "^5", "θ": "theta",
           "τ": "tau", "→": "->", "≤": "<=", "µ": "u", "…": "...", "’": "'"}  # fmt: skip

Drawn = tuple[float, float, float, float]


def charts_picture(charts: Sequence[Chart], columns: int) -> bytes:
    """Charts in rows of `columns` with their titles, as PNG."""
    columns = min(columns, len(charts))
    theme = replace(PAGE, width=WIDTHS[columns])
    drawn = [ElementTree.fromstring(draw_svg(chart, chart.key, theme)) for chart in charts]
    heights = [float(svg.attrib["viewBox"].split()[3]) for svg in drawn]
    rows = [max(heights[k : k + columns]) for k in range(0, len(charts), columns)]
    size = columns * (theme.width + GAP) + GAP, sum(rows) + len(rows) * (TITLE + GAP) + GAP
    zoom = SCALE * FINE
    image = Image.new("RGB", (round(zoom * size[0]), round(zoom * size[1])), BACK)
    top = float(GAP)
    for k, (chart, svg) in enumerate(zip(charts, drawn, strict=True)):
        left = GAP + k % columns * (theme.width + GAP)
        _text(image, left + theme.width / 2, top + 14, chart.title, "middle", zoom, 1.1 * FONT)
        for element in svg:
            _draw(image, element, left, top + TITLE, zoom)
        if k % columns == columns - 1:
            top += rows[k // columns] + TITLE + GAP
    out = io.BytesIO()
    image.reduce(FINE).quantize(64).save(out, "PNG", optimize=True)
    return out.getvalue()


def map_picture(title: str, rows: Sequence[str], columns: Sequence[str], shares: Array) -> bytes:
    """Shares (rows, columns) in 0 … 1 as coloured cells with percentages, as PNG; NaN is drawn as –."""
    wide, high, zoom = CELL[0], CELL[1], SCALE * FINE
    left, top = 0.6 * FONT * max(len(name) for name in rows) + GAP, 2.4 * CELL[1]
    size = left + wide * len(columns) + GAP, top + high * len(rows) + GAP
    image = Image.new("RGB", (round(zoom * size[0]), round(zoom * size[1])), BACK)
    pen = ImageDraw.Draw(image)
    _text(image, size[0] / 2, 0.8 * high, title, "middle", zoom, 1.1 * FONT)
    for j, name in enumerate(columns):
        _text(image, left + (j + 0.5) * wide, top - 0.3 * high, name, "middle", zoom, FONT)
    for i, name in enumerate(rows):
        _text(image, left - 0.5 * GAP, top + (i + 0.65) * high, name, "end", zoom, FONT)
        for j, share in enumerate(shares[i]):
            x, y, colour = left + j * wide, top + i * high, cividis(float(share))
            pen.rectangle([zoom * x, zoom * y, zoom * (x + wide - 2), zoom * (y + high - 2)], fill=colour)
            text = f"{100 * share:.0f} %" if share == share else "–"
            ink = DARK if sum(colour) > BRIGHT else BACK
            _text(image, x + wide / 2, y + 0.65 * high, text, "middle", zoom, FONT, ink=ink)
    out = io.BytesIO()
    image.reduce(FINE).save(out, "PNG", optimize=True)
    return out.getvalue()


def _draw(image: Image.Image, element: ElementTree.Element, left: float, top: float, zoom: float) -> None:
    """One element of a chart's SVG, moved by `left` and `top` [px]."""
    kind, at = element.tag.rpartition("}")[2], element.attrib
    if kind == "g":
        x, y = (float(v) for v in re.findall(r"-?[\d.]+", at["transform"])[:2])
        for inner in element:
            most = float(inner.attrib.get("textLength", "inf"))
            _text(image, left + x, top + y, inner.text or "", "up", zoom, FONT, most)
    elif kind == "text":
        x, y = left + float(at["x"]), top + float(at["y"])
        _text(image, x, y, element.text or "", at["text-anchor"], zoom, FONT)
    elif kind in ("line", "polyline", "polygon", "rect", "circle"):
        _shape(image, kind, at, left, top, zoom)


def _shape(image: Image.Image, kind: str, at: dict[str, str], left: float, top: float, zoom: float) -> None:
    def place(x: str | float, y: str | float) -> tuple[float, float]:
        return zoom * (left + float(x)), zoom * (top + float(y))

    pen = ImageDraw.Draw(image, "RGBA")
    if kind == "line":
        ends = [place(at["x1"], at["y1"]), place(at["x2"], at["y2"])]
        pen.line(ends, fill=_colour(at["stroke"], at.get("stroke-opacity")), width=round(zoom))
    elif kind == "polyline":
        points = [place(*pair.split(",")) for pair in at["points"].split()]
        width = zoom * float(at["stroke-width"])
        dashes = [zoom * float(v) for v in at.get("stroke-dasharray", "").split()]
        for part in _dashed(points, dashes) if dashes else [points]:
            if width and len(part) > 1:
                pen.line(part, fill=at["stroke"], width=max(round(width), 1), joint="curve")
    elif kind == "polygon":
        points = [place(*pair.split(",")) for pair in at["points"].split()]
        pen.polygon(points, fill=_colour(at["fill"], at.get("fill-opacity")))
    elif kind == "rect":
        corner = place(at["x"], at["y"])
        far = place(float(at["x"]) + float(at["width"]), float(at["y"]) + float(at["height"]))
        pen.rectangle([corner, far], fill=_colour(at["fill"], at.get("fill-opacity")))
    else:
        (x, y), r = place(at["cx"], at["cy"]), zoom * float(at["r"])
        pen.ellipse([x - r, y - r, x + r, y + r], fill=at["fill"])


def _dashed(points: list[tuple[float, float]], dashes: list[float]) -> list[list[tuple[float, float]]]:
    """The drawn parts of a dashed line."""
    parts, part, index, left = [], [points[0]], 0, dashes[0]
    for (x, y), (x2, y2) in pairwise(points):
        length = ((x2 - x) ** 2 + (y2 - y) ** 2) ** 0.5
        done = 0.0
        while length - done > left:
            done += left
            at = x + (x2 - x) * done / length, y + (y2 - y) * done / length
            if index % 2 == 0:
                parts.append([*part, at])
            part, index = [at], index + 1
            left = dashes[index % len(dashes)]
        left -= length - done
        part.append((x2, y2))
    return parts if index % 2 else [*parts, part]


def _text(
    image: Image.Image, x: float, y: float, text: str, anchor: str, zoom: float, size: float,
    most: float = float("inf"), ink: str = DARK,
) -> None:  # fmt: skip
    """A text whose baseline is at y; anchor "up": centred on x, y and read from below."""
    font, text = _font(round(zoom * size)), written(text)
    if anchor != "up":
        at = zoom * x, zoom * y
        places = {"start": "ls", "middle": "ms", "end": "rs"}
        ImageDraw.Draw(image).text(at, text, fill=ink, font=font, anchor=places[anchor])
        return
    width, height = round(font.getlength(text)) + 2, round(1.4 * zoom * size)
    label = Image.new("L", (width, height), 0)
    ImageDraw.Draw(label).text((1, 0.75 * height), text, fill=255, font=font, anchor="ls")
    label = label.resize((min(width, round(zoom * most)) if most < 1e6 else width, height))
    label = label.rotate(90, expand=True)
    corner = round(zoom * x - 0.75 * height), round(zoom * y - label.height / 2)
    image.paste(ink, corner, label)


def written(text: str) -> str:
    """A text in the characters of the built-in font."""
    text = "".join(WRITTEN.get(letter, letter) for letter in text)
    text = unicodedata.normalize("NFKD", text)
    return "".join(letter for letter in text if letter.isascii() or letter in "±°·“”")


@lru_cache(maxsize=8)
def _font(size: int) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(size=size)
    assert isinstance(font, ImageFont.FreeTypeFont)  # Pillow without FreeType has a bitmap font only
    return font


def _colour(name: str, opacity: str | None) -> tuple[int, ...]:
    return (*ImageColor.getrgb(name)[:3], round(255 * float(opacity or 1.0)))
