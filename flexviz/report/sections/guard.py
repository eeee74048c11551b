"""Bandwidth check: a result that changes with the observer's bandwidth is observer error, not physics."""

from __future__ import annotations

import numpy as np

from flexviz.diagnosis import BandwidthCheck, ParameterCurve
from flexviz.report.blocks import Cell, Paragraph, ReportTable, Section, explanation, section, table
from flexviz.report.content import ReportContent
from flexviz.wording import number, plain_name, unit_text

MAX_PARAMETERS = 40  # listed


def guard(content: ReportContent) -> Section | None:
    """Tables of joints and parameters, or the option that computes them; None without a diagnosis."""
    if content.diagnosis is None:
        return None
    name = "What moves with the observer's bandwidth"
    found = content.diagnosis.guard
    if found is None:
        option = "Not examined: use the option --guard of flexviz diagnose or flexviz report."
        return section(name, explanation(option))
    low, high = number(found.bandwidths[0], 3), number(found.bandwidths[-1], 3)
    holds = "Nothing changes: residuals and parameters stay within their uncertainty."
    return section(
        name,
        explanation(
            f"The same model was fitted with the observer ({found.observer}) at {len(found.bandwidths)} "
            f"bandwidths from {low} to {high} rad/s. Changes with the bandwidth are observer error, not "
            "physics of the robot."
        ),
        None if found.texts() else Paragraph(holds),
        _joints(found),
        _parameters(found) if found.parameters else None,
    )


def _joints(found: BandwidthCheck) -> ReportTable:
    rows = []
    for j, joint in enumerate(found.joints):
        moves = bool(found.observer_error[j])
        rows.append(
            [
                joint,
                number(found.rms[found.in_use, j], 3),
                number(np.nanmax(found.change[:, j]), 3),
                number(max(np.nanmax(found.change_noise[:, j]), found.noise_floor[j]), 3),
                Cell("part is observer error" if moves else "holds", strong=moves),
            ]
        )
    head = ("joint", "residual [Nm]", "largest change [Nm]", "noise explains [Nm]", "verdict")
    caption = f"Residuals at fixed parameters, compared below {number(found.band, 3)} rad/s"
    return table(head, rows, (1, 2, 3), caption)


def _parameters(found: BandwidthCheck) -> ReportTable:
    order = sorted(found.parameters, key=lambda p: (p.trusted, -p.moved))
    rows = []
    for p in order[:MAX_PARAMETERS]:
        rows.append(
            [
                p.name if p.joint is None and ":" in p.name else plain_name(p.name),  # or a combination
                ", ".join(part for part in (p.joint, p.place) if part) or "–",
                number(p.values[found.in_use]),
                *_span(p),
                unit_text(p.unit),
                number(p.moved, 2),
                Cell("trusted" if p.trusted else "not to be trusted", strong=not p.trusted),
            ]
        )
    head = ("parameter", "joint", "in use", "least", "largest", "unit", "moves by (std. errors)", "verdict")
    more = len(order) - MAX_PARAMETERS
    others = f"; {more} more that do not change" if more > 0 else ""
    return table(head, rows, (2, 3, 4, 6), f"Parameters fitted at each bandwidth{others}", dense=True)


def _span(p: ParameterCurve) -> tuple[str, str]:
    values = p.values[np.isfinite(p.values)]
    return (number(values.min()), number(values.max())) if values.size else ("–", "–")
