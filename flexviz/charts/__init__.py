"""Charts as data and their colours, for screen, report, recording and documents alike."""

from flexviz.charts.palette import COLOURS, cividis, css, gradient, rgb, shares
from flexviz.charts.plots import LEVELS, Line, Plot, aligned, no_plot, thin, time_plot

__all__ = [
    "COLOURS",
    "LEVELS",
    "Line",
    "Plot",
    "aligned",
    "cividis",
    "css",
    "gradient",
    "no_plot",
    "rgb",
    "shares",
    "thin",
    "time_plot",
]
