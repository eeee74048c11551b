"""`flexviz identify SET`: parameters with their uncertainty from a measurement set."""

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


def identify(
    measurement_set: SetArgument,
    group: GroupOption = None,
    effect: EffectOption = None,
    observer: ObserverOption = "butterworth-zero-phase",
    bandwidth: BandwidthOption = None,
    refine: RefineOption = False,
    effects_from: EffectsFromOption = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write the result as JSON.")
    ] = None,
) -> int:
    """Identify stiffness, motor inertia, friction and inertial parameters."""
    from flexviz.cli import output
    from flexviz.cli.progress import Reporter, interruptible

    load_own(effects_from)
    output.check_output_file(json_file, ".json")
    wanted = Wanted(measurement_set, group or [], effect or [], observer, parse_bandwidth(bandwidth), refine)
    with Reporter(f"reading {measurement_set}") as report, interruptible() as should_stop:
        result = run_identification(wanted, report, should_stop)[1]
    if json_file is not None:
        output.write_json(json_file, result.to_dict())
    output.show(result.document())
    return exit_code(result)
