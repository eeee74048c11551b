"""`flexviz diagnose SET`: is the model complete, and if not, what is missing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flexviz.cli.identifying import SetArgument
from flexviz.cli.own import EffectsFromOption, load_own

GuardOption = Annotated[
    bool | None,
    typer.Option(
        "--guard/--no-guard",
        help="Also look at what moves with the observer's bandwidth (without either: only where the "
        "model does not reach the measurement noise).",
    ),
]


def diagnose(
    measurement_set: SetArgument,
    apply: Annotated[
        bool, typer.Option("--apply", help="Add the found effects one by one and refit after each.")
    ] = False,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write the result as JSON.")
    ] = None,
    guard: GuardOption = None,
    effects_from: EffectsFromOption = None,
) -> int:
    """Say whether the model is complete, and if not, which effect is missing and where."""
    from flexviz.cli import output
    from flexviz.cli.progress import Reporter, interruptible
    from flexviz.diagnosis import diagnose as search
    from flexviz.importing import with_plausibility_warnings
    from flexviz.measurements import read_set

    load_own(effects_from)
    output.check_output_file(json_file, ".json")
    with Reporter(f"reading {measurement_set}") as report, interruptible() as should_stop:
        measurements = with_plausibility_warnings(read_set(measurement_set))
        result = search(
            measurements,
            apply=apply,
            guarded=guard,
            progress=report,
            should_stop=should_stop,
        )
    if json_file is not None:
        output.write_json(json_file, result.to_dict(steps=apply))
    output.show(result.document())
    return 130 if result.stopped else 0
