"""`flexviz session SESSION`: show a saved session, add a note, relocate its data."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.cli.options import EffectsFromOption, load_effect_files

if TYPE_CHECKING:
    from flexviz.session import Analysis, OpenedSession


def session(
    path: Annotated[Path, typer.Argument(metavar="SESSION", help="Folder with session.json.")],
    note: Annotated[str | None, typer.Option(metavar="TEXT", help="Add this note.")] = None,
    measurement_set: Annotated[
        Path | None,
        typer.Option(
            "--set", metavar="DIR", help="New location of its measurement set, saved in the session."
        ),
    ] = None,
    effects_from: EffectsFromOption = None,
) -> int:
    """Show the content of a saved session, and whether its data have changed."""
    from dataclasses import replace

    from flexviz.cli import output
    from flexviz.errors import InputError
    from flexviz.session import is_session, open_session, relocate, save_session

    load_effect_files(effects_from)
    if not is_session(path):
        raise InputError("not a session, expected a folder with session.json", file=path)
    opened = open_session(path) if measurement_set is None else relocate(path, measurement_set)
    if note is not None:
        opened = replace(opened, session=opened.session.with_note(note))
    if note is not None or measurement_set is not None:
        save_session(opened.session, opened.measurements, opened.folder)
    output.print_lines(lines(opened))
    return 0


def identified(analysis: Analysis) -> str:
    """Error of the identification, or which result there is instead."""
    from flexviz.view import error_text

    if analysis.identification is not None:
        return error_text(analysis.identification)
    return "not identified" if analysis.diagnosis is None else "parameters from the diagnosis"


def lines(opened: OpenedSession) -> list[str]:
    """Set, steps, notes, recordings."""
    kept, analysis = opened.session, opened.session.analysis
    out = [
        f"session {opened.folder}" + (f", saved {opened.saved}" if opened.saved else ""),
        f"measurement set {opened.measurements.path}: "
        + (f"{', '.join(opened.changed)} changed since" if opened.changed else "unchanged"),
        f"fitted: {', '.join(analysis.groups_with('fit')) or 'none'}; "
        f"held out: {', '.join(analysis.groups_with('validate')) or 'none'}",
        f"effects added: {', '.join(analysis.effects) or 'none'}",
        identified(analysis),
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
