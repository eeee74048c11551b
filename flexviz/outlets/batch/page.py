"""The summary page of a fleet: verdicts, drift over dates, outliers, failures."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from datetime import datetime

import numpy as np

from flexviz import __version__
from flexviz.base.statistics import NORMAL_95
from flexviz.content.charts import COLOURS, DASHED, Chart, ChartAxis, ChartSeries, Ribbon
from flexviz.content.wording import effect_text_name, interval, number, plural
from flexviz.outlets.batch.fleet import YEAR, Outlier, ParameterHistory, histories, outliers
from flexviz.outlets.batch.repeatability import repeatability
from flexviz.outlets.batch.repeatability_page import parameter_words, repeatability_section
from flexviz.outlets.batch.rows import DONE, FAILED, WAITING, FleetRow
from flexviz.outlets.report import (
    Block,
    Callout,
    Cell,
    ReportDocument,
    Section,
    Tile,
    Tiles,
    explanation,
    html,
    section,
)
from flexviz.outlets.report import table as report_table

MOST_ROWS = 1000  # of a table on the page; the Parquet table has all
MOST_CHARTS = 8
VERDICTS = {
    "missing": "effects missing",
    "nothing-missing": "nothing missing",
    "unknown": "unknown",
    "not-searched": "stopped before the search",
    "": "not diagnosed",
}
FIRST_SHOWN = ("stiffness", "viscous_friction_sum")  # where nothing drifts, these are drawn


def summary_page(rows: Sequence[FleetRow], title: str, when: datetime) -> str:
    """The page as HTML text."""
    lines, apart = histories(rows), outliers(rows)
    shown = when.strftime("%Y-%m-%d %H:%M")
    sections = [
        _overview(rows, lines, apart), repeatability_section(repeatability(rows)), _drift(rows, lines),
        _outliers(rows, apart), _failures(rows), _sets(rows),
    ]  # fmt: skip
    subtitle = f"{plural(len(rows), 'measurement set')} of {plural(len({r.robot for r in rows}), 'robot')}"
    document = ReportDocument(
        f"Fleet: {title}", f"{subtitle}; {shown}", [], [one for one in sections if one is not None],
        f"Written by flexviz {__version__} on {shown}.",
    )  # fmt: skip
    return html(document)


def found_text(row: FleetRow) -> str:
    """Effects that were added to a set's model: "Coulomb friction joint2"; a dash for none."""
    return ", ".join(effect_text_name(name, family) for name, family in row.named) or "–"


def verdict_words(row: FleetRow) -> str:
    """State or verdict of a set in two words."""
    return VERDICTS.get(row.verdict, row.verdict) if row.state == DONE else row.state


def counted_verdicts(rows: Sequence[FleetRow]) -> str:
    """ "7 effects missing, 3 nothing missing, 1 failed", the most frequent first."""
    counts = Counter(map(verdict_words, rows))
    return ", ".join(f"{count} {words}" for words, count in counts.most_common())


def history_chart(one: ParameterHistory, key: str, height: int = 220) -> Chart:
    """A parameter over its dates with 95 % intervals, and the line through it."""
    days, half = one.days, NORMAL_95 * np.nan_to_num(one.std)
    x = ChartAxis(f"days since {one.first[:10]}", "")
    series = [ChartSeries("value", COLOURS.measured, days, one.value, points=True)]
    if math.isfinite(one.slope):
        fitted = one.offset + one.slope * days
        series.append(ChartSeries("line", COLOURS.model, days, fitted, dash=DASHED))
    ribbons = (Ribbon("± 95 %", COLOURS.measured, days, one.value - half, one.value + half),)
    title = f"{one.robot}: {parameter_words(one.parameter)}"
    return Chart(
        key, title, x, ChartAxis(parameter_words(one.parameter), one.unit), tuple(series), ribbons,
        description=drift_text(one), height=height,
    )  # fmt: skip


def drift_text(one: ParameterHistory) -> str:
    """A sentence on the change of a parameter."""
    if not math.isfinite(one.slope):
        return f"{plural(len(one.days), 'set')}: too few dates for a slope."
    slope, error = interval(YEAR * one.slope, YEAR * one.slope_std)
    change = f"{slope} ± {error} {one.unit} per year"
    if one.drifts:
        return f"Drifts by {number(100 * one.change, 2)} % in {number(np.ptp(one.days), 3)} days ({change})."
    return f"No drift that is certain: {change}."


