"""Identifying and diagnosing one set of a batch."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from flexviz.analysis.diagnosis import diagnose
from flexviz.analysis.identification import FitSettings, identify
from flexviz.base.errors import FlexvizError
from flexviz.data.measurements import MeasurementSet, fingerprint, read_set
from flexviz.outlets.batch.sources import BatchSet
from flexviz.outlets.batch.tasks import BatchTask, Json

LEFT_OUT = ("maps",)  # of a diagnosis: the largest part of it, only for plots


class SetChanged(FlexvizError):
    """A set is not any more what it was when its task was made."""


@dataclass(frozen=True)
class SetOptions:
    """What is done with every set.

    Attributes:
        fit: how it is identified.
        diagnosed: also look for the missing effects, add them one by one, and refit.
        limit: [s] after which a diagnosis ends with what it has found; 0: none.
    """

    fit: FitSettings = field(default_factory=FitSettings)
    diagnosed: bool = True
    limit: float = 0.0


def set_task(one: BatchSet, options: SetOptions) -> BatchTask:
    """The task of a set that can be read."""
    what = {"sha256": one.sha256, "options": asdict(options)}
    return BatchTask("set", one.name, what, {"path": str(one.path)})


def analyse_set(what: Json, where: Json) -> Json:
    """Identify and diagnose: the results documents of both."""
    options, measurements = what["options"], known_set(what, where)
    stop = stop_after(options["limit"])
    settings = FitSettings(**options["fit"])
    identified = identify(measurements, settings, should_stop=stop)
    out: Json = {"joints": list(measurements.joints), "robot": measurements.robot.name}
    out |= {"simulated": measurements.simulated, "warnings": list(map(str, measurements.warnings))}
    out["identification"] = identified.to_dict()
    if options["diagnosed"]:
        extended = replace(measurements, effects=(*measurements.effects, *settings.effects))
        out["diagnosis"] = _without(diagnose(extended, apply=True, should_stop=stop).to_dict(), LEFT_OUT)
    return out


def known_set(what: Json, where: Json) -> MeasurementSet:
    """The set of a task; `SetChanged` if its content is another one."""
    measurements = read_set(Path(where["path"]), logged=False)
    if fingerprint(measurements).sha256 != what["sha256"]:
        raise SetChanged(f"{where['path']} has changed since the batch began; run it again")
    return measurements


def stop_after(limit: float) -> Callable[[], bool]:
    """A `should_stop` that turns true after `limit` [s]; never for 0."""
    end = time.monotonic() + limit
    return lambda: limit > 0 and time.monotonic() > end


def _without(document: dict[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    return {name: value for name, value in document.items() if name not in names}
