"""Charts as files: SVG and CSV."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence

from flexviz.base.files import zipped
from flexviz.content.charts.chart import Chart
from flexviz.content.charts.svg import FILE, draw_svg


def chart_csv(chart: Chart) -> str:
    """A column for x, for every line and for both edges of every ribbon, as they are drawn."""
    unit = f" [{chart.y.unit}]" if chart.y.unit else ""
    columns = [(chart.x.text, chart.series[0].x)]
    columns += [(f"{one.label}{unit}", one.y) for one in chart.series]
    for ribbon in chart.ribbons:
        columns += [
            (f"{ribbon.label}, {end}{unit}", edge)
            for end, edge in (("low", ribbon.low), ("high", ribbon.high))
        ]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow([label for label, _ in columns])
    table.writerows(
        [[f"{value:.9g}" for value in row] for row in zip(*(values for _, values in columns), strict=False)]
    )
    return text.getvalue()


def chart_name(chart: Chart) -> str:
    """A file name without its ending."""
    return re.sub(r"[^\w]+", "-", chart.title).strip("-").lower() or chart.key


def charts_zip(charts: Sequence[Chart]) -> bytes:
    """A zip with an SVG and a CSV of every chart that has lines."""
    files = []
    for number, chart in enumerate((chart for chart in charts if chart.series), 1):
        name = f"{number}-{chart_name(chart)}"
        files += [(f"{name}.svg", draw_svg(chart, chart.key, FILE)), (f"{name}.csv", chart_csv(chart))]
    return zipped(files)
