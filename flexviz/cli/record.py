"""`flexviz record SET --out FILE.rrd`: everything about one analysis as a Rerun recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flexviz.cli.identifying import (
    BandwidthOption,
    EffectOption,
    GroupOption,
    ObserverOption,
    RefineOption,
    SetArgument,
    Wanted,
    exit_code,
    parse_bandwidth,
    read_wanted,
)
from flexviz.cli.own import EffectsFromOption, load_own


def record(
    measurement_set: SetArgument,
    out: Annotated[Path, typer.Option(metavar="FILE.rrd", help="File to write.")],
    group: GroupOption = None,
    effect: EffectOption = None,
    observer: ObserverOption = "butterworth-zero-phase",
    bandwidth: BandwidthOption = None,
    refine: RefineOption = False,
    diagnose: Annotated[
        bool,
        typer.Option(
            "--diagnose",
            help="Also look for what is missing, add it effect by effect, and record every step.",
        ),
    ] = False,
    effects_from: EffectsFromOption = None,
) -> int:
    """Identify, and record signals, observer states, residuals, iterations and both robots as it goes on."""
    from flexviz.cli import output
    from flexviz.cli.progress import Reporter, interruptible
    from flexviz.results import run_lines
    from flexviz.workflows import record as record_analysis

    load_own(effects_from)
    output.check_output_file(out, ".rrd")
    wanted = Wanted(measurement_set, group or [], effect or [], observer, parse_bandwidth(bandwidth), refine)
    with Reporter(f"reading {measurement_set}") as report, interruptible("the recording is kept") as stop:
        done = record_analysis(
            read_wanted(wanted),
            out,
            groups=wanted.groups or None,
            effects=wanted.effects,
            observer=wanted.observer,
            bandwidth=wanted.bandwidth,
            refine=wanted.refine,
            add_missing=diagnose,
            progress=report,
            should_stop=stop,
        )
    console, written = output.results(), done.recorded
    if done.results:
        for line in run_lines(done.results[-1].document()):
            console.print(line, soft_wrap=True)
    state = "" if written.complete else ", stopped before everything was recorded"
    size = f"{written.bytes / 1e6:.1f} MB, {written.chunks} chunks"
    console.print(f"{written.file}: {size}{state}", soft_wrap=True)
    return exit_code(done.results[-1]) if written.complete else 130
