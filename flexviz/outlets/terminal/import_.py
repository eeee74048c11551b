"""`flexviz import`: from logs and a robot to a mapping file, and from that to a measurement set."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flexviz.base.errors import InputError
from flexviz.base.files import write_file
from flexviz.outlets.terminal import terminal
from flexviz.outlets.terminal.options import FormatOption, GravityOption, JsonOption, stated_gravity

if TYPE_CHECKING:
    from flexviz.data.importing import Imported, Inspection, Mapping, Person

INCOMPLETE = 1  # a mapping was written, but something in it must still be filled in
REFUSED = 2  # nothing was written because the data contradict the mapping
UNEVEN = 0.005  # of a usual rate, from which the mean rate is told, too


def import_(
    source: Annotated[
        list[Path],
        typer.Argument(
            metavar="MAPPING|LOG...",
            help="A mapping (*.toml), or logs: MCAP, ROS bags, CSV, xlsx, Parquet, mat, npz, JSON, LeRobot.",
        ),
    ],
    out: Path | None = typer.Option(
        None, metavar="DIR", help="Folder to write the set to; default: only check."
    ),
    robot: str | None = typer.Option(
        None, metavar="URDF", help="With logs: a URDF, example-robot-data:NAME or robots:NAME."
    ),
    mapping: Path | None = typer.Option(
        None, metavar="FILE", help="With logs: write the mapping drafted from them to this file."
    ),
    gravity: GravityOption = None,
    table_format: FormatOption = "parquet",
    yes: bool = typer.Option(
        False, "--yes", help="Ask nothing, and write the set even if something looks wrong."
    ),
    mend: bool = typer.Option(False, "--mend", help="Set the keys that are proposed."),
    json_file: JsonOption = None,
) -> int:
    """Convert logs to a measurement set.

    First inspect them, which writes a mapping file to read and correct; then import it:

    flexviz import run1.mcap run2.mcap --robot arm.urdf --mapping arm.toml

    flexviz import arm.toml --out arm-set
    """
    from flexviz.data.importing import import_logs, inspect_logs, read_mapping

    terminal.check_output_file(json_file, ".json")
    if out is not None:
        terminal.check_new_folder(out, table_format)
    check_source(source, robot, mapping)
    asking = not yes and sys.stdin.isatty() and sys.stderr.isatty()  # before the live line takes stderr
    with terminal.Reporter("importing") as report, terminal.interruptible("nothing is written") as stop:
        run: dict[str, Any] = {"progress": report, "should_stop": stop}
        if robot is None:
            file, content = source[0], under(read_mapping(source[0]), stated_gravity(gravity))
        else:
            asked = person(report) if asking else None
            found = inspect_logs(source, robot, gravity=stated_gravity(gravity), questions=asked, **run)
            show_draft(found, mapping, checked_only=out is None)
            if found.draft.missing or out is None:
                return INCOMPLETE if found.draft.missing else 0
            file, content = Path("mapping"), found.draft.mapping()
        done = import_logs(
            file, out, mapping=content, table_format=table_format, accept=yes, mend=mend, **run
        )
    if json_file is not None:
        terminal.write_json(json_file, done.to_json())
    terminal.print_lines(summary(done, out))
    return REFUSED if done.wrong and not yes else 0


def under(mapping: Mapping, gravity: tuple[float, float, float] | None) -> Mapping:
    """The mapping with this gravity [m/s²] instead of what it states; None: as it is."""
    return mapping if gravity is None else mapping.model_copy(update={"gravity": list(gravity)})


def check_source(source: list[Path], robot: str | None, mapping: Path | None) -> None:
    """InputError unless there is a mapping alone, or there are logs with their robot."""
    if len(source) == 1 and source[0].suffix == ".toml":
        if robot is not None:
            raise InputError("--robot applies to logs, but the mapping file names the robot")
        if mapping is not None:
            raise InputError("--mapping applies to logs, but a mapping file was given")
        return
    for path in source:
        if path.suffix == ".toml":
            raise InputError(
                "a mapping file cannot be combined with logs, expected flexviz import MAPPING --out DIR",
                file=path,
            )
    if robot is None:
        raise InputError(
            "--robot is missing, expected with logs: a URDF, example-robot-data:NAME or robots:NAME"
        )
    terminal.check_output_file(mapping, ".toml", new=True)


def show_draft(inspection: Inspection, file: Path | None, checked_only: bool) -> None:
    """Write the drafted mapping if requested; print what was seen, and the mapping where it is the result."""
    draft, text = inspection.draft, inspection.draft.text(file)
    if file is not None:
        write_file(file, text)
    from flexviz.content.wording import issue_text

    terminal.print_lines([*draft.seen, *(f"looks {s.severity}: {issue_text(s)}" for s in inspection.issues)])
    if file is None and (draft.missing or checked_only):
        print(text, end="")
    where = f" in {file}" if file else "; --mapping FILE writes what is known to a file"
    terminal.print_lines([f"to be filled in{where}: {line}" for line in draft.missing])
    if file is not None and checked_only and not draft.missing:
        terminal.print_lines([f"{file} written: check it, then run flexviz import {file} --out SET"])


def person(report: terminal.Reporter) -> Person:
    """The user at the terminal; the live line is hidden while they answer."""
    from flexviz.data.importing import Person

    def ask(question: str, default: str) -> str:
        with report.paused():
            return str(typer.prompt(question, default=default, err=True, show_default=bool(default)))

    return Person(ask, terminal.note)


def summary(done: Imported, out: Path | None) -> list[str]:
    """Summary of an import, as lines of text."""
    import numpy as np

    from flexviz.content.wording import issue_text
    from flexviz.data.measurements import bridge, pieces

    lines = []
    for group in done.groups:
        time, use = group.table.time, "validation" if group.entry.validation else "fit"
        use = "static test" if group.entry.kind == "holds" else use
        usual, mean = 1 / float(np.median(np.diff(time))), (len(time) - 1) / float(time[-1] - time[0])
        rate = f"{usual:.5g} Hz"
        if abs(mean - usual) > UNEVEN * usual:
            rate += f" ({mean:.5g} Hz on average)"
        bridged = bridge(time, np.hstack([group.table.theta, group.table.tau]))
        if (count := len(pieces(bridged.time))) > 1:
            rate += f" in {count} stretches between gaps"
        lines.append(
            f"{group.entry.group}: {group.entry.label}, {group.kind}, {len(time)} samples, "
            f"{time[-1]:.6g} s at {rate}, payload {group.entry.payload}, {use}"
        )
        lines += [f"  {note}" for note in group.notes]
    lines += [f"set as proposed: {text}" for text in done.mended]
    lines += [f'{o.group}: clock of "{o.clock}" {o.text}' for o in done.offsets]
    if done.delay is not None:
        joint, least = done.delay.worst
        lines.append(
            f"{done.delay.text}; the flexible-joint model explains "
            f"{100 * done.delay.share:.2f} % of all torques and {100 * max(least, 0.0):.2f} % of that "
            f"of {joint}"
        )
    elif not done.wrong and any(("tau" in {name for _, name in group.traces}) for group in done.groups):
        lines.append("these data do not show whether torque and motion agree in time")
    lines += [f"looks {s.severity}: {issue_text(s)}" for s in done.issues]
    lines += [f"warning: {warning}" for warning in done.warnings]
    if done.folder is not None:
        lines.append(f"{done.folder}: {len(done.groups)} groups, joints {', '.join(done.joints)}")
    elif done.wrong:
        lines.append("nothing was written: correct the mapping, or use --yes to write it anyway")
    elif out is None:
        lines.append("only checked; --out DIR writes the set")
    return lines
