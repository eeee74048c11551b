"""Writing a session's report as HTML, Markdown or JSON."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from flexviz import __version__
from flexviz.errors import InputError, choose_from
from flexviz.measurements import MeasurementSet
from flexviz.report.blocks import ReportDocument, Section
from flexviz.report.content import ReportContent, gather, shown_time
from flexviz.report.html import html
from flexviz.report.markdown import markdown
from flexviz.report.numbers import numbers
from flexviz.report.sections.effects import effects, telling_apart
from flexviz.report.sections.errors import staircase, where
from flexviz.report.sections.guard import guard
from flexviz.report.sections.parameters import parameters
from flexviz.report.sections.reproduce import reproduce
from flexviz.report.sections.summary import summary
from flexviz.session import Session, now
from flexviz.wording import plural

SECTIONS: tuple[Callable[[ReportContent], Section | None], ...] = (
    summary, staircase, effects, parameters, where, telling_apart, guard, reproduce,
)  # fmt: skip
KINDS = ("html", "md", "json")


def session_report(
    session: Session,
    measurements: MeasurementSet,
    kind: str = "html",
    *,
    folder: Path | None = None,
    changed: tuple[str, ...] = (),
) -> str:
    """The report of a session's present state and history as text; no results are computed.

    Args:
        session: the session to report.
        measurements: its measurement set.
        kind: "html" (self-contained), "md" or "json".
        folder: of the saved session, for the command that repeats the report.
        changed: files of the set that have changed since the results were computed (`OpenedSession.changed`).

    Raises:
        InputError: for an unknown kind, or a file of the set that cannot be read any more.
    """
    if kind not in KINDS:
        raise InputError(f'a report cannot be written as "{kind}"; {choose_from(kind, KINDS)}')
    content = gather(session, measurements, folder, changed)
    when = now()
    if kind == "json":
        return numbers(content, when)
    write = html if kind == "html" else markdown
    return write(compose(content, shown_time(when)))


def compose(content: ReportContent, when: str) -> ReportDocument:
    """The report's sections in reading order."""
    measurements = content.measurements
    seconds = sum(group.duration for group in measurements.groups)
    return ReportDocument(
        f"What was found about {measurements.name}",
        f"{measurements.robot.name}, {plural(measurements.n, 'joint')}; "
        f"{plural(len(measurements.groups), 'group')}, {seconds:.0f} s recorded; report of {when}",
        ["simulated data"] if measurements.simulated else [],
        [section for make in SECTIONS if (section := make(content)) is not None],
        f"Written by flexviz {__version__} on {when}.",
    )
