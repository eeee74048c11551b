"""Where the model fails: residual map of all joints, and the residual against its leading variable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flexviz.diagnosis import ResidualMap
from flexviz.report.blocks import FIGURE_HEIGHT, Block, Cell, Paragraph, ReportTable, Section, table
from flexviz.report.content import ReportContent
from flexviz.view import (
    MAP_COLUMNS,
    free_chart,
    leading_map,
    map_chart,
    map_of,
    notable,
    spectrum_chart,
)
from flexviz.wording import number


def where(content: ReportContent) -> Section | None:
    """Residual map, curve and spectrum; None if they are not kept."""
    diagnosis = content.diagnosis
    if diagnosis is None or not diagnosis.maps:
        return None
    blocks: list[Block] = [
        Paragraph(
            "Share of each joint's residual that follows each variable, cross-validated over stretches of "
            "time, so that noise scores about 0. In a joint whose residual is at its noise level nothing is "
            "left to explain, whatever the shares.",
            quiet=True,
        ),
        _map(content, diagnosis.maps),
    ]
    worst = diagnosis.where[0].joint if diagnosis.where else diagnosis.maps[0].joint
    lead = leading_map(diagnosis.maps, worst)
    charts = []
    if lead is not None:
        spectrum = map_of(diagnosis.maps, lead.joint, "frequency")
        charts = [map_chart(lead), *([] if spectrum is None else [spectrum_chart(spectrum)])]
    charts.append(free_chart(diagnosis.free_curve))
    blocks += [replace(chart, height=FIGURE_HEIGHT) for chart in charts if chart.series]
    return Section("Where the model fails", tuple(blocks))


def _map(content: ReportContent, maps: Sequence[ResidualMap]) -> ReportTable:
    rows = []
    steps = content.steps
    for j, joint in enumerate(content.joints):
        row: list[str | Cell] = [joint]
        if steps and steps[-1].noise_floor:
            values = steps[-1].rms_validation or steps[-1].rms
            row.append(f"{number(values[j] / max(steps[-1].noise_floor[j], 1e-300), 2)} ×")
        else:
            row.append("–")
        for variable in MAP_COLUMNS:
            found = map_of(maps, joint, variable)
            if found is None or not np.isfinite(found.explained):
                row.append("–")
                continue
            share = min(max(found.explained, 0.0), 1.0)
            row.append(Cell(f"{100 * share:.0f} %", share, notable(found)))
        rows.append(row)
    head = ("joint", "residual / noise", *MAP_COLUMNS)
    return table(
        head, rows, range(1, len(head)),
        "Share of each joint's residual that follows each variable; bold: clearly more than chance",
    )  # fmt: skip
