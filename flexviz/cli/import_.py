"""`flexviz import`: from logs and a robot to a mapping file, and from that to a measurement set."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.errors import InputError
from flexviz.files import write_whole
from flexviz.statistics import NORMAL_95

if TYPE_CHECKING:
    from collections.abc import Callable

    from flexviz.cli.progress import Reporter
    from flexviz.importing import Imported, Mapping, Questions

INCOMPLETE = 1  # a mapping was written, but something in it must still be filled in
REFUSED = 2  # nothing was written because the data contradict the mapping


@dataclass(frozen=True)
class ImportRun:
    """Output options of an import, and how to report and stop it."""

    out: Path | None
    table_format: str
    yes: bool
    json_file: Path | None
    report: Reporter
    should_stop: Callable[[], bool]


def import_(
    source: Annotated[
        list[Path],
        typer.Argument(
            metavar="MAPPING|LOG...",
            help="A mapping file (*.toml), or logs: MCAP, ROS 2 bags, .bag, CSV, Parquet, .mat, LeRobot.",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder to write the set to; default: only check.")
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(metavar="URDF", help="With logs: a URDF, example-robot-data:NAME or robots:NAME."),
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="With logs: write the mapping drafted from them to this file."),
    ] = None,
    table_format: Annotated[
        str, typer.Option("--format", metavar="parquet|csv", help="Kind of the set's tables.")
    ] = "parquet",
    yes: Annotated[
        bool, typer.Option("--yes", help="Ask nothing, and write the set even if something looks wrong.")
    ] = False,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write the report as JSON.")
    ] = None,
) -> int:
    """Convert logs to a measurement set.

    First inspect them, which writes a mapping file to read and correct; then import it:

    flexviz import run1.mcap run2.mcap --robot arm.urdf --mapping arm.toml

    flexviz import arm.toml --out arm-set
    """
    from flexviz.cli import output
    from flexviz.cli.progress import Reporter, interruptible

    output.check_output_file(json_file, ".json")
    if out is not None:
        output.check_new_folder(out, table_format)
    asking = not yes and sys.stdin.isatty() and sys.stderr.isatty()  # before the live line takes stderr
    with Reporter("importing") as report, interruptible("nothing is written") as should_stop:
        run = ImportRun(out, table_format, yes, json_file, report, should_stop)
        if len(source) == 1 and source[0].suffix == ".toml":
            refuse_with_mapping(robot, mapping)
            from flexviz.importing import read_mapping

            return import_logs(read_mapping(source[0]), source[0], run)
        return from_logs(source, robot, mapping, person(report) if asking else None, run)


def refuse_with_mapping(robot: str | None, mapping: Path | None) -> None:
    """InputError for options that apply only to logs."""
    if robot is not None:
        raise InputError("--robot applies to logs, but the mapping file names the robot")
    if mapping is not None:
        raise InputError("--mapping applies to logs, but a mapping file was given")


def from_logs(
    logs: list[Path],
    robot: str | None,
    mapping: Path | None,
    questions: Questions | None,
    run: ImportRun,
) -> int:
    """Inspect logs; write the mapping if requested, and the set if nothing is missing."""
    from flexviz.cli import output
    from flexviz.importing import inspect_logs

    for path in logs:
        if path.suffix == ".toml":
            raise InputError(
                "a mapping file cannot be combined with logs, expected flexviz import MAPPING --out DIR",
                file=path,
            )
    if robot is None:
        raise InputError(
            "--robot is missing, expected with logs: a URDF, example-robot-data:NAME or robots:NAME"
        )
    check_new_file(mapping)
    inspection = inspect_logs(
        logs, robot, questions=questions, progress=run.report, should_stop=run.should_stop
    )
    text = inspection.draft.text(mapping)
    if mapping is not None:
        write_whole(mapping, text.encode())
    output.print_lines([*inspection.draft.seen, *(f"looks {s.severity}: {s}" for s in inspection.issues)])
    if inspection.draft.missing:
        if mapping is None:
            print(text, end="")
        where = f" in {mapping}" if mapping else "; --mapping FILE writes what is known to a file"
        output.print_lines([f"to be filled in{where}: {line}" for line in inspection.draft.missing])
        return INCOMPLETE
    if run.out is None:
        if mapping is None:
            print(text, end="")
        else:
            output.print_lines([f"{mapping}: read and correct it, then flexviz import {mapping} --out SET"])
        return 0
    return import_logs(inspection.draft.mapping(), Path("mapping"), run)


def import_logs(mapping: Mapping, file: Path, run: ImportRun) -> int:
    """Import the logs of a mapping and print the report."""
    from flexviz.cli import output
    from flexviz.importing import import_mapping

    done = import_mapping(
        mapping,
        file,
        run.out,
        run.table_format,
        run.yes,
        progress=run.report,
        should_stop=run.should_stop,
    )
    if run.json_file is not None:
        output.write_json(run.json_file, done.to_json())
    output.print_lines(summary(done, run.out))
    return REFUSED if done.wrong and not run.yes else 0


def person(report: Reporter) -> Questions:
    """The user at the terminal; the live line is hidden while they answer."""
    from flexviz.cli.progress import note
    from flexviz.importing import Person

    def ask(question: str, default: str) -> str:
        with report.paused():
            return str(typer.prompt(question, default=default, err=True, show_default=bool(default)))

    return Person(ask, note)


def check_new_file(file: Path | None) -> None:
    """Refuse an unusable mapping file before the work; an existing one may have been corrected."""
    from flexviz.cli import output

    output.check_output_file(file)
    if file is not None and file.exists():
        raise InputError("exists already, expected a new name", file=file)
    if file is not None and file.suffix != ".toml":
        raise InputError("not a name for a mapping, expected *.toml", file=file)


def summary(done: Imported, out: Path | None) -> list[str]:
    """Summary of an import, as lines of text."""
    import numpy as np

    lines = []
    for group in done.groups:
        step = float(np.median(np.diff(group.table.time)))
        use = "validation" if group.entry.validation else "fit"
        lines.append(
            f"{group.entry.group}: {group.entry.file}, {group.kind}, {len(group.table.time)} samples, "
            f"{group.table.time[-1]:.6g} s at {1 / step:.5g} Hz, payload {group.entry.payload}, {use}"
        )
        lines += [f"  {note}" for note in group.notes]
    for o in done.offsets:
        size = f"{1e3 * abs(o.delay):.3f} ± {1e3 * NORMAL_95 * o.std:.2g} ms"
        lines.append(
            f'{o.group}: clock of "{o.clock}" {size} {"behind" if o.delay > 0 else "ahead of"} that of theta'
        )
    if done.delay is not None:
        lines.append(
            f"torque acts {1e3 * done.delay.seconds:.3f} ± {1e3 * NORMAL_95 * done.delay.std:.2g} ms after "
            f"it is stamped; the flexible-joint model explains {100 * done.delay.share:.2f} % of it"
        )
    elif not done.wrong:
        lines.append("these data do not show whether torque and motion agree in time")
    lines += [f"looks {s.severity}: {s}" for s in done.issues]
    lines += [f"warning: {warning}" for warning in done.warnings]
    if done.folder is not None:
        lines.append(f"{done.folder}: {len(done.groups)} groups, joints {', '.join(done.joints)}")
    elif done.wrong:
        lines.append("nothing was written: correct the mapping, or use --yes to write it anyway")
    elif out is None:
        lines.append("only checked; --out DIR writes the set")
    return lines
