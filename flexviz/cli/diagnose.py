"""`flexviz diagnose SET`: whether the model is complete, else the missing effects."""

from __future__ import annotations

from typing import Annotated

import typer

from flexviz.cli.options import EffectsFromOption, JsonOption, SetArgument, load_effect_files

GuardOption = Annotated[
    bool | None,
    typer.Option(
        "--guard/--no-guard",
        help="Also check how results change with the observer bandwidth (default: only if the model does not "
        "reach the measurement noise).",
    ),
]


def diagnose(
    measurement_set: SetArgument,
    apply: Annotated[
        bool, typer.Option("--apply", help="Add the found effects one by one and refit after each.")
    ] = False,
    json_file: JsonOption = None,
    guard: GuardOption = None,
    effects_from: EffectsFromOption = None,
) -> int:
    """Determine whether the model is complete, and if not, which effect is missing and where."""
    from flexviz.cli import output
    from flexviz.cli.progress import Reporter, interruptible
    from flexviz.diagnosis import diagnose as search
    from flexviz.importing import with_plausibility_warnings
    from flexviz.measurements import read_set

    load_effect_files(effects_from)
    output.check_output_file(json_file, ".json")
    with Reporter(f"reading {measurement_set}") as report, interruptible() as should_stop:
        measurements = with_plausibility_warnings(read_set(measurement_set))
        result = search(measurements, apply=apply, guarded=guard, progress=report, should_stop=should_stop)
    if json_file is not None:
        output.write_json(json_file, result.to_dict(steps=apply))
    output.show(result.document())
    return 130 if result.stopped else 0
