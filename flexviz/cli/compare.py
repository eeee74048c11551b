"""`flexviz compare SESSION SESSION …`: parameters, errors and effects side by side."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.cli.own import EffectsFromOption, load_own

if TYPE_CHECKING:
    from rich.table import Table

    from flexviz.session import ParameterRow, SessionComparison, SessionSummary

SURE = 3.0  # standard errors from which a difference is pointed at


def compare(
    sessions: Annotated[
        list[Path], typer.Argument(metavar="SESSION…", help="Two folders or more with session.json.")
    ],
    all_parameters: Annotated[
        bool, typer.Option("--all", help="Also the single inertial parameters, which are seldom determined.")
    ] = False,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write the comparison as JSON.")
    ] = None,
    effects_from: EffectsFromOption = None,
) -> int:
    """Compare what saved sessions ended with."""
    from flexviz.cli import output
    from flexviz.errors import InputError
    from flexviz.session import compare as put_side_by_side
    from flexviz.session import is_session, open_session

    load_own(effects_from)
    output.check_output_file(json_file, ".json")
    for path in sessions:
        if not is_session(path):
            raise InputError("is no session; a folder with session.json would be right", file=path)
    found = put_side_by_side([open_session(path) for path in sessions])
    if json_file is not None:
        output.write_json(json_file, found.to_json())
    console = output.results()
    for table in (facts(found), errors(found), parameters(found, all_parameters)):
        console.print(table)
    for line in notes(found):
        console.print(line, soft_wrap=True)
    return 0


def facts(found: SessionComparison) -> Table:
    """What each session is about, a column each."""
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
    """Where a session's parameters come from."""
    if one.source != "identification":
        return one.source or "–"
    return f"identification, {one.observer}" + (", refined" if one.refined else "")


def errors(found: SessionComparison) -> Table:
    """Held-out (else fitted) error of each joint, a column a session."""
    from flexviz.results import plain_table
    from flexviz.wording import number

    joints = list(dict.fromkeys(joint for s in found.sessions for joint in s.joints))
    table = plain_table("rms [Nm]", numbers=[s.name for s in found.sessions])
    for joint in joints:
        for what in ("rms_validation", "rms", "noise_floor"):
            cells = []
            for s in found.sessions:
                values = getattr(s, what)
                known = joint in s.joints and len(values) == len(s.joints)
                cells.append(number(values[s.joints.index(joint)], 3) if known else "–")
            label = {"rms_validation": "held out", "rms": "fitted", "noise_floor": "noise floor"}[what]
            table.add_row(f"{joint}, {label}", *cells)
    return table


def parameters(found: SessionComparison, every: bool) -> Table:
    """Each parameter with its 95 % interval, a column a session, and how far first and last are apart."""
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
    """The difference in standard errors; pointed at where it is large."""
    if not math.isfinite(row.deviations):
        return "–"
    return f"{row.deviations:.1f}" + (" !" if row.deviations >= SURE else "")


def notes(found: SessionComparison) -> list[str]:
    """What a reader must know."""
    out = []
    if not found.same_data:
        out.append("The sessions look at different data.")
    for s in found.sessions:
        if s.changed:
            out.append(
                f"{s.name}: {', '.join(s.changed)} changed since; its results belong to the older data."
            )
        if not s.source:
            out.append(f"{s.name}: has no result of its present settings.")
    if len({s.errors_from for s in found.sessions if s.errors_from}) > 1:
        out.append("The errors are of different bands and say nothing about one another.")
    if len({s.source for s in found.sessions if s.source}) > 1:
        out.append("The parameters come from different kinds of fit.")
    if any(row.deviations >= SURE for row in found.rows):
        out.append(
            f"!: first and last differ by {SURE:.0f} standard errors or more, counted as if they were "
            "independent; of the same data they are not, and less would already mean something."
        )
    return out
