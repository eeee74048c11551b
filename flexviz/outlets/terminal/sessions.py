"""`flexviz session SESSION` and `flexviz compare SESSION SESSION …`: show and compare saved sessions."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.base.errors import InputError
from flexviz.outlets.terminal import terminal
from flexviz.outlets.terminal.options import JsonOption

if TYPE_CHECKING:
    from rich.table import Table

    from flexviz.content.session import OpenedSession, ParameterRow, SessionComparison, SessionSummary

MARKED_DEVIATION = 3.0  # standard errors from which a difference is marked


def session(
    path: Annotated[Path, typer.Argument(metavar="SESSION", help="Folder with session.json.")],
    note: str | None = typer.Option(None, metavar="TEXT", help="Add this note."),
    measurement_set: Path | None = typer.Option(
        None, "--set", metavar="DIR", help="New location of its measurement set, saved in the session."
    ),
) -> int:
    """Show the content of a saved session, and whether its data have changed."""
    from flexviz.content.session import open_session, relocate, save_session

    check_session(path)
    opened = open_session(path) if measurement_set is None else relocate(path, measurement_set)
    if note is not None:
        opened = replace(opened, session=opened.session.with_note(note))
    if note is not None or measurement_set is not None:
        save_session(opened.session, opened.measurements, opened.folder)
        opened = open_session(path)  # with the time at which it was saved
    terminal.print_lines(lines(opened))
    return 0


def check_session(path: Path) -> None:
    """InputError unless `path` is a session's folder."""
    from flexviz.content.session import is_session

    if not is_session(path):
        raise InputError("not a session, expected a folder with session.json", file=path)


def lines(opened: OpenedSession) -> list[str]:
    """Set, steps, notes, recordings."""
    from flexviz.content.session import identified_errors
    from flexviz.outlets.view import error_text, shown_errors

    kept, analysis = opened.session, opened.session.analysis
    identified = "not identified" if analysis.diagnosis is None else "parameters from the diagnosis"
    if analysis.identification is not None:
        errors = shown_errors(analysis, identified_errors(opened.measurements, analysis))
        identified = error_text(analysis.identification, errors, not analysis.up_to_date)
    out = [
        f"session {opened.folder}" + (f", saved {opened.saved}" if opened.saved else ""),
        f"measurement set {opened.measurements.path}: "
        + (f"{', '.join(opened.changed)} changed since" if opened.changed else "unchanged"),
        f"fitted: {', '.join(analysis.groups_with('fit')) or 'none'}; "
        f"held out: {', '.join(analysis.groups_with('validate')) or 'none'}",
        f"effects added: {', '.join(analysis.effects) or 'none'}",
        identified,
    ]
    if analysis.diagnosis is not None:
        fresh = "" if analysis.diagnosis_up_to_date else " (for previous settings or data)"
        out.append(f"verdict: {analysis.diagnosis.verdict}{fresh}")
    out += [f"{number:3d}. {step.when}  {step.label}".rstrip() for number, step in enumerate(kept.steps, 1)]
    if kept.future:
        out.append(f"     {len(kept.future)} undone, can be redone")
    out += [f"note, {note.when}: {note.text}" for note in kept.notes]
    out += [f"recording {file}" + ("" if file.is_file() else " (missing)") for file in kept.recordings]
    return out


def compare(
    sessions: Annotated[
        list[Path],
        typer.Argument(
            metavar="SESSION…",
            help="Two or more folders with session.json; or a set without and one with compensation.",
        ),
    ],
    all_parameters: bool = typer.Option(
        False, "--all", help="Also show single inertial parameters, which are seldom identifiable."
    ),
    json_file: JsonOption = None,
) -> int:
    """Compare the final results of saved sessions, or the friction of two recordings of a robot.

    Of two measurement sets, the first without and the second with a compensation of friction, both are
    diagnosed: what was removed, per joint and speed, and what is left.
    """
    from flexviz.content.session import compare as compare_sessions
    from flexviz.content.session import is_session, open_session

    terminal.check_output_file(json_file, ".json")
    if len(sessions) == 2 and not any(map(is_session, sessions)):
        from flexviz.outlets.terminal.compensation import compare_sets

        without, compensated = sessions
        return compare_sets(without, compensated, json_file)
    for path in sessions:
        check_session(path)
    found = compare_sessions([open_session(path) for path in sessions])
    terminal.write_json(json_file, found.to_json())
    console = terminal.results()
    for table in (facts(found), errors(found), parameters(found, all_parameters)):
        console.print(table)
    terminal.print_lines(notes(found))
    return 0


