"""Bandwidth check: a result that changes with the observer's bandwidth is observer error, not physics."""

from __future__ import annotations

import numpy as np

from flexviz.diagnosis import BandwidthCheck, ParameterCurve
from flexviz.report.blocks import Block, Cell, Paragraph, ReportTable, Section, table
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
        why = "Not examined: use the option --guard of flexviz diagnose or flexviz report."
        return Section(name, (Paragraph(why, quiet=True),))
    low, high = (number(float(value), 3) for value in (found.bandwidths[0], found.bandwidths[-1]))
    blocks: list[Block] = [
        Paragraph(
            f"The same model was fitted with the observer ({found.observer}) at {len(found.bandwidths)} "
            f"bandwidths from {low} to {high} rad/s. Changes with the bandwidth are observer error, not "
            "physics of the robot.",
            quiet=True,
        )
    ]
    if not found.texts():
        blocks.append(Paragraph("Nothing changes: residuals and parameters stay within their uncertainty."))
    blocks.append(_joints(found))
    if found.parameters:
        blocks.append(_parameters(found))
    return Section(name, tuple(blocks))


def _joints(found: BandwidthCheck) -> ReportTable:
    rows = []
    for j, joint in enumerate(found.joints):
        moves = bool(found.observer_error[j])
        rows.append(
            [
                joint,
                number(float(found.rms[found.in_use, j]), 3),
                number(float(np.nanmax(found.change[:, j])), 3),
                number(float(max(np.nanmax(found.change_noise[:, j]), found.noise_floor[j])), 3),
                Cell("part is observer error" if moves else "holds", strong=moves),
            ]
        )
    band = number(found.band, 3)
    head = ("joint", "residual [Nm]", "largest change [Nm]", "noise explains [Nm]", "verdict")
    caption = f"Residuals at fixed parameters, compared below {band} rad/s"
    return table(head, rows, (1, 2, 3), caption)


def _parameters(found: BandwidthCheck) -> ReportTable:
    order = sorted(found.parameters, key=lambda p: (p.trusted, -p.moved))
    rows = []
    for p in order[:MAX_PARAMETERS]:
        place = ", ".join(part for part in (p.joint, p.place) if part) or "–"
        rows.append(
            [
                p.name if p.joint is None and ":" in p.name else plain_name(p.name),  # or a combination
                place,
                number(float(p.values[found.in_use])),
                *_span(p),
                unit_text(p.unit),
                number(p.moved, 2),
                Cell("trusted" if p.trusted else "not to be trusted", strong=not p.trusted),
            ]
        )
    head = ("parameter", "joint", "in use", "least", "largest", "unit", "moves by (std. errors)", "verdict")
    more = len(order) - MAX_PARAMETERS
    caption = "Parameters fitted at each bandwidth" + (
        f"; {more} more that do not change" if more > 0 else ""
    )
    return table(head, rows, (2, 3, 4, 6), caption, dense=True)


def _span(p: ParameterCurve) -> tuple[str, str]:
    values = p.values[np.isfinite(p.values)]
    if not values.size:
        return "–", "–"
    return number(float(values.min())), number(float(values.max()))
