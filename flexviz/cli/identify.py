"""`flexviz identify SET`: parameters with their uncertainty from a measurement set."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from flexviz.errors import InputError, choose_from

if TYPE_CHECKING:
    from flexviz.identification import Identification, Iteration
    from flexviz.measurements import MeasurementSet


def identify(
    measurement_set: Path = typer.Argument(..., metavar="SET", help="Folder with measurements.toml."),
    group: list[str] = typer.Option(
        [], "--group", metavar="NAME", help="Fit this group only; repeat for more. [default: all for fitting]"
    ),
    effect: list[str] = typer.Option(
        [], "--effect", metavar="NAME[:joint]", help="Add an effect to the model; repeat for more."
    ),
    observer: str = typer.Option(
        "butterworth-zero-phase",
        "--observer",
        metavar="NAME",
        help="eso, eso-equal-delay, eso-zero-phase or butterworth-zero-phase.",
    ),
    bandwidth: str | None = typer.Option(
        None,
        "--bandwidth",
        metavar="W",
        help="Observer bandwidth in rad/s: one number, or one a joint: 40,60.",
    ),
    refine: bool = typer.Option(False, "--refine", help="Remove the observer's bias in a second stage."),
    json_file: Path | None = typer.Option(
        None, "--json", metavar="FILE", help="Also write the result as JSON."
    ),
) -> int:
    """Identify stiffness, motor inertia, friction and inertial parameters."""
    from flexviz.cli import output, tables
    from flexviz.cli.progress import Reporter, interruptible

    output.check_output_file(json_file)
    width = parse_bandwidth(bandwidth)

    with Reporter(f"reading {measurement_set}") as report:
        from flexviz.identification import identify as run
        from flexviz.measurements import read_set
        from flexviz.observers import make_observer

        make_observer(observer, width)  # a wrong name is better said before a long file is read
        measurements = read_set(measurement_set)
        _check_choices(measurements, group, width)
        with interruptible() as should_stop:
            result = run(
                measurements,
                groups=group or None,
                effects=effect,
                observer=observer,
                bandwidth=width,
                refine=refine,
                progress=lambda iteration: report(*describe(iteration)),
                should_stop=should_stop,
            )

    if json_file is not None:
        output.write_json(json_file, result.to_json())
    console = output.results()
    console.print(tables.parameter_table(result.parameters))
    console.print(tables.residual_table(result.residual))
    for line in tables.summary(result):
        console.print(line, soft_wrap=True)
    return exit_code(result)


def exit_code(result: Identification) -> int:
    """0 converged, 1 not, 130 stopped by the user."""
    if result.stopped:
        return 130
    return 0 if result.converged else 1


def describe(iteration: Iteration) -> tuple[str, str]:
    """Stage, and where it is, for the progress line."""
    step = "" if not math.isfinite(iteration.step) else f"  step {iteration.step:.2g}"
    return iteration.stage, f"iteration {iteration.number}  cost {iteration.cost:.6g}{step}"


def parse_bandwidth(text: str | None) -> float | list[float] | None:
    """One number or one a joint, comma separated [rad/s]; None where none was given."""
    if text is None:
        return None
    values = []
    for part in text.split(","):
        try:
            values.append(float(part))
        except ValueError:
            raise InputError(
                f'--bandwidth {text}: "{part}" is not a number; one in rad/s is needed, or one a joint: 40,60'
            ) from None
        if not (math.isfinite(values[-1]) and values[-1] > 0.0):
            raise InputError(f"--bandwidth {text}: {part} is not a positive number of rad/s")
    return values[0] if len(values) == 1 else values


def _check_choices(
    measurements: MeasurementSet, groups: list[str], bandwidth: float | list[float] | None
) -> None:
    where = measurements.name
    names = [g.name for g in measurements.groups]
    for name in groups:
        if name not in names:
            raise InputError(f"--group {name}: no such group in {where}; {choose_from(name, names)}")
        if any(g.name == name and g.validation for g in measurements.groups):
            raise InputError(f"--group {name}: is kept for validation in {where} and is never fitted")
    joints = measurements.joints
    if isinstance(bandwidth, list) and len(bandwidth) != len(joints):
        raise InputError(
            f"--bandwidth has {len(bandwidth)} numbers; {where} has {len(joints)} joints: {', '.join(joints)}"
        )