def _overview(
    rows: Sequence[FleetRow], lines: Sequence[ParameterHistory], apart: Sequence[Outlier]
) -> Section:
    states = Counter(row.state for row in rows)
    verdicts = Counter(row.verdict for row in rows if row.state == DONE)
    tiles = [
        Tile("sets", str(len(rows)), f"{states[DONE]} done, {states[FAILED]} failed"),
        *(Tile(VERDICTS[v], str(verdicts[v])) for v in VERDICTS if verdicts[v] or (v and not verdicts[""])),
        Tile("drifts", str(sum(one.drifts for one in lines)), "parameters"),
        Tile("outliers", str(len({one.row for one in apart})), "sets"),
    ]
    left = states[WAITING]
    rest = f"Not finished: {plural(left, 'set')} left. The same command goes on with them." if left else ""
    effects = Counter(
        (name.partition(":")[0] if not family else "", family)
        for row in rows
        for name, family in set(row.named)
    )
    counted = ", ".join(f"{effect_text_name(*kind)} {count}" for kind, count in effects.most_common(8))
    text = f"Effects added, by the number of places: {counted}." if counted else ""
    return section(
        "Summary", Tiles(tiles), Callout(rest, "warn") if rest else None, explanation(text) if text else None
    )


def _drift(rows: Sequence[FleetRow], lines: Sequence[ParameterHistory]) -> Section | None:
    dated = [one for one in lines if math.isfinite(one.slope)]
    if not dated:
        return section("Drift", explanation("No robot has sets of enough different dates for a drift."))
    drifting = [one for one in dated if one.drifts]
    drawn = drifting or [one for one in dated if one.parameter.partition(":")[0] in FIRST_SHOWN]
    files = sum(row.date_from == "file" for row in rows)
    note = "Dates are those of the sets." if not files else (
        f"{plural(files, 'set')} state no date: there the last change of the tables' files stands for it, "
        "which a copy may have changed. A line `date = 2026-03-01` in measurements.toml states it."
    )  # fmt: skip
    blocks: list[Block] = [explanation(note)]
    if drifting:
        body = [
            [one.robot, parameter_words(one.parameter), *interval(YEAR * one.slope, YEAR * one.slope_std),
             f"{one.unit} per year", f"{number(100 * one.change, 2)} %", str(len(one.days))]
            for one in drifting[:MOST_ROWS]
        ]  # fmt: skip
        head = ("robot", "parameter", "slope", "± 95 %", "unit", "change", "sets")
        blocks.append(report_table(head, body, numbers=(2, 3, 5, 6)))
    else:
        blocks.append(explanation("No parameter drifts with certainty."))
    blocks += [history_chart(one, f"drift{i}") for i, one in enumerate(drawn[:MOST_CHARTS])]
    return section("Drift", *blocks)


def _outliers(rows: Sequence[FleetRow], apart: Sequence[Outlier]) -> Section:
    about = explanation(
        "The latest set of each robot, compared with the median of all robots with the same description (or "
        "the sets of a single robot), in units of their spread and the value's own standard error."
    )
    if not apart:
        return section("Outliers", about, explanation("No value stands out."))
    body = [
        [rows[one.row].set, parameter_words(one.parameter), Cell(number(one.value), strong=True),
         number(one.median), one.unit, f"{one.deviations:+.0f}", str(one.of)]
        for one in apart[:MOST_ROWS]
    ]  # fmt: skip
    head = ("set", "parameter", "value", "median", "unit", "distance", "of")
    return section("Outliers", about, report_table(head, body, numbers=(2, 3, 5, 6)))


def _failures(rows: Sequence[FleetRow]) -> Section | None:
    body = [[row.set, row.error] for row in rows if row.state == FAILED][:MOST_ROWS]
    return section("Failed", report_table(("set", "error"), body)) if body else None


def _sets(rows: Sequence[FleetRow]) -> Section:
    body = [
        [row.set, row.robot, row.day, verdict_words(row),
         found_text(row), _short(row.error_text_before), _short(row.error_text), number(row.seconds, 2)]
        for row in rows[:MOST_ROWS]
    ]  # fmt: skip
    about = (
        "Error: held out, in per cent of the torque and in Nm; of the set's own model and of the last. * "
        "date of the file."
    )
    if len(rows) > MOST_ROWS:
        about += f" The first {MOST_ROWS} of {len(rows)}; the Parquet table has all."
    head = ("set", "robot", "date", "verdict", "added", "error before", "after", "time [s]")
    return section("Sets", explanation(about), report_table(head, body, numbers=(5, 6, 7), dense=True))


def _short(error: str) -> str:
    return error.replace(" of the torque", "")
