"""The error of each group after every added effect, and where the final model fails."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from flexviz.analysis.diagnosis import Diagnosis, Step
from flexviz.content.charts import Chart
from flexviz.content.records import ResidualMap
from flexviz.content.wording import JointErrors, explained, number, stated_errors, text_names, total_rms
from flexviz.outlets import view
from flexviz.outlets.report.blocks import (
    FIGURE_HEIGHT,
    SMALL_HEIGHT,
    Cell,
    Figures,
    ReportTable,
    Section,
    explanation,
    section,
    table,
)
from flexviz.outlets.report.content import ReportContent
from flexviz.outlets.report.robots import robot_picture
from flexviz.outlets.report.sections.summary import fall
from flexviz.robot.robot import Robot

MAX_MODELS = 7  # columns per table


def staircase(content: ReportContent) -> Section | None:
    """The error step by step, as chart and tables; None without a diagnosis."""
    steps = content.shown
    if not steps:
        return None
    many = len(steps) > 1
    own = text_names((*content.measurements.effects, *content.rounds[0].model.effects), content.joints)
    first = f", with {', '.join(own)}" if own else ""
    adds = "".join(f"; {k} adds {name or 'nothing'}" for k, (name, _, _) in enumerate(content.runs) if k)
    return section(
        "How the error fell" if many else "The error",
        *_top(content, steps),
        explanation(
            "Rms of the torque residual in per cent of the spread of the recorded torque, in one frequency "
            "band for all models; of all joints: the mean. The noise is what the sensors alone would leave, "
            "the same for all models. Held-out groups are never fitted. Model "
            f"0 is the model of the set{first}{adds}."
        ),
        _groups(content, steps),
        _joints(content, steps) if len(content.joints) > 1 else None,
    )


def _top(content: ReportContent, steps: Sequence[Step]) -> list[Figures]:
    """The error step by step, next to a picture of the robot."""
    group = content.shown_group
    picture = None if group is None else robot_picture(content, group)
    chart = _chart(content, steps) if len(steps) > 1 else None
    shown = [one for one in (chart, picture) if one is not None]
    return [Figures(shown, columns=2)] if shown else []


def _chart(content: ReportContent, steps: Sequence[Step]) -> Chart:
    chart = view.staircase_chart(steps, spread=content.spread)
    words = f"{fall(steps, content.spread)} {chart.description}"
    return replace(chart, description=words, note=words, height=FIGURE_HEIGHT)


def _groups(content: ReportContent, steps: Sequence[Step]) -> ReportTable:
    shown = columns(len(steps))

    def mean(rms: Sequence[float]) -> str:
        return number(JointErrors(rms, content.spread).mean, 3)

    rows = []
    for name, used, found in _of_groups(steps):
        rows.append([name, used, *("–" if (row := found[k]) is None else mean(row) for k in shown)])
    rows = rows or [["all", "fit", *(mean(steps[k].rms) for k in shown)]]
    head = ("group", "used to", *(f"model {k}" for k in shown))
    unit = stated_errors(steps[-1], content.spread).unit
    caption = f"Rms residual of each group, mean of all joints [{unit}]"
    return table(head, rows, range(2, len(head)), caption)


def group_rows(steps: Sequence[Step]) -> list[tuple[str, str, list[float]]]:
    """(group, "fit" or "validate", error at each step [Nm]); NaN for steps without the group."""
    out = [
        (name, used, [float("nan") if rms is None else total_rms(rms) for rms in found])
        for name, used, found in _of_groups(steps)
    ]
    return out or [("all", "fit", [total_rms(step.rms) for step in steps])]


def _of_groups(steps: Sequence[Step]) -> Iterator[tuple[str, str, Sequence[Sequence[float] | None]]]:
    """Each group of the last step, its use, and its errors at every step."""
    for last in steps[-1].groups:
        found = [next((one.rms for one in step.groups if one.name == last.name), None) for step in steps]
        yield last.name, "validate" if last.validation else "fit", found


def _joints(content: ReportContent, steps: Sequence[Step]) -> ReportTable:
    held_out = all(step.rms_validation for step in steps)
    shown = columns(len(steps))
    rms = [(step.rms_validation or step.rms) if held_out else step.rms for step in steps]
    errors = [JointErrors(one, content.spread, steps[-1].noise_floor, steps[-1].units) for one in rms]
    last, mark = errors[-1], errors[-1].mark
    rows = [
        [
            joint,
            *(number(errors[k].values[j], 3) for k in shown),
            explained(last.shares[j] / 100),
            last.in_torque(j),
            "–" if mark is None else mark.whole(j).replace("of the torque ", ""),
        ]
        for j, joint in enumerate(content.joints)
    ]
    models = (f"model {k}" for k in shown)
    head = ("joint", *models, "torque explained", "last", "noise")
    what = "held-out groups" if held_out else "fitted groups"
    return table(head, rows, range(1, len(head)), f"Rms residual of each joint [{last.unit}], {what}")


def columns(count: int) -> list[int]:
    """The models shown in a table: the first and the last ones."""
    if count <= MAX_MODELS:
        return list(range(count))
    return [0, *range(count - MAX_MODELS + 1, count)]


def where(content: ReportContent) -> Section | None:
    """Residual map of all joints, the worst joint's leading curve and spectrum; None if they are not kept."""
    diagnosis = content.diagnosis
    if diagnosis is None or not diagnosis.maps:
        return None
    curves = [
        replace(chart, height=SMALL_HEIGHT, note=chart.description)
        for chart in _curves(diagnosis, content.measurements.robot)
        if chart.series
    ]
    return section(
        "Where the model fails",
        explanation(
            "Share of each joint's residual that follows each variable, cross-validated over stretches of "
            "time, so that noise scores about 0. In a joint whose residual is at its noise level nothing is "
            "left to explain, whatever the shares."
        ),
        _map(content, diagnosis.maps),
        *([Figures(curves)] if curves else []),
    )


def _curves(diagnosis: Diagnosis, robot: Robot) -> list[Chart]:
    worst = diagnosis.where[0].joint if diagnosis.where else diagnosis.maps[0].joint
    lead = view.leading_map(diagnosis.maps, worst)
    slides = lead is not None and bool(robot.prismatic[robot.joints.index(lead.joint)])
    spectrum = None if lead is None else view.map_of(diagnosis.maps, lead.joint, "frequency")
    return [
        *([] if lead is None else [view.map_chart(lead).of_joint(slides)]),
        *([] if spectrum is None else [view.spectrum_chart(spectrum).of_joint(slides)]),
        view.free_chart(diagnosis.free_curve),
    ]


def _map(content: ReportContent, maps: Sequence[ResidualMap]) -> ReportTable:
    rows = []
    last = content.steps[-1] if content.steps else None
    for j, joint in enumerate(content.joints):
        row: list[str | Cell] = [joint, "–"]
        if last is not None:
            row[1] = stated_errors(last, content.spread).short(j)
        for variable in view.MAP_COLUMNS:
            found = view.map_of(maps, joint, variable)
            if found is None or not np.isfinite(found.explained):
                row.append("–")
                continue
            share = min(max(found.explained, 0.0), 1.0)
            row.append(Cell(f"{100 * share:.0f} %", share, view.notable(found)))
        rows.append(row)
    head = ("joint", "error", *view.MAP_COLUMNS)
    caption = "Share of each joint's residual that follows each variable; bold: clearly more than chance"
    return table(head, rows, range(1, len(head)), caption)
