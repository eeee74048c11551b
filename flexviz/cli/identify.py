"""`flexviz identify SET`: parameters with their uncertainty from a measurement set."""

from __future__ import annotations

from flexviz.cli.options import (
    EffectsFromOption,
    IdentificationOptions,
    JsonOption,
    SetArgument,
    exit_code,
    load_effect_files,
    run_identification,
    with_identification_options,
)


@with_identification_options
def identify(
    measurement_set: SetArgument,
    options: IdentificationOptions,
    effects_from: EffectsFromOption = None,
    json_file: JsonOption = None,
) -> int:
    """Identify stiffness, motor inertia, friction and inertial parameters."""
    from flexviz.cli import output
    from flexviz.cli.progress import Reporter, interruptible

    load_effect_files(effects_from)
    output.check_output_file(json_file, ".json")
    with Reporter(f"reading {measurement_set}") as report, interruptible() as should_stop:
        result = run_identification(measurement_set, options, report, should_stop)[1]
    if json_file is not None:
        output.write_json(json_file, result.to_dict())
    output.show(result.document())
    return exit_code(result)
