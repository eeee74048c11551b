"""Charts that a notebook shows and a file keeps."""

from __future__ import annotations

import html
import re
from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

from flexviz.base.errors import InputError
from flexviz.base.files import write_file
from flexviz.content.charts.chart import Chart
from flexviz.content.charts.files import chart_csv
from flexviz.content.charts.palette import COLOURS
from flexviz.content.charts.svg import SvgTheme, draw_svg

HEAD = 22  # [px] of a title
NOTEBOOK = SvgTheme(720, COLOURS.reference, standalone=True)  # its ink is legible on white and on black


@dataclass(frozen=True, eq=False)
class Figure:
    """One or several charts, one below the other. A notebook displays it.

    Attributes:
        charts: what is drawn, as plain data.
    """

    charts: tuple[Chart, ...]

    def _repr_svg_(self) -> str:
        return self.svg()

    def svg(self) -> str:
        """The charts, each below its title, as one SVG picture."""
        top, parts = 0, []
        for number, chart in enumerate(self.charts):
            drawn = draw_svg(chart, f"c{crc32(chart.title.encode()):x}-{number}", NOTEBOOK)
            place = f'x="{NOTEBOOK.left}" y="{top + 16}" font-size="13" font-weight="bold"'
            parts.append(f"<text {place}>{html.escape(chart.title)}</text>")
            parts.append(drawn.replace("<svg ", f'<svg y="{top + HEAD}" ', 1))
            top += HEAD + int(re.findall(r'viewBox="0 0 \d+ (\d+)"', drawn)[0])
        look = f'font-family="sans-serif" fill="{NOTEBOOK.ink}"'
        size = f'width="{NOTEBOOK.width}" height="{top}"'
        return f'<svg xmlns="http://www.w3.org/2000/svg" {size} {look}>\n{"".join(parts)}</svg>\n'

    def save(self, file: str | Path) -> Path:
        """Write the picture to an .svg file, or the numbers of a single chart to a .csv file."""
        file = Path(file)
        suffix = file.suffix.lower()
        if suffix not in (".svg", ".csv"):
            raise InputError(
                f'"{suffix or file.name}" is no kind of figure, expected .svg or .csv', file=file
            )
        if suffix == ".csv" and len(self.charts) != 1:
            raise InputError("several charts do not fit into one table: choose a joint", file=file)
        write_file(file, self.svg() if suffix == ".svg" else chart_csv(next(iter(self.charts))))
        return file
