"""The long jobs: open, identify, sweep, simulate the identified model. Module-level functions, no viser."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexviz.errors import Cancelled, InputError
from flexviz.progress import ProgressCallback, StopCallback, ignore, never
from flexviz.scene import RobotShape, robot_shape
from flexviz.session import SESSION_FILE, Analysis, Session, is_session, open_session, with_roles
from flexviz.view import truth_values

if TYPE_CHECKING:
    from flexviz.diagnosis import Diagnosis, ResidualMap
    from flexviz.identification import Identification, SweepResult
    from flexviz.measurements import MeasurementSet
    from flexviz.model import FlexibleModel

WARM = ("flexviz.measurements", "flexviz.identification", "flexviz.diagnosis", "flexviz.simulation")


@dataclass(frozen=True, eq=False)
class Opened:
    """A measurement set, ready to be shown."""

    measurements: MeasurementSet
    shape: RobotShape
    truth: dict[tuple[str, str | None], float] | None
    session: Session | None = None  # where a saved one was opened
    folder: Path | None = None  # where that lies


def open_set(path: Path, *, progress: ProgressCallback = ignore, should_stop: StopCallback = never) -> Opened:
    """Read a set, or a session and its set, and the robot's shape."""
    saved = is_session(path)
    opened = open_session(path)
    measurements = opened.measurements
    shape, truth = robot_shape(measurements.robot), read_truth(measurements.path)
    session, folder = (opened.session, opened.folder.resolve()) if saved else (None, None)
    return Opened(measurements, shape, truth, session, folder)


def read_truth(folder: Path) -> dict[tuple[str, str | None], float] | None:
    """The values a simulated set was made with, or None; only shown when asked for."""
    file = folder / "truth.json"
    if not file.is_file():
        return None
    try:
        return truth_values(json.loads(file.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"not a usable truth file ({error})", file=file) from None


def identify_set(
    analysis: Analysis, *, progress: ProgressCallback, should_stop: StopCallback
) -> Identification:
    """Identify as the analysis says."""
    from flexviz.identification import identify

    return identify(
        chosen_set(analysis),
        effects=analysis.effects,
        observer=analysis.observer,
        bandwidth=analysis.bandwidth,
        refine=analysis.refine,
        progress=progress,
        should_stop=should_stop,
    )


@dataclass(frozen=True, eq=False)
class Looked:
    """What a search for missing effects gives back.

    Attributes
    ----------
    diagnosis: of the model the search started with.
    identification: of that model; None where it was known before.
    added: after each added effect: the effects beside the set's own, and the model's identification.
    """

    diagnosis: Diagnosis
    identification: Identification | None
    added: tuple[tuple[tuple[str, ...], Identification], ...] = ()


def diagnose_set(
    analysis: Analysis,
    known: FlexibleModel | None,
    apply: bool,
    *,
    progress: ProgressCallback,
    should_stop: StopCallback,
) -> Looked:
    """Identify where that is needed, then look for what is missing; with `apply` add all that is found.

    `known` is the identified model where there is one already. `progress` gets the identification's
    iterations and the diagnosis's sentences.
    """
    from flexviz.diagnosis import diagnose

    identification = None
    if known is None:
        identification = identify_set(analysis, progress=progress, should_stop=should_stop)
        if should_stop():
            raise Cancelled
        known = identification.model if identification.converged else None
    if (analysis.observer, analysis.bandwidth) != (Analysis(analysis.path).observer, None):
        known = None  # another observer's values may lie far from what the diagnosis would start with
    measurements = chosen_set(analysis)
    measurements = replace(measurements, effects=(*measurements.effects, *analysis.effects))
    diagnosis = diagnose(measurements, apply=apply, start=known, progress=progress, should_stop=should_stop)
    added: list[tuple[tuple[str, ...], Identification]] = []
    effects = analysis.effects
    for step in diagnosis.steps[1:] if apply else ():
        if step.added is None or should_stop():
            break
        effects = (*effects, step.added.text)
        fitted = replace(analysis, effects=effects)
        added.append((effects, identify_set(fitted, progress=progress, should_stop=should_stop)))
    return Looked(diagnosis, identification, tuple(added))


def map_set(
    analysis: Analysis, model: FlexibleModel, *, progress: ProgressCallback, should_stop: StopCallback
) -> tuple[ResidualMap, ...]:
    """Where a model's residual lives, as the diagnosis sees it: every joint's against every variable."""
    from flexviz.diagnosis import maps_of

    def check() -> None:
        if should_stop():
            raise Cancelled

    return maps_of(chosen_set(analysis), model, analysis.effects, check)


def sweep_set(
    analysis: Analysis,
    bandwidths: tuple[float, ...],
    *,
    progress: ProgressCallback,
    should_stop: StopCallback,
) -> SweepResult:
    """Identify at each bandwidth [rad/s]."""
    from flexviz.identification import sweep

    return sweep(
        chosen_set(analysis),
        analysis.observer,
        bandwidths,
        effects=analysis.effects,
        progress=progress,
        should_stop=should_stop,
    )


def replay_group(
    path: Path, model: FlexibleModel, group: str, *, progress: ProgressCallback, should_stop: StopCallback
) -> Any:
    """Simulate the identified model along one group's recording."""
    from flexviz.simulation import replay

    measurements = cached_set(path)
    return replay(
        measurements.robot,
        model,
        measurements.group(group),
        measurements.kp,
        measurements.kd,
        torque_hold=measurements.torque_hold,
        progress=progress,
        should_stop=should_stop,
    )


def chosen_set(analysis: Analysis) -> MeasurementSet:
    """The analysis' set with its groups used as they are to be."""
    return with_roles(cached_set(analysis.path), dict(analysis.roles))


def cached_set(path: Path) -> MeasurementSet:
    """The set as this process read it last; read again when its file has changed."""
    stamp = (path / "measurements.toml").stat().st_mtime_ns
    return _read(path, stamp)


@lru_cache(maxsize=1)
def _read(path: Path, stamp: int) -> MeasurementSet:
    from flexviz.importing.doubts import with_doubts
    from flexviz.measurements import read_set

    return with_doubts(read_set(path))


def sets_beside(*paths: Path) -> dict[str, Path]:
    """Name -> folder of what one can choose: `paths`, and what is bundled, kept, or beside them."""
    from flexviz.resources import sessions_dir

    found: dict[str, Path] = {}
    for parent in (*(path.parent for path in paths), Path.cwd() / "sessions", sessions_dir()):
        names = ("measurements.toml", SESSION_FILE)
        for folder in sorted({file.parent for name in names for file in parent.glob(f"*/{name}")})[:200]:
            if folder.resolve() not in found.values():
                found.setdefault(folder.name, folder.resolve())
    for path in paths:
        found.setdefault(path.name, path.resolve())
    return found
