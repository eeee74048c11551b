"""Options that several commands share, and running an identification as they ask for."""

from __future__ import annotations

import functools
import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from flexviz.base.errors import InputError, choose_from
from flexviz.outlets.terminal.loading import loading

if TYPE_CHECKING:
    from flexviz.analysis.identification import FitSettings, Identification
    from flexviz.data.measurements import MeasurementSet
    from flexviz.model.observers import EsoGains
    from flexviz.outlets.terminal.terminal import Reporter

SetArgument = Annotated[Path, typer.Argument(metavar="SET", help="Folder with measurements.toml.")]
SourceArgument = Annotated[
    Path, typer.Argument(metavar="SET|SESSION", help="Folder with measurements.toml or session.json.")
]
JsonOption = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Also write the result as JSON.")
]
FormatOption = Annotated[
    str, typer.Option("--format", metavar="parquet|csv", help="Kind of the set's tables.")
]
BrowserOption = Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")]
GravityOption = Annotated[
    tuple[float, float, float] | None,
    typer.Option(
        "--gravity",
        metavar="X Y Z",
        help="Gravity [m/s²] in the base's frame, of a robot on a wall or under a ceiling. "
        "Default: as stated, else 0 0 -9.81.",
    ),
]
EffectsFromOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--effects-from",
        metavar="FILE",
        help="Python file with user-defined effects; it is run as a program: give only files you trust. "
        "Repeat for more.",
    ),
]


def stated_gravity(given: tuple[float, float, float] | None) -> tuple[float, float, float] | None:
    """The value of `--gravity`; InputError where it is impossible."""
    from flexviz.robot.mounting import checked_gravity

    return None if given is None else checked_gravity(given, "--gravity")


@dataclass(frozen=True)
class IdentificationOptions:
    """The options of an identification."""

    group: Annotated[
        list[str] | None,
        typer.Option("--group", metavar="NAME", help="Fit this group only; repeat for more."),
    ] = None
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            metavar="NAME[:place]",
            help="Add an effect to the model, everywhere or at NAME:joint, NAME:payload or NAME:joint@group; "
            "repeat for more. free_curve_position, _direction, _velocity, _load and _time are not physics.",
        ),
    ] = None
    observer: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="eso, eso-equal-delay, eso-zero-phase, flat-zero-phase or butterworth-zero-phase.",
        ),
    ] = "butterworth-zero-phase"
    bandwidth: Annotated[
        str | None,
        typer.Option(metavar="W", help="Observer bandwidth in rad/s: one number, or one per joint: 40,60."),
    ] = None
    gains: Annotated[
        str | None,
        typer.Option(
            metavar="B1,…,B6",
            help="Gains of the observer eso instead of those of (s+W)^6: six numbers, or twelve: those of "
            "the angle, then those of the torque.",
        ),
    ] = None
    refine: Annotated[
        bool,
        typer.Option(
            "--refine/--quick",
            help="Remove the observer's bias in a second stage, or leave it in values and intervals.",
        ),
    ] = True

    def settings(self) -> FitSettings:
        """The same as one record."""
        from flexviz.analysis.identification import FitSettings

        return FitSettings(
            groups=None if self.group is None else tuple(self.group),
            effects=tuple(self.effect or ()),
            observer=self.observer,
            bandwidth=parse_bandwidth(self.bandwidth),
            gains=parse_gains(self.gains),
            refine=self.refine,
        )


@dataclass(frozen=True)
class WorkOptions:
    """Where many tasks run, and what is done again."""

    workers: Annotated[int, typer.Option(metavar="N", min=1, help="Local processes.")] = 2
    scheduler: Annotated[
        str,
        typer.Option(
            metavar="tcp://HOST:PORT",
            help="Scheduler of a running dask cluster, instead of local processes. Its network must be "
            "trusted; tls:// with certificates otherwise.",
        ),
    ] = ""
    patience: Annotated[
        float, typer.Option(metavar="S", min=0.0, help="How long to wait for a lost scheduler, in s.")
    ] = 60.0
    retry: Annotated[bool, typer.Option("--retry", help="Also retry what failed in an earlier run.")] = False


