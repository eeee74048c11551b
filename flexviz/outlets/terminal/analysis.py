"""`flexviz identify | diagnose | record | report`: analyses of a measurement set."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.base.errors import InputError
from flexviz.outlets.terminal import terminal
from flexviz.outlets.terminal.loading import loading
from flexviz.outlets.terminal.options import (
    IdentificationOptions,
    JsonOption,
    SetArgument,
    SourceArgument,
    exit_code,
    read_selected,
    run_identification,
)
from flexviz.outlets.terminal.terminal import Reporter, interruptible

if TYPE_CHECKING:
    from flexviz.data.measurements import MeasurementSet

log = logging.getLogger(__name__)

GuardOption = Annotated[
    bool | None,
    typer.Option(
        "--guard/--no-guard",
        help="Also check how results change with the observer bandwidth (default: only if the model does not "
        "reach the measurement noise).",
    ),
]

DecoysOption = Annotated[
    bool,
    typer.Option(
        "--decoys",
        help="Let candidates that cannot be right compete, such as another joint's friction, and tell how "
        "many of them are accepted.",
    ),
]


def identify(
    measurement_set: SetArgument, options: IdentificationOptions, json_file: JsonOption = None
) -> int:
    """Identify stiffness, motor inertia, friction and inertial parameters."""
    terminal.check_output_file(json_file, ".json")
    with Reporter(f"reading {measurement_set}") as report, interruptible() as should_stop:
        _, result = run_identification(measurement_set, options, report, should_stop)
    terminal.show(result.document())
    terminal.write_json(json_file, result.to_dict())
    return exit_code(result)


def diagnose(
    measurement_set: SetArgument,
    apply: bool = typer.Option(
        False, "--apply", help="Add the found effects one by one and refit after each."
    ),
    json_file: JsonOption = None,
    guard: GuardOption = None,
    free_curve: bool | None = typer.Option(
        None,
        "--free-curve/--no-free-curve",
        help='With --apply, after a last verdict of "unknown": also add a free curve of what no effect '
        "explains, which is not physics. By default only where the effects were estimated together with one.",
        show_default=False,
    ),
    decoys: DecoysOption = False,
) -> int:
    """Determine whether the model is complete, and if not, which effect is missing and where."""
    from flexviz.base.parallel import on_cores, usable_cores

    if free_curve and not apply:
        raise InputError("--free-curve adds a step to the model, expected --apply with it")
    terminal.check_output_file(json_file, ".json")
    cores = on_cores(usable_cores())
    with Reporter(f"reading {measurement_set}") as report, interruptible() as should_stop, cores:
        with loading():
            from flexviz.analysis.diagnosis import diagnose as search
            from flexviz.analysis.diagnosis import why_no_curve
            from flexviz.checks import plausibility_warnings
            from flexviz.data.measurements import read_set
        measurements = read_set(measurement_set)
        for text in plausibility_warnings(measurements, report, should_stop):
            log.warning("%s", text)
        result = search(
            measurements,
            apply=apply,
            guard=guard,
            free_curve=free_curve,
            decoys=decoys,
            progress=report,
            should_stop=should_stop,
        )
    if free_curve and (result.steps[-1].added is None or not result.steps[-1].added.stopgap):
        terminal.note(f"note: no free curve is added: {why_no_curve(result)}")
    terminal.show(result.document())
    terminal.write_json(json_file, result.to_dict(steps=apply) | hash_of(measurements))
    if result.verdict == "missing" and not apply and not result.stopped:
        terminal.note("to add the missing effects one by one and see how the error falls, use --apply")
    return 130 if result.stopped else 0


def hash_of(measurements: MeasurementSet) -> dict[str, str]:
    """What ties a result to its data."""
    from flexviz.data.measurements import fingerprint

    return {"set_sha256": fingerprint(measurements).sha256}


def record(
    measurement_set: SetArgument,
    out: Annotated[Path, typer.Option(metavar="FILE.rrd", help="File to write.")],
    options: IdentificationOptions,
    diagnose: bool = typer.Option(
        False, "--diagnose", help="Also find the missing effects, add them and record every step."
    ),
) -> int:
    """Identify, and record signals, observer states, residuals, iterations and both robots."""
    from flexviz.content.topics import TOPICS
    from flexviz.outlets.workflows import record as record_analysis

    terminal.check_output_file(out, ".rrd", named=True)
    with Reporter(f"reading {measurement_set}") as report, interruptible("the recording is kept") as stop:
        settings = options.settings()
        measurements = read_selected(measurement_set, settings, report, stop)
        done = record_analysis(measurements, out, settings, apply=diagnose, progress=report, should_stop=stop)
    written = done.recorded
    state = "" if written.complete else ", stopped before everything was recorded"
    size = f"{written.bytes / 1e6:.1f} MB, {written.chunks} chunks"
    if done.results:
        terminal.show_blocks(TOPICS["run"].blocks(done.results[-1].document()))
    terminal.print_lines([f"{written.file}: {size}{state}"])
    return exit_code(done.results[-1]) if written.complete else 130


def report(
    source: SourceArgument,
    out: Annotated[Path, typer.Option(metavar="FILE", help="File to write: .html, .md or .json.")],
    guard: GuardOption = None,
    keep: Path | None = typer.Option(
        None, "--session", metavar="DIR", help="Also save the results as a session to a new folder."
    ),
    animation: Path | None = typer.Option(
        None, metavar="FILE.html", help="Also write the measured and the identified robot in motion."
    ),
    require: Path | None = typer.Option(
        None, metavar="LIMITS.toml", help="Also say which of these limits the result keeps, as in verify."
    ),
) -> int:
    """Write a report on a set, after a full diagnosis, or on a saved session."""
    from flexviz.base.parallel import on_cores, usable_cores
    from flexviz.outlets.workflows import report_kind, write_report

    report_kind(out)
    terminal.check_output_file(out)
    terminal.check_output_file(animation, ".html", named=True)
    cores = on_cores(usable_cores())
    with Reporter(f"reading {source}") as progress, interruptible() as should_stop, cores:
        told = {"progress": progress, "should_stop": should_stop}
        done = write_report(source, out, guard=guard, keep=keep, animation=animation, require=require, **told)
    if done.changed:
        terminal.note(f"the data have changed since the session was saved: {', '.join(done.changed)}")
    files = [out] if animation is None else [out, animation]
    terminal.print_lines([f"{file}: {file.stat().st_size / 1e3:.0f} kB" for file in files])
    diagnosis = done.session.analysis.diagnosis
    return 130 if diagnosis is not None and diagnosis.stopped else 0
