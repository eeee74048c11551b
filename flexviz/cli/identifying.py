"""What `identify` and `record` share: the options of an identification, and running it with progress."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flexviz.errors import InputError, choose_from

if TYPE_CHECKING:
    from flexviz.cli.progress import Reporter
    from flexviz.identification import Identification
    from flexviz.measurements import MeasurementSet

SetArgument = Annotated[Path, typer.Argument(metavar="SET", help="Folder with measurements.toml.")]
GroupOption = Annotated[
    list[str] | None,
    typer.Option("--group", metavar="NAME", help="Fit this group only; repeat for more."),
]
EffectOption = Annotated[
    list[str] | None,
    typer.Option(
        "--effect",
        metavar="NAME[:place]",
        help="Add an effect to the model, everywhere or at NAME:joint, NAME:payload or NAME:joint@group; "
        "repeat for more.",
    ),
]
ObserverOption = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="eso, eso-equal-delay, eso-zero-phase, flat-zero-phase or butterworth-zero-phase.",
    ),
]
BandwidthOption = Annotated[
    str | None,
    typer.Option(metavar="W", help="Observer bandwidth in rad/s: one number, or one a joint: 40,60."),
]
RefineOption = Annotated[bool, typer.Option("--refine", help="Remove the observer's bias in a second stage.")]


@dataclass(frozen=True)
class Wanted:
    """An identification as the command line asks for it."""

    path: Path
    groups: list[str]
    effects: list[str]
    observer: str
    bandwidth: float | list[float] | None
    refine: bool


def run_identification(
    wanted: Wanted, report: Reporter, should_stop: Callable[[], bool]
) -> tuple[MeasurementSet, Identification]:
    """Read the set, check what was asked for against it, identify."""
    measurements = read_wanted(wanted)
    return measurements, identify_wanted(measurements, wanted, report, should_stop)


def read_wanted(wanted: Wanted) -> MeasurementSet:
    """Read the set and check what was asked for against it."""
    from flexviz.importing import with_plausibility_warnings
    from flexviz.measurements import read_set
    from flexviz.observers import make_observer

    make_observer(wanted.observer, wanted.bandwidth)  # a wrong name is better said before a long file is read
    measurements = read_set(wanted.path)
    check_choices(measurements, wanted)
    return with_plausibility_warnings(measurements)


def identify_wanted(
    measurements: MeasurementSet,
    wanted: Wanted,
    report: Reporter,
    should_stop: Callable[[], bool],
) -> Identification:
    """Identify as it was asked for."""
    from flexviz.identification import identify

    return identify(
        measurements,
        groups=wanted.groups or None,
        effects=wanted.effects,
        observer=wanted.observer,
        bandwidth=wanted.bandwidth,
        refine=wanted.refine,
        progress=report,
        should_stop=should_stop,
    )


def check_choices(measurements: MeasurementSet, wanted: Wanted) -> None:
    """Groups and bandwidths that the set does not have."""
    where = measurements.name
    groups = {g.name: g for g in measurements.groups}
    for name in wanted.groups:
        if name not in groups:
            raise InputError(f"--group {name}: no such group in {where}; {choose_from(name, groups)}")
        if groups[name].validation:
            raise InputError(f"--group {name}: is kept for validation in {where} and is never fitted")
    joints, bandwidth = measurements.joints, wanted.bandwidth
    if isinstance(bandwidth, list) and len(bandwidth) != len(joints):
        raise InputError(
            f"--bandwidth has {len(bandwidth)} numbers; {where} has {len(joints)} joints: {', '.join(joints)}"
        )


def exit_code(result: Identification) -> int:
    """0 converged, 1 not, 130 stopped by the user."""
    if result.stopped:
        return 130
    return 0 if result.converged else 1


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
