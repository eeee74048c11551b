"""Sessions side by side: parameters, errors, effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

from flexviz.diagnosis import Diagnosis
from flexviz.errors import InputError
from flexviz.identification import Identification
from flexviz.measurements import fingerprint
from flexviz.records import ParameterEstimate
from flexviz.session.loading import OpenedSession

Source = Literal["identification", "diagnosis", ""]
VALUES: tuple[Source, ...] = ("identification", "diagnosis")
ERRORS: tuple[Source, ...] = ("diagnosis", "identification")
Key = tuple[str, str | None, str | None, str | None]  # parameter; its joint, payload, group


@dataclass(frozen=True)
class SessionSummary:
    """Final results of one session.

    Parameters and errors come from the same result in all sessions if possible. Errors are in the same band,
    whatever the observer.
    """

    name: str  # of the folder
    set_name: str
    set_sha256: str  # of its measurement set in the current state
    changed: tuple[str, ...]  # files that have changed since the results were computed
    verdict: str  # of the diagnosis of the current model; "" without one
    effects: tuple[str, ...]  # of the model, those of the set first
    observer: str  # of the identification; "" without one
    refined: bool
    source: Source  # result that the parameters come from; "" for none
    errors_from: Source
    joints: tuple[str, ...]
    rms: tuple[float, ...]  # one per joint [Nm], as the next two; empty if unknown
    rms_validation: tuple[float, ...]
    noise_floor: tuple[float, ...]
    torque_spread: tuple[float, ...]  # of the recorded torque; the errors are stated in per cent of it
    torque_units: tuple[str, ...]  # of each joint; empty if all are in Nm
    parameters: dict[Key, ParameterEstimate]


@dataclass(frozen=True)
class ParameterRow:
    """One parameter in all sessions."""

    key: Key
    unit: str
    estimates: tuple[ParameterEstimate | None, ...]  # one per session; None if its model lacks it
    deviations: float  # last minus first, in standard errors as if independent; NaN if unknown

    @property
    def name(self) -> str:
        return self.key[0]

    @property
    def place(self) -> str:
        """Joint, payload and group."""
        return ", ".join(part for part in self.key[1:] if part)


@dataclass(frozen=True)
class SessionComparison:
    """Sessions in the given order, and every parameter that any of them has."""

    sessions: tuple[SessionSummary, ...]
    rows: tuple[ParameterRow, ...]

    @property
    def same_data(self) -> bool:
        return len({summary.set_sha256 for summary in self.sessions}) == 1

    def to_json(self) -> dict[str, Any]:
        """Plain data for `flexviz compare --json`; unknown values are None."""
        return {
            "format": 1,
            "same_data": self.same_data,
            "sessions": [
                {
                    "set" if field.name == "set_name" else field.name: _plain(getattr(s, field.name))
                    for field in fields(s)
                    if field.name != "parameters"
                }
                for s in self.sessions
            ],
            "parameters": [
                {
                    **dict(zip(("name", "joint", "payload", "group"), row.key, strict=True)),
                    "unit": row.unit,
                    "values": [None if e is None else e.value for e in row.estimates],
                    "std": [None if e is None else e.std for e in row.estimates],
                    "identifiable": [None if e is None else e.identifiable for e in row.estimates],
                    "deviations": row.deviations,
                }
                for row in self.rows
            ],
        }


def _plain(value: Any) -> Any:
    """A list for a tuple, None for an empty text."""
    return list(value) if isinstance(value, tuple) else None if value == "" else value


def compare(opened: Sequence[OpenedSession]) -> SessionComparison:
    """Compare two or more sessions."""
    if len(opened) < 2:
        raise InputError(f"{len(opened)} session to compare, expected two or more")
    found = [results(one) for one in opened]
    every: set[Source] = set.intersection(*(usable(of_one) for of_one in found))
    sessions = _named([summary(one, of_one, every) for one, of_one in zip(opened, found, strict=True)])
    keys = dict.fromkeys(key for one in sessions for key in one.parameters)
    rows = []
    for key in keys:
        estimates = tuple(one.parameters.get(key) for one in sessions)
        unit = next(e.unit for e in estimates if e is not None)
        rows.append(ParameterRow(key, unit, estimates, deviations(estimates[0], estimates[-1])))
    return SessionComparison(tuple(sessions), tuple(rows))


def results(opened: OpenedSession) -> dict[Source, Any]:
    """The results of the current settings by their kind, or the last ones if the data have changed."""
    analysis = opened.session.analysis
    older = bool(opened.changed)  # nothing is up to date then, and `changed` is reported
    found: dict[Source, Any] = {}
    if analysis.identification is not None and (analysis.up_to_date or older):
        found["identification"] = analysis.identification
    if analysis.diagnosis is not None and (analysis.diagnosis_up_to_date or older):
        found["diagnosis"] = analysis.diagnosis
    return found


def summary(opened: OpenedSession, found: dict[Source, Any], every: set[Source]) -> SessionSummary:
    """Final results of a session; a source in `every`, which all sessions have, is preferred."""
    measurements = opened.measurements
    result: Identification | None = found.get("identification")
    diagnosis: Diagnosis | None = found.get("diagnosis")
    values = source_of(VALUES, usable(found), every)
    errors = source_of(ERRORS, usable(found), every)
    fitted = found.get(values)
    measured: Any = None
    if errors == "identification" and result is not None:
        measured = result.residual
    elif errors == "diagnosis" and diagnosis is not None and diagnosis.steps:
        measured = diagnosis.steps[-1]
    return SessionSummary(
        name=opened.folder.resolve().name,
        set_name=measurements.name,
        set_sha256=fingerprint(measurements).sha256,
        changed=opened.changed,
        verdict=diagnosis.verdict if diagnosis is not None else "",
        effects=(*measurements.effects, *opened.session.analysis.effects),
        observer=result.observer_name if result is not None else "",
        refined=result.refined if result is not None else False,
        source=values,
        errors_from=errors,
        joints=measurements.joints,
        rms=measured.rms if measured else (),
        rms_validation=measured.rms_validation or () if measured else (),
        noise_floor=measured.noise_floor if measured else (),
        torque_spread=measurements.torque_spread,
        torque_units=measurements.torque_units,
        parameters={(p.name, p.joint, p.payload, p.group): p for p in fitted.parameters} if fitted else {},
    )


def usable(found: dict[Source, Any]) -> set[Source]:
    """The sources that have values."""
    return {source for source, result in found.items() if result.parameters}


def source_of(order: Sequence[Source], mine: set[Source], every: set[Source]) -> Source:
    """The first source in `order` that all sessions have, else the first that this one has."""
    for source in (*[source for source in order if source in every], *order):
        if source in mine:
            return source
    return ""


def deviations(first: ParameterEstimate | None, last: ParameterEstimate | None) -> float:
    """Difference of two estimates in standard errors, as if they were independent; NaN if unknown."""
    if first is None or last is None:
        return math.nan
    spread = math.hypot(first.std, last.std)
    return abs(last.value - first.value) / spread if 0 < spread < math.inf else math.nan


def _named(found: list[SessionSummary]) -> list[SessionSummary]:
    """Number the sessions whose folders have the same name."""
    names = [one.name for one in found]
    numbered = [f"{name} ({names[: i + 1].count(name)})" for i, name in enumerate(names)]
    return [
        replace(one, name=new) if names.count(one.name) > 1 else one
        for one, new in zip(found, numbered, strict=True)
    ]