def with_shared_options(command: Callable[..., int], own_effects: bool = True) -> Callable[..., int]:
    """The command with the fields of `IdentificationOptions` or `WorkOptions` in place of such a parameter.

    It also gets `--effects-from` unless its work is done by other processes, without `own_effects`.
    """
    signature = inspect.signature(command, eval_str=True)
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    parameters: list[inspect.Parameter] = []
    shared: dict[str, Any] = {}
    for parameter in signature.parameters.values():
        if not is_dataclass(options := parameter.annotation):
            parameters.append(parameter)
            continue
        shared[parameter.name], hints = options, get_type_hints(options, include_extras=True)
        for field in fields(options):
            parameters.append(
                inspect.Parameter(field.name, kind, default=field.default, annotation=hints[field.name])
            )
    if own_effects:
        parameters.append(inspect.Parameter("effects_from", kind, default=None, annotation=EffectsFromOption))

    @functools.wraps(command)
    def run(*, effects_from: list[Path] | None = None, **values: Any) -> int:
        if effects_from:
            from flexviz.model.effects import load_effects

            for file in effects_from:
                load_effects(file)
        for name, options in shared.items():
            given = {field.name: values.pop(field.name) for field in fields(options)}
            values[name] = options(**{key: value for key, value in given.items() if value != []})
        return command(**values)

    run.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


def read_selected(
    path: Path, settings: FitSettings, report: Reporter, should_stop: Callable[[], bool]
) -> MeasurementSet:
    """Read a measurement set and check the settings against it."""
    from flexviz.base.schemas import shown
    from flexviz.checks import with_plausibility_warnings
    from flexviz.data.measurements import read_set
    from flexviz.model.effects import choose_effects

    bandwidth = settings.bandwidth
    measurements = read_set(path)
    where, joints = measurements.name, measurements.joints
    groups = {g.name: g for g in measurements.groups}
    for name in settings.groups or ():
        if name not in groups:
            raise InputError(f"--group {shown(name)}: no such group in {where}; {choose_from(name, groups)}")
        if groups[name].validation:
            raise InputError(f"--group {shown(name)}: is kept for validation in {where} and is never fitted")
    if isinstance(bandwidth, tuple) and len(bandwidth) != len(joints):
        raise InputError(
            f"--bandwidth has {len(bandwidth)} numbers; {where} has {len(joints)} joints: {', '.join(joints)}"
        )
    choose_effects(settings.effects, joints, measurements.carried, tuple(groups))
    return with_plausibility_warnings(measurements, report, should_stop)


def run_identification(
    path: Path, options: IdentificationOptions, report: Reporter, should_stop: Callable[[], bool]
) -> tuple[MeasurementSet, Identification]:
    """Read and check a measurement set, and identify it."""
    with loading():
        from flexviz.analysis.identification import identify

    settings = options.settings()  # refuses a wrong name before long files are read
    measurements = read_selected(path, settings, report, should_stop)
    return measurements, identify(measurements, settings, progress=report, should_stop=should_stop)


def exit_code(result: Identification) -> int:
    """0 converged, 1 not, 130 stopped by the user."""
    if result.stopped:
        return 130
    return 0 if result.converged else 1


def parse_bandwidth(text: str | None) -> float | tuple[float, ...] | None:
    """One number or one per joint, comma separated [rad/s]; None if not given."""
    if text is None:
        return None
    values = positive_numbers("--bandwidth", text, "one in rad/s or one per joint: 40,60")
    return values[0] if len(values) == 1 else tuple(values)


def parse_gains(text: str | None) -> EsoGains | None:
    """Six gains for θ and τ, or six of θ and six of τ; None if not given."""
    from flexviz.model.observers import EsoGains

    if text is None:
        return None
    values = positive_numbers("--gains", text, "six gains, or six of the angle and six of the torque")
    if len(values) not in (6, 12):
        raise InputError(f"--gains {text}: {len(values)} numbers, expected 6 or 12")
    return EsoGains.of(values[:6], values[6:] or None)


def positive_numbers(option: str, text: str, expected: str) -> list[float]:
    """Numbers separated by commas."""
    values = []
    for part in text.split(","):
        try:
            values.append(float(part))
        except ValueError:
            raise InputError(f'{option} {text}: "{part}" is not a number, expected {expected}') from None
        if not (math.isfinite(values[-1]) and values[-1] > 0.0):
            raise InputError(f"{option} {text}: {part} is not a positive number, expected {expected}")
    return values
