"""`flexviz record SET --out FILE.rrd`: everything about one analysis as a Rerun recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flexviz.cli.options import (
    EffectsFromOption,
    IdentificationOptions,
    SetArgument,
    exit_code,
    load_effect_files,
    read_selected,
    with_identification_options,
)


@with_identification_options
def record(
    measurement_set: SetArgument,
    out: Annotated[Path, typer.Option(metavar="FILE.rrd", help="File to write.")],
    options: IdentificationOptions,
    diagnose: Annotated[
        bool,
        typer.Option("--diagnose", help="Also find the missing effects, add them and record every step."),
    ] = False,
    effects_from: EffectsFromOption = None,
) -> int:
    """Identify, and record signals, observer states, residuals, iterations and both robots."""
    from flexviz.cli import output
    from flexviz.cli.progress import Reporter, interruptible
    from flexviz.results import run_lines
    from flexviz.workflows import record as record_analysis

    load_effect_files(effects_from)
    output.check_output_file(out, ".rrd")
    with Reporter(f"reading {measurement_set}") as report, interruptible("the recording is kept") as stop:
        measurements = read_selected(measurement_set, options)
        done = record_analysis(
            measurements,
            out,
            add_missing=diagnose,
            progress=report,
            should_stop=stop,
            **options.arguments(),
        )
    written = done.recorded
    state = "" if written.complete else ", stopped before everything was recorded"
    size = f"{written.bytes / 1e6:.1f} MB, {written.chunks} chunks"
    lines = run_lines(done.results[-1].document()) if done.results else []
    output.print_lines([*lines, f"{written.file}: {size}{state}"])
    return exit_code(done.results[-1]) if written.complete else 130
