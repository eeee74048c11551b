"""benchmarks/results/designing.md: what the design study measured."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.design_study import spread, ties
from flexviz.content.charts import Chart, ChartAxis, ChartSeries, draw_svg
from flexviz.content.charts.chart import DASHED, SOLID

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "benchmarks" / "results" / "designing.md"
PICTURE = ROOT / "docs" / "images" / "design-spread.svg"
BLUE, ORANGE = "#0072B2", "#D55E00"
SPREAD = (
    "Realised is the standard deviation of the estimates of `identify --refine` over {seeds} noise seeds of "
    "the full simulation. It is {least:.2f} to {most:.2f} times the predicted standard error; a standard "
    "deviation of {seeds} values is itself uncertain by {own:.0f} %. The designed groups are {worst:.1f} to "
    "{best:.0f} times as accurate as group B (started on its sinusoids), in the same time and within the "
    "positions, speeds, accelerations and torques that B uses."
)
SHOWN = (
    "![Relative standard error of each parameter, predicted and realised, with group B and with the designed "
    "groups](../../docs/images/design-spread.svg)"
)
SHORT = {
    "stiffness": "K",
    "motor_inertia": "B",
    "link_viscous_friction": "f_lv",
    "motor_viscous_friction": "f_mv",
}


def write_spread(rows: dict[str, list[spread.Row]], seeds: int) -> None:
    """The table and the picture of predicted and realised errors."""
    PICTURE.write_text(picture(rows), encoding="utf-8")
    ratios = [row.spread / row.predicted for one in rows.values() for row in one]
    gains = [b.spread / d.spread for b, d in zip(rows["group B"], rows["designed"], strict=True)]
    said = SPREAD.format(
        seeds=seeds,
        least=min(ratios),
        most=max(ratios),
        own=100 / np.sqrt(2 * seeds),
        worst=min(gains),
        best=max(gains),
    )
    text = f"{textwrap.fill(said, 120)}\n\n{SHOWN}\n\n{spread.table(rows)}"
    replace_part("spread", text)


def write_ties(found: Sequence[ties.Outcome]) -> None:
    """The table of ties."""
    broken = sum(one.broken for one in found)
    wrong = sum(one.first[0] != one.hidden for one in found)
    said = (
        f"{len(found)} ties. With the designed group {broken} are broken: the true effect is named, no more "
        f"tied with what it was tied with. The poor record had named the wrong effect in {wrong}."
    )
    text = f"{textwrap.fill(said, 120)}\n\n{ties.table(list(found))}"
    replace_part("ties", text)


def replace_part(name: str, text: str) -> None:
    """Replace what stands between the marks of a part."""
    page = PAGE.read_text(encoding="utf-8")
    head, tail = f"<!-- begin {name} -->", f"<!-- end {name} -->"
    before, _, rest = page.partition(head)
    after = rest.partition(tail)[2]
    PAGE.write_text(f"{before}{head}\n\n{text}\n\n{tail}{after}", encoding="utf-8")


def picture(rows: dict[str, list[spread.Row]]) -> str:
    """Relative errors as SVG."""
    series = []
    for (name, one), colour in zip(rows.items(), (BLUE, ORANGE), strict=True):
        place = np.arange(len(one), dtype=float)
        for kind, dash in (("predicted", DASHED), ("realised", SOLID)):
            errors = [getattr(r, "predicted" if kind == "predicted" else "spread") / r.truth for r in one]
            line = ChartSeries(f"{name}, {kind}", colour, place, 100 * np.array(errors), dash=dash)
            series.append(line)
    labels = [f"{SHORT[r.label.partition(':')[0]]} {r.label[-1]}" for r in rows["group B"]]
    ticks = tuple((float(k), label) for k, label in enumerate(labels))
    chart = Chart(
        key="design-spread",
        title="Relative standard error",
        x=ChartAxis(ticks=ticks, limits=(-0.3, len(labels) - 0.7)),
        y=ChartAxis("relative standard error", "%", logarithmic=True),
        height=240,
        series=tuple(series),
    )
    return draw_svg(chart, "design-spread")
