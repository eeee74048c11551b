"""`flexviz export SET|SESSION --out DIR`: what was found, in the formats that others read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.cli.identifying import (
    BandwidthOption,
    EffectOption,
    GroupOption,
    ObserverOption,
    RefineOption,
    Wanted,
    parse_bandwidth,
    run_identification,
)
from flexviz.cli.own import EffectsFromOption, load_own
from flexviz.errors import Cancelled, InputError

if TYPE_CHECKING:
    from flexviz.exporting import Exported, IdentifiedRobot

DEFAULT_OBSERVER = "butterworth-zero-phase"


def export(
    source: Annotated[
        Path, typer.Argument(metavar="SET|SESSION", help="Folder with measurements.toml, or a saved session.")
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="New or empty folder to write to.")],
    to: Annotated[
        list[str] | None,
        typer.Option(metavar="FORMAT", help="urdf, mjcf, yaml, json, c or python; repeat; all without it."),
    ] = None,
    result: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help='What "identify --json" or "diagnose --json" wrote for this set, or exported parameters.',
        ),
    ] = None,
    payload: Annotated[
        str | None, typer.Option(metavar="NAME", help="The robot carries this payload of the set.")
    ] = None,
    group: GroupOption = None,
    effect: EffectOption = None,
    observer: ObserverOption = DEFAULT_OBSERVER,
    bandwidth: BandwidthOption = None,
    refine: RefineOption = False,
    effects_from: EffectsFromOption = None,
) -> int:
    """Write the identified robot as URDF, MJCF, parameter files, and C and Python code for feed-forward.

    What is written is the result in FILE, or a session's present result. A set without FILE is identified
    first, as the further options say.
    """
    from flexviz.cli import output
    from flexviz.cli.progress import note
    from flexviz.exporting import check_folder, check_formats, write
    from flexviz.session import is_session

    load_own(effects_from)
    formats = check_formats(to or [])
    check_folder(out)
    asked = Wanted(source, group or [], effect or [], observer, parse_bandwidth(bandwidth), refine)
    plain = Wanted(source, [], [], DEFAULT_OBSERVER, None, False)
    if result is not None and asked != plain:
        raise InputError("--result: nothing is identified then; leave the options of an identification out")
    if is_session(source) and asked != plain:
        raise InputError(
            "a session's result is exported as it is; leave the options of an identification out, or give "
            "the measurement set",
            file=source,
        )
    identified = _from_file(source, result, payload) if result is not None else None
    identified = identified or _from_session(source, payload)
    identified = identified or _identified(asked, payload)
    for text in identified.remarks:
        note(f"note: {text}")
    console = output.results()
    for line in summary(write(identified, out, formats)):
        console.print(line, soft_wrap=True)
    return 0 if identified.document.converged else 1


def summary(done: Exported) -> list[str]:
    """What was written where and what it does not hold, in lines of text."""
    lines = [f"{done.folder}:"]
    for name, files in done.files.items():
        shown: Sequence[str] = [file.relative_to(done.folder).as_posix() for file in files]
        more = f" and {len(shown) - 3} more" if len(shown) > 3 else ""
        lines.append(f"  {name}: {', '.join(shown[:3])}{more}")
        lines += [f"    not contained: {text}" for text in done.left_out[name]]
    return lines


def _from_file(source: Path, file: Path, payload: str | None) -> IdentifiedRobot:
    from flexviz.cli.progress import note
    from flexviz.exporting import identified_robot
    from flexviz.results import read_result
    from flexviz.session import open_session

    document = read_result(file)
    measurements = open_session(source).measurements
    if document.set != measurements.name:
        note(f'note: {file} is a result of the set "{document.set}", used for {measurements.name}')
    return identified_robot(measurements, document, payload=payload, file=file)


def _from_session(source: Path, payload: str | None) -> IdentifiedRobot | None:
    """The session's present result; None where there is none."""
    from flexviz.exporting import identified_robot
    from flexviz.session import is_session, open_session

    if not is_session(source):
        return None
    opened = open_session(source)
    analysis = opened.session.analysis
    diagnosis = analysis.diagnosis
    found = analysis.identification or diagnosis
    if found is None:
        raise InputError(
            "the session has no result yet; run it there, or give the measurement set "
            f"{opened.measurements.path} to identify it now",
            file=source,
        )
    current = analysis.up_to_date if found is analysis.identification else analysis.diagnosis_up_to_date
    remarks = []
    if opened.changed:
        remarks.append(f"Changed since these values were found: {', '.join(opened.changed)}.")
    elif not current:
        remarks.append("The session's settings have been changed since these values were found.")
    fits = found is not diagnosis and analysis.diagnosis_up_to_date
    return identified_robot(
        opened.measurements,
        found,
        payload=payload,
        diagnosis=diagnosis if fits else None,
        file=source,
        remarks=remarks,
    )


def _identified(wanted: Wanted, payload: str | None) -> IdentifiedRobot:
    from flexviz.cli.progress import Reporter, interruptible
    from flexviz.exporting import check_payload, identified_robot
    from flexviz.measurements import read_set

    with (
        Reporter(f"reading {wanted.path}") as report,
        interruptible("nothing is written") as should_stop,
    ):
        if payload is not None:  # better said before the work
            check_payload(read_set(wanted.path), payload)
        measurements, found = run_identification(wanted, report, should_stop)
        if found.stopped:
            raise Cancelled("stopped by the user; nothing was written")
    return identified_robot(measurements, found, payload=payload)
