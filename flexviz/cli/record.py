"""`flexviz record SET --out FILE.rrd`: everything about one identification as a Rerun recording."""

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
    run_identification,
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
    effects_from: EffectsFromOption = None,
) -> int:
    """Identify, and record signals, observer states, residuals, iterations and both robots."""
    from flexviz.cli import output, tables
    from flexviz.cli.progress import Reporter, interruptible

    load_own(effects_from)
    output.check_output_file(out)
    wanted = Wanted(measurement_set, group or [], effect or [], observer, parse_bandwidth(bandwidth), refine)
    with (
        Reporter(f"reading {measurement_set}") as report,
        interruptible("the recording is kept") as should_stop,
    ):
        measurements, result = run_identification(wanted, report, should_stop)
        from flexviz.recording import record_set

        written = record_set(
            measurements,
            result,
            out,
            progress=lambda what, share: report(what, fraction=share),
            should_stop=should_stop,
        )
    console = output.results()
    for line in tables.summary(result):
        console.print(line, soft_wrap=True)
    console.print(f"{written.file}: {written.bytes / 1e6:.1f} MB, {written.chunks} chunks", soft_wrap=True)
    return exit_code(result) if written.complete else 130
