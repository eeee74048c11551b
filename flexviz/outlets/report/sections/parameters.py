"""The model's parameters: values, 95 % intervals, identifiability, and what moves with the bandwidth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flexviz.analysis.diagnosis import BandwidthCheck, ParameterCurve
from flexviz.content.records import ParameterEstimate
from flexviz.content.wording import (
    INERTIAL,
    MARKS,
    determined,
    estimate_mark,
    estimate_words,
    joints_text,
    number,
    plain_name,
    plural,
    unit_text,
)
from flexviz.outlets.report import blocks
from flexviz.outlets.report.content import ReportContent
from flexviz.outlets.view import model_curve_charts, physical

MAX_TIES = 3  # listed per parameter
MOST_PAIRS = 8  # of correlated parameters
MAX_PLACES = 8  # columns of a table
LARGE = ((1e-6, "M", 1e7), (1e-3, "k", 1e4))  # factor, prefix, and from which value on
MAX_PARAMETERS = 40  # listed in the bandwidth check
INERTIAL_HEAD = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")


def parameters(content: ReportContent) -> blocks.Section | None:
    """Tables of joint, effect and inertial parameters; None without any result."""
    found = content.parameters
    if not found:
        return None
    inertial = [p for p in found if p.name in INERTIAL]
    main = [p for p in physical(found) if p.name not in INERTIAL]
    return blocks.section(
        "Parameters",
        blocks.explanation(source(content)),
        *_main(main),
        _link_side(content),
        blocks.explanation(_ties(main, content.joints)) if any(p.tied_to for p in main) else None,
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
        how = "Fitted by the diagnosis, as identify does with the same effects"
    return (
        f"{how}. ± is half of a 95 % interval. Motor quantities are expressed at the joint. The data "
        "determine a parameter ● well, ◐ weakly or ○ not at all; a value less than its interval is left out."
    )


def place_of(p: ParameterEstimate) -> str:
    """The joint, payload or group that the parameter belongs to."""
    return ", ".join(part for part in (p.joint, p.payload, p.group) if part) or "all joints"


def _main(found: Sequence[ParameterEstimate]) -> list[blocks.Block]:
    """A row per parameter and a column per joint, in tables of at most `MAX_PLACES` columns."""
    kinds: dict[str, dict[str, ParameterEstimate]] = {}
    for p in found:
        kinds.setdefault(p.name, {})[place_of(p)] = p
    places = list(dict.fromkeys(map(place_of, found)))
    tables: list[blocks.Block] = []
    for first in range(0, len(places), MAX_PLACES):
        shown = places[first : first + MAX_PLACES]
        rows = [_row(name, at, shown) for name, at in kinds.items() if not at.keys().isdisjoint(shown)]
        caption = "" if first else "Parameters of joints and effects, ± 95 %"
        head = ("parameter", *shown)
        tables.append(blocks.table(head, rows, range(1, len(head)), caption, dense=True))
    return tables


def _row(name: str, at: Mapping[str, ParameterEstimate], places: Sequence[str]) -> list[str | blocks.Cell]:
    """Name with unit, and the value at every place; large torques and stiffnesses with the prefix k or M."""
    units = {p.unit for p in at.values()}
    unit = units.pop() if len(units) == 1 else ""  # joints that slide and that turn: each cell has its own
    largest = max(abs(p.value) for p in at.values())
    factor, prefix = next(((f, p) for f, p, least in LARGE if largest >= least), (1.0, ""))
    factor, prefix = (factor, prefix) if unit.startswith("N") else (1.0, "")
    label = f"{plain_name(name)} [{prefix}{unit}]" if unit_text(unit) else plain_name(name)
    cells = [
        ""
        if (p := at.get(place)) is None
        else estimate_mark(p, factor)
        + (f" {unit_text(p.unit)}".rstrip() if units else "")
        + (", at its bound" if p.at_bound else "")
        for place in places
    ]
    return [label, *cells]


def _link_side(content: ReportContent) -> blocks.ReportTable | None:
    """The stiffness that link encoders show and that of the motor side; None without link encoders."""
    found = content.identification or content.diagnosis
    if found is None or not found.link_side:
        return None
    motor = {p.joint: p for p in found.parameters if p.name == "stiffness"}
    rows: list[list[str | blocks.Cell]] = []
    for entry in found.link_side:
        p = motor[entry.joint]
        shown = f"{estimate_words(p)} {MARKS[p.identifiable]}"
        rows.append([entry.joint, shown, blocks.Cell(entry.text, strong=not entry.agrees)])
    head = ("joint", "motor side ± 95 %", "link encoder (95 % interval)")
    return blocks.table(head, rows, (), "Stiffness against the link encoders, which no fit has seen")


def _ties(found: Sequence[ParameterEstimate], joints: Sequence[str]) -> str:
    """Which parameters are correlated; the same two parameters of several joints are named once."""
    pairs: dict[tuple[str, str], dict[str, None]] = {}
    for p in found:
        for tie in p.tied_to[:MAX_TIES]:
            name, _, joint = tie.partition(":")
            own, other = plain_name(p.name), plain_name(name)
            if joint == p.joint and joint in joints:
                one, two = sorted((own, other))
                pairs.setdefault((one, two), {})[joint] = None
            else:
                one, two = sorted((f"{own} of {place_of(p)}", tied(tie)))
                pairs.setdefault((one, two), {})
    texts = [
        f"{one} and {two}" + (f" of {joints_text(list(of), joints)}" if of else "")
        for (one, two), of in pairs.items()
    ]
    more = f"; {len(texts) - MOST_PAIRS} more" if len(texts) > MOST_PAIRS else ""
    return f"Correlated, so that only a combination is known: {'; '.join(texts[:MOST_PAIRS])}{more}."


def tied(name: str) -> str:
    """ "izz:joint1" in words."""
    parameter, _, joint = name.partition(":")
    return plain_name(parameter) + (f" of {joint}" if joint else "")


def _inertias(content: ReportContent, found: Sequence[ParameterEstimate]) -> blocks.Section:
    combinations = content.identification.combinations if content.identification is not None else ()
    matrix = _matrix(content, found)
    if not combinations:
        return blocks.section("Inertias", matrix)
    known = [c for c in combinations if determined(c)]
    only = blocks.explanation(
        f"Motion determines only combinations of the inertial parameters, {len(known)} of "
        f"{len(combinations)} here."
    )
    rows = [[c.name, estimate_mark(c), unit_text(c.unit)] for c in known]
    head = ("combination", "value ± 95 %", "unit")
    title = "Identified combinations of inertial parameters"
    return blocks.section(
        "Inertias", only, blocks.table(head, rows, (1,), title, dense=True) if rows else None, matrix
    )


def _matrix(content: ReportContent, found: Sequence[ParameterEstimate]) -> blocks.ReportTable | None:
    by_place = {(p.joint, p.name): p for p in found}
    rows = []
    for joint in content.joints:
        row = [joint]
        for name in INERTIAL:
            p = by_place.get((joint, name))
            row.append("–" if p is None else _inertial_text(p))
        rows.append(row)
    caption = "Inertial parameters in the joint frame [kg, kg m, kg m²]; ○ not determined"
    return blocks.table(("link moved by", *INERTIAL_HEAD), rows, range(1, 11), caption, dense=True)


def _inertial_text(p: ParameterEstimate) -> str:
    return f"{number(p.value, 3)} {MARKS.get(p.identifiable, '')}" if determined(p) else MARKS["no"]


def guard(content: ReportContent) -> blocks.Section | None:
    """Changes with the observer's bandwidth, which are observer error; None if not examined."""
    if content.diagnosis is None:
        return None
    name = "What moves with the observer's bandwidth"
    found = content.diagnosis.guard
    if found is None:
        return None
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
