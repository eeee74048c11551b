"""`flexviz export SET|SESSION --out DIR`: the identified robot in formats of other programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.base.errors import Cancelled, InputError
from flexviz.outlets.terminal import terminal
from flexviz.outlets.terminal.options import IdentificationOptions, SourceArgument, run_identification

if TYPE_CHECKING:
    from flexviz.outlets.exporting import Exported, IdentifiedRobot


def export(
    source: SourceArgument,
    out: Annotated[Path, typer.Option(metavar="DIR", help="New or empty folder to write to.")],
    options: IdentificationOptions,
    to: list[str] | None = typer.Option(
        None,
        metavar="FORMAT",
        help="urdf, mjcf, yaml, json, c, python, table; of joints that follow goals urdf, mjcf, isaac, bam, "
        "yaml, json; repeat for more; default: all.",
    ),
    result: Path | None = typer.Option(
        None,
        metavar="FILE",
        help='File from "identify --json" or "diagnose --json" for this set, or exported parameters.',
    ),
    payload: str | None = typer.Option(
        None, metavar="NAME", help="The robot carries this payload of the set."
    ),
) -> int:
    """Write the identified robot as URDF, MJCF, parameter files, and code and tables for feed-forward.

    Writes the result in FILE, or the current result of a session. A set without FILE is identified first,
    using the identification options.
    """
    from flexviz.content.session import is_session
    from flexviz.outlets.exporting import check_folder, check_formats, write

    formats = check_formats(to or [])
    check_folder(out)
    if options != IdentificationOptions():
        if result is not None:
            raise InputError("--result: no identification is run, expected no identification options")
        if is_session(source):
            message = "the saved result is exported, expected no identification options, or a measurement set"
            raise InputError(message, file=source)
    if result is not None:
        identified = _from_file(source, result, payload)
    elif is_session(source):
        identified = _from_session(source, payload)
    else:
        identified = _identified(source, options, payload)
    for text in identified.remarks:
        terminal.note(f"note: {text}")
    terminal.print_lines(summary(write(identified, out, formats)))
    return 0 if identified.document.converged else 1


def summary(done: Exported) -> list[str]:
    """The written files and what they do not contain, as lines of text."""
    lines = [f"{done.folder}:"]
    for name, files in done.files.items():
        shown: Sequence[str] = [file.relative_to(done.folder).as_posix() for file in files]
        more = f" and {len(shown) - 3} more" if len(shown) > 3 else ""
        lines.append(f"  {name}: {', '.join(shown[:3])}{more}")
        lines += [f"    not contained: {text}" for text in done.left_out[name]]
    return lines


def _from_file(source: Path, file: Path, payload: str | None) -> IdentifiedRobot:
    from flexviz.content.results import read_result
    from flexviz.content.session import open_session
    from flexviz.outlets.exporting import identified_robot

    document = read_result(file)
    measurements = open_session(source).measurements
    if document.set != measurements.name:
        terminal.note(f'note: {file} is a result of the set "{document.set}", used for {measurements.name}')
    return identified_robot(measurements, document, payload=payload, file=file)


def _from_session(source: Path, payload: str | None) -> IdentifiedRobot:
    """The current result of a session."""
    from flexviz.content.session import open_session
    from flexviz.outlets.exporting import session_robot

    opened = open_session(source)
    return session_robot(
        opened.measurements, opened.session.analysis, changed=opened.changed, payload=payload, file=source
    )


def _identified(path: Path, options: IdentificationOptions, payload: str | None) -> IdentifiedRobot:
    from flexviz.data.measurements import read_set
    from flexviz.outlets.exporting import check_payload, identified_robot

    with (
        terminal.Reporter(f"reading {path}") as report,
        terminal.interruptible("nothing is written") as should_stop,
    ):
        if payload is not None:  # refuse before the work
            check_payload(read_set(path), payload)
        measurements, found = run_identification(path, options, report, should_stop)
        if found.stopped:
            raise Cancelled("stopped by the user; nothing was written")
    return identified_robot(measurements, found, payload=payload)
