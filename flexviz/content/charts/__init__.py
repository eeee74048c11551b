"""Charts as plain data, their colours and their SVG, for app, report, recording and documentation."""

from flexviz.content.charts.chart import (
    DASHED,
    DASHES,
    PREFIXES,
    TIME,
    Chart,
    ChartAxis,
    ChartSeries,
    Ribbon,
    ShadedStage,
    finite,
    no_chart,
    thin,
    time_chart,
)
from flexviz.content.charts.figure import Figure
from flexviz.content.charts.files import chart_csv, chart_name, charts_zip
from flexviz.content.charts.palette import COLOURS, cividis, css, gradient, rgb
from flexviz.content.charts.svg import FILE, PAGE, PICTURE, SvgTheme, draw_svg, limits
