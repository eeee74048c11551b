"""The model's parameters: values, 95 % intervals and identifiability."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flexviz.identification import Combination, ParameterEstimate
from flexviz.report.blocks import Block, Cell, Paragraph, ReportTable, Section, table
from flexviz.report.content import ReportContent
from flexviz.statistics import NORMAL_95
from flexviz.wording import INERTIAL, MARKS, number, plain_name, plural, unit_text, with_error

MAX_TIES = 3  # listed per parameter
INERTIAL_HEAD = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")


def parameters(content: ReportContent) -> Section | None:
    """Tables of joint, effect and inertial parameters; None without any result."""
    found = content.parameters
    if not found:
        return None
    main = [p for p in found if p.name not in INERTIAL]
    blocks: list[Block] = [Paragraph(source(content), quiet=True), _main(main)]
    parts = []
    inertial = [p for p in found if p.name in INERTIAL]
    if inertial:
        parts.append(Section("Inertias", tuple(_inertias(content, inertial))))
    return Section("Parameters", tuple(blocks), tuple(parts))


def source(content: ReportContent) -> str:
    """The source of the values, and the meaning of the marks."""
    found = content.identification
    if found is not None:
        how = f"Identified with the observer {found.observer_name}" + (", refined" if found.refined else "")
        groups = f" on {plural(len(found.groups), 'group')} ({', '.join(found.groups)})"
    else:
        how, groups = "Fitted by the diagnosis, weighted by the measurement noise", ""
    return (
        f"{how}{groups}. ± is half of a 95 % interval. Motor quantities are expressed at the joint. The data "
        "determine a parameter ● well, ◐ weakly or ○ not at all; the last column lists correlated parameters."
    )


def interval(value: float, std: float | None) -> tuple[str, str]:
    """A value and half of its 95 % interval."""
    return with_error(value, None if std is None or not math.isfinite(std) else NORMAL_95 * std)


def place_of(p: ParameterEstimate) -> str:
    """The joint, payload or group that the parameter belongs to."""
    return ", ".join(part for part in (p.joint, p.payload, p.group) if part) or "all joints"


def grade(p: ParameterEstimate | Combination) -> str:
    """Identifiability as mark and word."""
    return f"{MARKS.get(p.identifiable, '')} {p.identifiable}"


def _main(found: Sequence[ParameterEstimate]) -> ReportTable:
    rows = []
    places = list(dict.fromkeys(place_of(p) for p in found))
    for p in sorted(found, key=lambda p: places.index(place_of(p))):
        value, half = interval(p.value, p.std)
        ties = ", ".join(map(tied, p.tied_to[:MAX_TIES])) + (" …" if len(p.tied_to) > MAX_TIES else "")
        mark = grade(p) + (", at its bound" if p.at_bound else "")
        rows.append(
            [place_of(p), plain_name(p.name), Cell(value, strong=True), half, unit_text(p.unit), mark, ties]
        )
    return table(
        ("joint", "parameter", "value", "± 95 %", "unit", "determined", "tied to"), rows, (2, 3),
        "Parameters of joints and effects",
    )  # fmt: skip


def tied(name: str) -> str:
    """ "izz:joint1" in words."""
    parameter, _, joint = name.partition(":")
    return plain_name(parameter) + (f" of {joint}" if joint else "")


def _inertias(content: ReportContent, found: Sequence[ParameterEstimate]) -> list[Block]:
    blocks: list[Block] = []
    combinations = content.identification.combinations if content.identification is not None else ()
    if combinations:
        good = sum(c.identifiable == "yes" for c in combinations)
        blocks.append(
            Paragraph(
                f"Motion determines only combinations of the inertial parameters: {good} of "
                f"{len(combinations)} are identifiable.",
                quiet=True,
            )
        )
        blocks.append(_combinations(combinations))
    blocks.append(_matrix(content, found))
    return blocks


def _combinations(found: Sequence[Combination]) -> ReportTable:
    rows = []
    for c in found:
        value, half = interval(c.value, c.std)
        rows.append([c.name, Cell(value, strong=True), half, unit_text(c.unit), grade(c)])
    head = ("combination", "value", "± 95 %", "unit", "determined")
    return table(head, rows, (1, 2), "Identifiable combinations of inertial parameters", dense=True)


def _matrix(content: ReportContent, found: Sequence[ParameterEstimate]) -> ReportTable:
    by_place = {(p.joint, p.name): p for p in found}
    rows = []
    for joint in content.joints:
        row: list[str | Cell] = [joint]
        for name in INERTIAL:
            p = by_place.get((joint, name))
            row.append("–" if p is None else f"{number(p.value, 3)} {MARKS.get(p.identifiable, '')}")
        rows.append(row)
    return table(
        ("link moved by", *INERTIAL_HEAD), rows, range(1, 11),
        "Inertial parameters in the joint frame [kg, kg m, kg m²]; values without ● are not unique",
        dense=True,
    )  # fmt: skip
