"""`flexviz compare SESSION SESSION …`: parameters, errors and effects side by side."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.cli.options import EffectsFromOption, load_effect_files

if TYPE_CHECKING:
    from rich.table import Table

    from flexviz.session import ParameterRow, SessionComparison, SessionSummary

MARKED_DEVIATION = 3.0  # standard errors from which a difference is marked


def compare(
    sessions: Annotated[
        list[Path], typer.Argument(metavar="SESSION…", help="Two or more folders with session.json.")
    ],
    all_parameters: Annotated[
        bool,
        typer.Option("--all", help="Also show single inertial parameters, which are seldom identifiable."),
    ] = False,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write the comparison as JSON.")
    ] = None,
    effects_from: EffectsFromOption = None,
) -> int:
    """Compare the final results of saved sessions."""
    from flexviz.cli import output
    from flexviz.errors import InputError
    from flexviz.session import compare as compare_sessions
    from flexviz.session import is_session, open_session

    load_effect_files(effects_from)
    output.check_output_file(json_file, ".json")
    for path in sessions:
        if not is_session(path):
            raise InputError("not a session, expected a folder with session.json", file=path)
    found = compare_sessions([open_session(path) for path in sessions])
    if json_file is not None:
        output.write_json(json_file, found.to_json())
    console = output.results()
    for table in (facts(found), errors(found), parameters(found, all_parameters)):
        console.print(table)
    output.print_lines(notes(found))
    return 0


def facts(found: SessionComparison) -> Table:
    """Set, effects and verdict, one column per session."""
    from flexviz.results import plain_table

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
    """Held-out and fitted error of each joint, one column per session."""
    from flexviz.results import plain_table
    from flexviz.wording import number

    joints = list(dict.fromkeys(joint for s in found.sessions for joint in s.joints))
    table = plain_table("rms [Nm]", numbers=[s.name for s in found.sessions])
    labels = {"rms_validation": "held out", "rms": "fitted", "noise_floor": "noise floor"}
    for joint in joints:
        for key, label in labels.items():
            cells = []
            for s in found.sessions:
                values = getattr(s, key)
                known = joint in s.joints and len(values) == len(s.joints)
                cells.append(number(values[s.joints.index(joint)], 3) if known else "–")
            table.add_row(f"{joint}, {label}", *cells)
    return table


def parameters(found: SessionComparison, every: bool) -> Table:
    """Parameters with 95 % intervals, one column per session, and the difference of first and last."""
    from flexviz.results import interval, plain_table
    from flexviz.wording import INERTIAL

    names = [s.name for s in found.sessions]
    table = plain_table("parameter", "joint", numbers=[*names, "difference / std"], end=["unit"])
    for row in found.rows:
        if row.name in INERTIAL and not every:
            continue
        cells = ["–" if e is None else " ± ".join(interval(e.value, e.std)) for e in row.estimates]
        table.add_row(row.name, row.place, *cells, far(row), row.unit)
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
