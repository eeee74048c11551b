"""The model's parameters: values, 95 % intervals, identifiability, and what moves with the bandwidth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.diagnosis import BandwidthCheck, ParameterCurve
from flexviz.identification import Combination, ParameterEstimate
from flexviz.report import blocks
from flexviz.report.content import ReportContent
from flexviz.view import model_curve_charts, physical
from flexviz.wording import INERTIAL, MARKS, measured_parts, number, plain_name, plural, unit_text

MAX_TIES = 3  # listed per parameter
MAX_PARAMETERS = 40  # listed in the bandwidth check
INERTIAL_HEAD = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")


def parameters(content: ReportContent) -> blocks.Section | None:
    """Tables of joint, effect and inertial parameters; None without any result."""
    found = content.parameters
    if not found:
        return None
    inertial = [p for p in found if p.name in INERTIAL]
    return blocks.section(
        "Parameters",
        blocks.explanation(source(content)),
        _main([p for p in physical(found) if p.name not in INERTIAL]),
        *model_curve_charts(found, blocks.FIGURE_HEIGHT),
        parts=[_inertias(content, inertial)] if inertial else (),
    )


def source(content: ReportContent) -> str:
    """The source of the values, and the meaning of the marks."""
    found = content.identification
    if found is not None:
        how = f"Identified with the observer {found.observer_name}" + (", refined" if found.refined else "")
        how += f" on {plural(len(found.groups), 'group')} ({', '.join(found.groups)})"
    else:
        how = "Fitted by the diagnosis, weighted by the measurement noise"
    return (
        f"{how}. ± is half of a 95 % interval. Motor quantities are expressed at the joint. The data "
        "determine a parameter ● well, ◐ weakly or ○ not at all; the last column lists correlated parameters."
    )


def _value(p: ParameterEstimate | Combination) -> tuple[blocks.Cell, str, str]:
    """A value, half of its 95 % interval, and the unit of both."""
    value, half, unit = measured_parts(p.value, p.std, p.unit)
    return blocks.Cell(value, strong=True), half, unit_text(unit)


def place_of(p: ParameterEstimate) -> str:
    """The joint, payload or group that the parameter belongs to."""
    return ", ".join(part for part in (p.joint, p.payload, p.group) if part) or "all joints"


def grade(p: ParameterEstimate | Combination) -> str:
    """Identifiability as mark and word."""
    return f"{MARKS.get(p.identifiable, '')} {p.identifiable}"


def _main(found: Sequence[ParameterEstimate]) -> blocks.ReportTable:
    rows = []
    places = list(dict.fromkeys(place_of(p) for p in found))
    for p in sorted(found, key=lambda p: places.index(place_of(p))):
        ties = ", ".join(map(tied, p.tied_to[:MAX_TIES])) + (" …" if len(p.tied_to) > MAX_TIES else "")
        mark = grade(p) + (", at its bound" if p.at_bound else "")
        rows.append([place_of(p), plain_name(p.name), *_value(p), mark, ties])
    head = ("joint", "parameter", "value", "± 95 %", "unit", "determined", "tied to")
    return blocks.table(head, rows, (2, 3), "Parameters of joints and effects")


def tied(name: str) -> str:
    """ "izz:joint1" in words."""
    parameter, _, joint = name.partition(":")
    return plain_name(parameter) + (f" of {joint}" if joint else "")


def _inertias(content: ReportContent, found: Sequence[ParameterEstimate]) -> blocks.Section:
    combinations = content.identification.combinations if content.identification is not None else ()
    matrix = _matrix(content, found)
    if not combinations:
        return blocks.section("Inertias", matrix)
    good = sum(c.identifiable == "yes" for c in combinations)
    only = blocks.explanation(
        f"Motion determines only combinations of the inertial parameters: {good} of {len(combinations)} are "
        "identifiable."
    )
    rows = [[c.name, *_value(c), grade(c)] for c in combinations]
    head = ("combination", "value", "± 95 %", "unit", "determined")
    title = "Identifiable combinations of inertial parameters"
    return blocks.section("Inertias", only, blocks.table(head, rows, (1, 2), title, dense=True), matrix)


def _matrix(content: ReportContent, found: Sequence[ParameterEstimate]) -> blocks.ReportTable:
    by_place = {(p.joint, p.name): p for p in found}
    rows = []
    for joint in content.joints:
        row = [joint]
        for name in INERTIAL:
            p = by_place.get((joint, name))
            row.append("–" if p is None else f"{number(p.value, 3)} {MARKS.get(p.identifiable, '')}")
        rows.append(row)
    caption = "Inertial parameters in the joint frame [kg, kg m, kg m²]; values without ● are not unique"
    return blocks.table(("link moved by", *INERTIAL_HEAD), rows, range(1, 11), caption, dense=True)


def guard(content: ReportContent) -> blocks.Section | None:
    """Changes with the observer's bandwidth, which are observer error; None without a diagnosis."""
    if content.diagnosis is None:
        return None
    name = "What moves with the observer's bandwidth"
    found = content.diagnosis.guard
    if found is None:
        option = "Not examined: use the option --guard of flexviz diagnose or flexviz report."
        return blocks.section(name, blocks.explanation(option))
    low, high = number(found.bandwidths[0], 3), number(found.bandwidths[-1], 3)
    holds = "Nothing changes: residuals and parameters stay within their uncertainty."
    return blocks.section(
        name,
        blocks.explanation(
            f"The same model was fitted with the observer ({found.observer}) at {len(found.bandwidths)} "
            f"bandwidths from {low} to {high} rad/s. Changes with the bandwidth are observer error, not "
            "physics of the robot."
        ),
        None if found.texts() else blocks.Paragraph(holds),
        _residuals(found),
        _at_bandwidths(found) if found.parameters else None,
    )


def _residuals(found: BandwidthCheck) -> blocks.ReportTable:
    rows = []
    for j, joint in enumerate(found.joints):
        moves = bool(found.observer_error[j])
        rows.append(
            [
                joint,
                number(found.rms[found.in_use, j], 3),
                number(np.nanmax(found.change[:, j]), 3),
                number(found.noise_floor[j], 3),
                blocks.Cell("part is observer error" if moves else "holds", strong=moves),
            ]
        )
    head = ("joint", "residual [Nm]", "largest change [Nm]", "noise explains [Nm]", "verdict")
    caption = f"Residuals at fixed parameters, compared below {number(found.band, 3)} rad/s"
    return blocks.table(head, rows, (1, 2, 3), caption)


def _at_bandwidths(found: BandwidthCheck) -> blocks.ReportTable:
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
                blocks.Cell("trusted" if p.trusted else "not to be trusted", strong=not p.trusted),
            ]
        )
    head = ("parameter", "joint", "in use", "least", "largest", "unit", "moves by (std. errors)", "verdict")
    more = len(order) - MAX_PARAMETERS
    others = f"; {more} more that do not change" if more > 0 else ""
    return blocks.table(head, rows, (2, 3, 4, 6), f"Parameters fitted at each bandwidth{others}", dense=True)


def _span(p: ParameterCurve) -> tuple[str, str]:
    values = p.values[np.isfinite(p.values)]
    return (number(values.min()), number(values.max())) if values.size else ("–", "–")