def facts(found: SessionComparison) -> Table:
    """Set, effects and verdict, one column per session."""
    from flexviz.content.results import plain_table

    table = plain_table("")
    for s in found.sessions:
        table.add_column(s.name, overflow="fold")
    rows = {
        "measurement set": [s.set_name for s in found.sessions],
        "its SHA-256": [s.set_sha256[:12] for s in found.sessions],
        "effects": [", ".join(s.effects) or "none" for s in found.sessions],
        "verdict": [s.verdict or "not diagnosed" for s in found.sessions],
        "parameters from": [source(s) for s in found.sessions],
        "errors from": [s.errors_from or "–" for s in found.sessions],
    }
    for name, cells in rows.items():
        table.add_row(name, *cells)
    return table


def source(one: SessionSummary) -> str:
    """Source of the parameters of a session."""
    if one.source != "identification":
        return one.source or "–"
    return f"identification, {one.observer}" + (", refined" if one.refined else "")


def errors(found: SessionComparison) -> Table:
    """Fitted and held-out error of each joint, one column per session."""
    from flexviz.content.results import plain_table
    from flexviz.content.wording import JointErrors

    joints = list(dict.fromkeys(joint for s in found.sessions for joint in s.joints))
    table = plain_table("error, % of the torque", numbers=[s.name for s in found.sessions])
    labels = {"rms": "fitted", "rms_validation": "held out", "noise_floor": "noise"}
    for joint in joints:
        for key, label in labels.items():
            cells = []
            for s in found.sessions:
                values = getattr(s, key)
                known = joint in s.joints and len(values) == len(s.joints)
                errors = JointErrors(values, s.torque_spread, (), s.torque_units)
                told = errors.whole(s.joints.index(joint)) if known else "–"
                cells.append(told.replace(" of the torque", ""))
            table.add_row(f"{joint}, {label}", *cells)
    return table


def parameters(found: SessionComparison, every: bool) -> Table:
    """Parameters with 95 % intervals, one column per session, and the difference of first and last."""
    from flexviz.content.results import in_ascii, plain_table
    from flexviz.content.wording import INERTIAL, interval_words

    names = [s.name for s in found.sessions]
    table = plain_table("parameter", "joint", numbers=[*names, "difference / std"], end=["unit"])
    for row in found.rows:
        if row.name in INERTIAL and not every:
            continue
        cells = ["–" if e is None else interval_words(e) for e in row.estimates]
        table.add_row(row.name, row.place, *map(in_ascii, cells), far(row), row.unit)
    return table


def far(row: ParameterRow) -> str:
    """The difference in standard errors, marked with ! if large."""
    if not math.isfinite(row.deviations):
        return "–"
    return f"{row.deviations:.1f}" + (" !" if row.deviations >= MARKED_DEVIATION else "")


def notes(found: SessionComparison) -> list[str]:
    """Remarks on the comparison."""
    out = []
    if not found.same_data:
        out.append("The sessions use different data.")
    for s in found.sessions:
        if s.changed:
            out.append(
                f"{s.name}: {', '.join(s.changed)} changed since; its results belong to the previous data."
            )
        if not s.source:
            out.append(f"{s.name}: has no result for its current settings.")
    if len({s.errors_from for s in found.sessions if s.errors_from}) > 1:
        out.append("The errors are from different frequency bands and cannot be compared.")
    if len({s.source for s in found.sessions if s.source}) > 1:
        out.append("The parameters come from different kinds of fit.")
    if any(row.deviations >= MARKED_DEVIATION for row in found.rows):
        out.append(
            f"!: first and last differ by {MARKED_DEVIATION:.0f} standard errors or more, as if they were "
            "independent; for the same data even smaller differences are significant."
        )
    return out
