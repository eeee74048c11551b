"""The model's parameters: values with their 95 % intervals, and whether the data determine them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from flexviz.identification import Combination, ParameterEstimate
from flexviz.report.blocks import Block, Cell, Paragraph, ReportTable, Section, table
from flexviz.report.content import ReportContent
from flexviz.statistics import NORMAL_95
from flexviz.wording import INERTIAL, MARKS, number, plain_name, plural, unit_text, with_error

MAX_TIES = 3
INERTIAL_HEAD = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")


def parameters(content: ReportContent) -> Section | None:
    """Joints, effects, inertias; None before any result."""
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
    """Where the numbers come from, and what the marks mean."""
    found = content.identification
    if found is not None:
        how = f"Identified with the observer {found.observer_name}" + (", refined" if found.refined else "")
        groups = f" on {plural(len(found.groups), 'group')} ({', '.join(found.groups)})"
    else:
        how, groups = "As the diagnosis fitted the model, in units of the measurement noise", ""
    return (
        f"{how}{groups}. ± is half of a 95 % interval. Motor quantities are expressed at the joint. Whether "
        "the data determine a parameter: ● yes, ◐ weakly, ○ no; then what it is tied to."
    )


def interval(value: float, std: float | None) -> tuple[str, str]:
    """A value and half of its 95 % interval."""
    return with_error(value, None if std is None or not math.isfinite(std) else NORMAL_95 * std)


def place_of(p: ParameterEstimate) -> str:
    """The joint, payload or group that it belongs to."""
    return ", ".join(part for part in (p.joint, p.payload, p.group) if part) or "all joints"


def grade(p: ParameterEstimate | Combination) -> str:
    """Mark and word."""
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
                f"Motion shows combinations of the links' inertial parameters, not each of them: {good} of "
                f"{len(combinations)} are determined.",
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
    return table(head, rows, (1, 2), "Combinations of inertial parameters that motion can show", dense=True)


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
        "Inertial parameters about the joint frame [kg, kg m, kg m²]; those without ● are values among many "
        "that fit as well", dense=True,
    )  # fmt: skip
