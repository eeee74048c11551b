"""`flexviz session SESSION`: what a saved session contains."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.base.errors import InputError
from flexviz.outlets.terminal import terminal

if TYPE_CHECKING:
    from flexviz.content.session import OpenedSession


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
    from flexviz.content.view import error_text, shown_errors

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
