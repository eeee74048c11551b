"""Writing a session's report as HTML, Markdown or JSON."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from flexviz import __version__
from flexviz.analysis.acceptance import AcceptanceLimits
from flexviz.base.errors import Cancelled, InputError, choose_from
from flexviz.base.files import as_json
from flexviz.base.progress import Progress, ProgressCallback, StopCallback, ignore, never
from flexviz.content.blocks import ReportDocument, Section
from flexviz.content.rendering import html, markdown
from flexviz.content.session import Session, now
from flexviz.content.topics import Story, gather, group_rows, ordered, sentence, shown_time, warnings
from flexviz.content.wording import mounting_text, plural
from flexviz.data.measurements import MeasurementSet

KINDS = ("html", "md", "json")
FORMAT = 1  # of the JSON


def session_report(
    session: Session,
    measurements: MeasurementSet,
    kind: str = "html",
    *,
    folder: Path | None = None,
    changed: tuple[str, ...] = (),
    limits: AcceptanceLimits | None = None,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
) -> str:
    """The report of a session's present state and history as text; no results are computed.

    Args:
        session: the session to report.
        measurements: its measurement set.
        kind: "html" (self-contained), "md" or "json".
        folder: of the saved session, for the command that repeats the report.
        changed: files of the set that have changed since the results were computed (`OpenedSession.changed`).
        limits: of `read_limits`, for a section that says whether the result keeps them.
        progress, should_stop: see `flexviz.base.progress`.

    Raises:
        InputError: for an unknown kind, or a file of the set that cannot be read any more.
        Cancelled: when stopped.
    """
    if kind not in KINDS:
        raise InputError(f'a report cannot be written as "{kind}"; {choose_from(kind, KINDS)}')
    content = gather(session, measurements, folder, changed, limits)
    when = now()
    if kind == "json":
        return as_numbers(content, when)
    write = html if kind == "html" else markdown
    return write(compose(content, shown_time(when), progress, should_stop))


def compose(
    content: Story,
    when: str,
    progress: ProgressCallback = ignore,
    should_stop: StopCallback = never,
) -> ReportDocument:
    """The report's sections in reading order."""
    measurements = content.measurements
    sections: list[Section] = []
    topics = ordered()
    for number, topic in enumerate(topics):
        if should_stop():
            raise Cancelled
        progress(Progress("writing the report", number / len(topics)))
        section = topic.section(content)
        sections += [] if section is None else [section]
    mounted = mounting_text(measurements.robot.gravity)
    seconds = sum(group.duration for group in measurements.groups)
    return ReportDocument(
        f"What was found about {measurements.name}",
        f"{measurements.robot.name}, {plural(measurements.n, 'joint')}{f', {mounted}' if mounted else ''}; "
        f"{plural(len(measurements.groups), 'group')}, {seconds:.0f} s recorded; report of {when}",
        ["simulated data"] if measurements.simulated else [],
        sections,
        f"Written by flexviz {__version__} on {when}.",
    )


def as_numbers(content: Story, when: str) -> str:
    """Results, settings and data hashes as JSON text; numbers that are not finite are null."""
    analysis, measurements = content.analysis, content.measurements
    # the steps of the present model alone; the whole staircase follows
    diagnosis = None if content.diagnosis is None else content.diagnosis.to_dict(steps=False)
    document = {
        "format": FORMAT,
        "flexviz": __version__,
        "written": when,
        "summary": sentence(content),
        "warnings": warnings(content),
        "simulated": measurements.simulated,
        "set": {
            "name": measurements.name,
            "path": str(measurements.path),
            "sha256": content.fingerprint.sha256,
            "files": [asdict(file) for file in content.fingerprint.files],
        },
        "session": None if content.folder is None else str(content.folder),
        "settings": {
            "joints": content.joints,
            "roles": dict(analysis.roles),
            "effects": analysis.effects,
            "observer": analysis.fit.observer,
            "bandwidth": analysis.fit.bandwidth,
            **({"gains": asdict(analysis.fit.gains)} if analysis.fit.gains else {}),
            "refine": analysis.fit.refine,
        },
        "staircase": [
            {
                "added": one.added,
                "rms": one.model.step.rms,
                "rms_validation": one.model.step.rms_validation,
                "noise_floor": one.model.step.noise_floor,
                "verdict": one.model.step.verdict,
            }
            for one in content.rounds
        ],
        "groups": [
            {"name": name, "used_to": used, "rms": values}
            for name, used, values in (group_rows(content.steps) if content.steps else ())
        ],
        "added": [
            {"effect": name, "finding": None if finding is None else finding.to_dict()}
            for name, finding in content.added
        ],
        "diagnosis": diagnosis,
        "identification": None if content.identification is None else content.identification.to_dict(),
        "acceptance": None,
        "guard": None if diagnosis is None else diagnosis["guard"],
        "next_experiments": [],
        "history": [{"when": s.when, "label": s.label, "flexviz": s.version} for s in content.session.steps],
        "notes": [{"when": note.when, "text": note.text} for note in content.session.notes],
        "recordings": [str(file) for file in content.session.recordings],
    }
    told = ((topic.name, topic.numbers(content)) for topic in ordered())
    return as_json(document | {name: numbers for name, numbers in told if numbers is not None})
