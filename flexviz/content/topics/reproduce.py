"""Reproducing the results: data hashes, settings, versions and commands."""

from __future__ import annotations

import platform
import shlex
from importlib.metadata import PackageNotFoundError, version
from itertools import groupby

from flexviz import __version__
from flexviz.content.blocks import (
    Block,
    Items,
    Listing,
    Paragraph,
    Section,
    TableBlock,
    explanation,
    section,
    table,
)
from flexviz.content.session import Analysis
from flexviz.content.topics.data import group_table, set_rows
from flexviz.content.topics.story import Story, shown_time
from flexviz.content.topics.topic import Topic, register
from flexviz.content.wording import number
from flexviz.model.effects import loaded_files

LIBRARIES = ("numpy", "scipy", "pin", "pyarrow")
IN_MEMORY = "in memory, of arrays"
USED = {"fit": "fit", "validate": "validate", "ignore": "not used"}


class Reproduce(Topic):
    """Data, settings, history and command of a report."""

    name = "reproduce"
    title = "To reproduce"

    def section(self, story: Story) -> Section:
        parts = [
            section("Data and settings", _groups(story), _settings(story)),
            section("Again", *_again(story)),
            section("History", *_history(story)),
        ]
        return section(self.title, parts=[part for part in parts if part.blocks])


register(Reproduce())


def _groups(story: Story) -> TableBlock:
    used = {name: USED.get(role, "not used") for name, role in story.analysis.roles}
    return group_table(story.measurements.groups, used)


def _settings(content: Story) -> TableBlock:
    analysis, measurements, robot = content.analysis, content.measurements, content.measurements.robot
    versions = [f"{name} {_version(name)}" for name in LIBRARIES]
    rows = [
        ["measurement set", str(measurements.path) if measurements.in_files else IN_MEMORY],
        *([title[:1].lower() + title[1:], said] for title, said in set_rows(measurements)),
        ["robot description", str(robot.source)],
        ["torque hold", f"{measurements.torque_hold:g} s"],
    ]
    observed = measurements.drive is None  # the motion of servos is simulated instead
    if content.identification is not None and observed:
        found = content.identification
        given = analysis.fit.bandwidth is not None or analysis.fit.gains is not None
        shown = found.observer_entry.tuning if given else "default"
        rows.append(["observer of the identification", f"{found.observer_name}, bandwidth {shown}"])
        rows.append(["refined", "yes" if found.refined else "no"])
    if content.diagnosis is not None:
        if observed:
            rows.append(["observer of the diagnosis", "two zero-phase bands, chosen by the diagnosis"])
            guard = content.diagnosis.guard
            rows.append(["bandwidth check", "none: see the option --guard" if guard is None else "see above"])
        rows.append(["time of the diagnosis", f"{number(content.diagnosis.seconds, 3)} s"])
    rows.append(
        ["versions", f"flexviz {__version__}, Python {platform.python_version()}, {', '.join(versions)}"]
    )
    if content.folder is not None:
        rows.append(["session", str(content.folder)])
    rows.append(["SHA-256 of the set", content.fingerprint.sha256])
    rows += [["recording", str(file)] for file in content.session.recordings]
    return table(("setting", "value"), rows, dense=True)


def _again(content: Story) -> list[Block]:
    blocks: list[Block] = []
    path = shlex.quote(str(content.measurements.path))
    if content.folder is not None:
        blocks.append(Paragraph("This report from the saved results, without recomputing them:"))
        folder = shlex.quote(str(content.folder))
        blocks.append(Listing(f"flexviz report {folder} --out report.html", "sh"))
    if not content.measurements.in_files:
        again = "Everything from the data, in Python; measurements is the set in memory:"
        return [*blocks, Paragraph(again), Listing(program(content), "python")]
    if content.diagnosis is not None and _uses_defaults(content):
        flags = [f"--effects-from {shlex.quote(str(file))}" for file in loaded_files()]
        flags += ["--guard"] if content.diagnosis.guard is not None else []
        again = " ".join([f"flexviz report {path} --out report.html", *flags])
        blocks += [Paragraph("Everything from the data:"), Listing(again, "sh")]
    else:
        blocks += [Paragraph("Everything from the data, in Python:"), Listing(program(content), "python")]
    return [*blocks, explanation("Check that the data are unchanged:"), Listing(_check(content), "sh")]


def _uses_defaults(content: Story) -> bool:
    """Whether the groups have the set's roles and every effect was found, not added by hand."""
    analysis = content.analysis
    plain = Analysis.start(content.measurements).roles == analysis.roles
    found = [finding.text for finding in content.found]
    plain = plain and analysis.drive is None
    return plain and list(analysis.effects) == found and content.identification is None


def program(content: Story) -> str:
    """A Python program that recomputes the present model."""
    analysis = content.analysis
    lines = [
        "from dataclasses import replace",
        "",
        "import flexviz",
        "from flexviz.content.session import with_roles",
        "",
        *(f"flexviz.load_effects({str(file)!r})" for file in loaded_files()),
    ]
    if content.measurements.in_files:
        lines.append(f"measurements = flexviz.read_set({str(content.measurements.path)!r})")
    if analysis.roles != Analysis.start(content.measurements).roles:
        lines.append(f"measurements = with_roles(measurements, {dict(analysis.roles)!r})")
    if analysis.drive is not None:
        lines.append(
            f"measurements = replace(measurements, drive=flexviz.data.measurements.{analysis.drive!r})"
        )
    effects = list(analysis.effects)
    if content.identification is not None:
        lines += [
            "identification = flexviz.identify(",
            "    measurements,",
            f"    effects={effects!r},",
            *(_observer_lines(analysis) if content.measurements.drive is None else []),
            ")",
        ]
    if content.diagnosis is not None:
        lines += [
            f"complete = replace(measurements, effects=(*measurements.effects, *{effects!r}))",
            "diagnosis = flexviz.diagnose(complete, apply=False)",
        ]
    return "\n".join(lines)


def _observer_lines(analysis: Analysis) -> list[str]:
    """Arguments of the identification that servos do not have."""
    return [
        f"    observer={analysis.fit.observer!r},",
        f"    bandwidth={analysis.fit.bandwidth!r},",
        *([f"    gains=flexviz.{analysis.fit.gains!r},"] if analysis.fit.gains else []),
        f"    refine={analysis.fit.refine!r},",
    ]


def _check(content: Story) -> str:
    """A `sha256sum --check` command for the files in the set's folder."""
    files = [f for f in content.fingerprint.files if ":" not in f.name]
    rows = "\n".join(f"{f.sha256}  {f.name}" for f in files)
    return f"cd {shlex.quote(str(content.measurements.path))} && sha256sum --check <<'END'\n{rows}\nEND"


def _history(content: Story) -> list[Block]:
    steps = content.session.steps
    blocks: list[Block] = []
    if len(steps) > 1:
        parts = []
        for when, group in groupby(steps, key=lambda step: (shown_time(step.when) or "–", step.version)):
            parts.append(f"{when[0]}, flexviz {when[1] or '–'}: {'; '.join(step.label for step in group)}.")
        blocks.append(Paragraph(" ".join(parts), quiet=True))
    if content.session.notes:
        times = [f" ({shown_time(note.when)})" if note.when else "" for note in content.session.notes]
        notes = [note.text + time for note, time in zip(content.session.notes, times, strict=True)]
        blocks += [Paragraph("Notes:"), Items(notes)]
    return blocks


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"
