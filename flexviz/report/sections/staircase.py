"""Error of each group after every added effect, with the noise floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexviz.charts import Chart
from flexviz.diagnosis import Step
from flexviz.report.blocks import FIGURE_HEIGHT, Block, Cell, Paragraph, ReportTable, Section, table
from flexviz.report.content import ReportContent
from flexviz.report.sections.summary import fall
from flexviz.view import staircase_chart, total_rms
from flexviz.wording import effect_text_name, number

MAX_MODELS = 7  # columns per table


def staircase(content: ReportContent) -> Section | None:
    """The chart and its numbers; None without a diagnosis."""
    steps = content.steps
    if not steps:
        return None
    blocks: list[Block] = []
    if len(steps) > 1:
        blocks.append(_chart(steps))
    names = [name_of(content, k) for k in range(len(steps))]
    added = "".join(f"; {k} adds {name}" for k, name in enumerate(names) if k)
    blocks.append(
        Paragraph(
            "Rms of the torque residual over all joints, in one frequency band for all models. Held-out "
            f"groups are never fitted. Model 0 is the model of the set{_own(content)}{added}.",
            quiet=True,
        )
    )
    blocks.append(_groups(steps))
    if len(content.joints) > 1:
        blocks.append(_joints(content, steps))
    return Section("How the error fell" if len(steps) > 1 else "The error", tuple(blocks))


def name_of(content: ReportContent, index: int) -> str:
    """The effects that a model adds to the preceding one."""
    return ", ".join(effect_text_name(name) for name in content.rounds[index].added) or "nothing"


def _own(content: ReportContent) -> str:
    own = content.measurements.effects
    hand = content.rounds[0].model.effects
    names = [effect_text_name(name) for name in (*own, *hand)]
    return f", with {', '.join(names)}" if names else ""


def _chart(steps: tuple[Step, ...]) -> Chart:
    chart = staircase_chart(steps)
    return replace(chart, description=f"{fall(steps)} {chart.description}", height=FIGURE_HEIGHT)


def _groups(steps: tuple[Step, ...]) -> ReportTable:
    rows: list[list[str | Cell]] = []
    shown = columns(len(steps))
    for name, used, values in group_rows(steps):
        rows.append([name, used, *(number(values[k], 3) for k in shown)])
    if all(step.noise_floor for step in steps):
        floor = [total_rms(np.asarray(step.noise_floor)) for step in steps]
        rows.append(["noise floor", "", *(number(floor[k], 3) for k in shown)])
    head = ("group", "used to", *(f"model {k}" for k in shown))
    return table(head, rows, range(2, len(head)), "Rms residual [Nm] of each group, all joints")


def group_rows(steps: tuple[Step, ...]) -> list[tuple[str, str, list[float]]]:
    """(group, "fit" or "validate", error at each step [Nm]); NaN for steps without the group."""
    out = []
    for name, _, held_out in steps[-1].groups:
        values = []
        for step in steps:
            row = next((r for other, r, _ in step.groups if other == name), None)
            values.append(float("nan") if row is None else total_rms(np.asarray(row)))
        out.append((name, "validate" if held_out else "fit", values))
    return out or [("all", "fit", [total_rms(np.asarray(step.rms)) for step in steps])]


def _joints(content: ReportContent, steps: tuple[Step, ...]) -> ReportTable:
    held_out = all(step.rms_validation is not None for step in steps)
    shown = columns(len(steps))
    rows: list[list[str | Cell]] = []
    for j, joint in enumerate(content.joints):
        values = [(step.rms_validation or step.rms)[j] if held_out else step.rms[j] for step in steps]
        floor = steps[-1].noise_floor
        rows.append([joint, *(number(values[k], 3) for k in shown), number(floor[j], 3) if floor else "–"])
    head = ("joint", *(f"model {k}" for k in shown), "noise floor")
    what = "held-out groups" if held_out else "fitted groups"
    return table(head, rows, range(1, len(head)), f"Rms residual [Nm] of each joint, {what}")


def columns(count: int) -> list[int]:
    """The models shown in a table: the first and the last ones."""
    if count <= MAX_MODELS:
        return list(range(count))
    return [0, *range(count - MAX_MODELS + 1, count)]
