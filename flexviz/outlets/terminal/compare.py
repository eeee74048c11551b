"""`flexviz compare A B …`: results of sets, sessions, result files or recordings side by side."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flexviz.base.errors import InputError
from flexviz.outlets.terminal import terminal
from flexviz.outlets.terminal.options import JsonOption
from flexviz.outlets.terminal.terminal import Reporter, interruptible

if TYPE_CHECKING:
    from flexviz.analysis.diagnosis import Diagnosis
    from flexviz.content.comparing import ComparedFriction, KnownResults
    from flexviz.data.measurements import MeasurementSet


def compare(
    sources: Annotated[
        list[Path],
        typer.Argument(metavar="A B…", help="Two or more sets, sessions, result files or recordings."),
    ],
    all_parameters: bool = typer.Option(
        False, "--all", help="Also show single inertial parameters, which are seldom identifiable."
    ),
    json_file: JsonOption = None,
) -> int:
    """Compare results: effects, errors and parameters of sets, sessions, result files or recordings.

    Sets are diagnosed first. Of two sets, the second recorded with a compensation of friction, also: what of
    the friction is gone, per joint and speed, and what is left.
    """
    from flexviz.analysis.diagnosis import diagnose
    from flexviz.content import comparing
    from flexviz.data.measurements import read_set

    terminal.check_output_file(json_file, ".json")
    if len(sources) < 2:
        raise InputError("one result to compare, expected two or more", file=sources[0])
    given = [known_results(source) or read_set(source) for source in sources]
    known: list[KnownResults] = []
    sets: list[tuple[MeasurementSet, Diagnosis]] = []
    with Reporter("diagnosing") as report, interruptible("nothing is compared") as should_stop:
        for one in given:
            if isinstance(one, comparing.KnownResults):
                known.append(one)
                continue
            diagnosis = diagnose(one, apply=True, progress=report, should_stop=should_stop)
            if diagnosis.stopped:
                return 130
            sets.append((one, diagnosis))
            known.append(of_set(one, diagnosis))
    found = comparing.compare(known)
    terminal.show_blocks(comparing.comparison_blocks(found, all_parameters))
    friction = show_friction(*sets) if len(sets) == len(sources) == 2 else {}
    terminal.write_json(json_file, found.to_dict() | friction)
    return 0


def known_results(source: Path) -> KnownResults | None:
    """The results in a session, a file or a recording; None of anything else, as a set."""
    from flexviz.content.comparing import KnownResults
    from flexviz.content.results import SUFFIXES, read_result
    from flexviz.content.session import is_session, open_session
    from flexviz.data.measurements import fingerprint

    if is_session(source):
        opened = open_session(source)
        analysis, changed = opened.session.analysis, bool(opened.changed)
        fit, diagnosis = analysis.identification, analysis.diagnosis
        # of changed data nothing is up to date, which `changed` tells
        return KnownResults(
            opened.folder.resolve().name,
            opened.measurements.name,
            fit.document() if fit is not None and (analysis.up_to_date or changed) else None,
            diagnosis.document()
            if diagnosis is not None and (analysis.diagnosis_up_to_date or changed)
            else None,
            fingerprint(opened.measurements).sha256,
            (*opened.measurements.effects, *analysis.effects),
            opened.changed,
        )
    if source.suffix.lower() == ".rrd":
        from flexviz.outlets.recording import check_recording, read_recording

        return read_recording(check_recording(source).file).known
    if source.suffix.lower() not in SUFFIXES:
        return None
    document = read_result(source)
    fit, diagnosis = (document, None) if document.model is None else (None, document)
    return KnownResults(source.name, document.set, fit, diagnosis, document.set_sha256 or "")


def of_set(measurements: MeasurementSet, diagnosis: Diagnosis) -> KnownResults:
    """What is compared of a set that has been diagnosed."""
    from flexviz.content.comparing import KnownResults
    from flexviz.data.measurements import fingerprint

    sha256 = fingerprint(measurements).sha256
    return KnownResults(measurements.name, measurements.name, None, diagnosis.document(), sha256)


def show_friction(before: tuple[MeasurementSet, Diagnosis], after: tuple[MeasurementSet, Diagnosis]) -> dict:
    """Print what a compensation removed between two sets, and what is left; the same for JSON."""
    from flexviz.content import blocks
    from flexviz.content.comparing import compare_friction
    from flexviz.content.rendering import text
    from flexviz.content.wording import number, percent

    models = [diagnosis.model for _, diagnosis in (before, after)]
    assert models[0] is not None and models[1] is not None
    found = compare_friction(before[0], models[0], models[1])
    rows = [
        [one.joint, speed.text, number(speed.before, 3), number(speed.after, 3), percent(speed.removed)]
        for one in found
        for speed in one.speeds
    ]
    head = ("joint", "speed", "first [Nm]", "second [Nm]", "removed")
    left = after[1].document()
    said = [*(one.text for one in found), "What is left, by the diagnosis of the second set:"]
    terminal.show_blocks([blocks.table(head, rows, range(1, 5)), *map(blocks.Paragraph, said)])
    lines = (block for block in left.blocks() if not isinstance(block, blocks.TableBlock))
    terminal.print_lines(f"  {line}" for line in text(lines).splitlines())
    names = {"without": before[0].name, "compensated": after[0].name}
    return names | {"joints": [friction_entry(one) for one in found], "left": left.to_dict()}


def friction_entry(one: ComparedFriction) -> dict[str, Any]:
    """A joint's friction in JSON."""
    speeds = [asdict(speed) | {"removed": speed.removed} for speed in one.speeds]
    return asdict(one) | {"removed": one.removed, "speeds": speeds}
