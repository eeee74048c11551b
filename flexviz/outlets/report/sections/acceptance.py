"""Whether the result keeps stated limits, for which range that holds, and what it does not prove."""

from __future__ import annotations

from flexviz.analysis.acceptance import NOT_PROVED, AcceptanceResult, acceptance_scope, judge
from flexviz.outlets.report.blocks import Callout, Cell, Items, Paragraph, Section, section, table
from flexviz.outlets.report.content import ReportContent


def accepted(content: ReportContent) -> AcceptanceResult | None:
    """The lines of the limits; None without limits or a result."""
    source = content.diagnosis or content.identification
    if content.limits is None or source is None:
        return None
    return judge(source.document(), content.limits, content.joints)


def acceptance(content: ReportContent) -> Section | None:
    """A row per requirement with figure and limit, the tested range, what is not proved."""
    found = accepted(content)
    if found is None:
        return None
    rows = [
        [
            Cell("pass" if line.passed else "fail", strong=not line.passed),
            line.joint or "all",
            line.what.text,
            line.found.text,
            line.required.text,
        ]
        for line in found.lines
    ]
    scope = acceptance_scope(content.measurements)
    return section(
        "Acceptance",
        Callout(found.text, "good" if found.passed else "missing"),
        table(("", "joint", "requirement", "found", "required"), rows, (3,)),
        Paragraph(scope.text),
        Items([one.fact.text for one in scope.joints]),
        Paragraph("This does not prove:"),
        Items([fact.text for fact in NOT_PROVED]),
    )
