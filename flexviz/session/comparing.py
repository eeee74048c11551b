"""Sessions side by side: parameters, errors, effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

from flexviz.errors import InputError
from flexviz.identification import Identification, ParameterEstimate
from flexviz.measurements import fingerprint
from flexviz.session.loading import OpenedSession

if TYPE_CHECKING:
    from flexviz.diagnosis import Diagnosis

Source = Literal["identification", "diagnosis", ""]
VALUES: tuple[Source, ...] = ("identification", "diagnosis")
ERRORS: tuple[Source, ...] = ("diagnosis", "identification")
Key = tuple[str, str | None, str | None, str | None]  # parameter; its joint, payload, group


@dataclass(frozen=True)
class SessionSummary:
    """What one session ends with.

    Attributes
    ----------
    name: of its folder.
    set_name, set_sha256: its measurement set, as it is now.
    changed: files that are not what the results were computed from.
    verdict: of the last diagnosis that belongs to the present model; "" without one.
    effects: of the model, the set's own first.
    observer, refined: of the identification; "" without one.
    source: what the parameters come from: "identification" or "diagnosis", the same for all sessions where
        all have it; "" where there is neither.
    errors_from: the same of the errors. The diagnosis' are preferred: all of them are of one band, while an
        identification's depend on its observer.
    joints: names.
    rms, rms_validation, noise_floor: one a joint [Nm]; empty where they are not known.
    parameters: key -> estimate.
    """

    name: str
    set_name: str
    set_sha256: str
    changed: tuple[str, ...]
    verdict: str
    effects: tuple[str, ...]
    observer: str
    refined: bool
    source: Source
    errors_from: Source
    joints: tuple[str, ...]
    rms: tuple[float, ...]
    rms_validation: tuple[float, ...]
    noise_floor: tuple[float, ...]
    parameters: dict[Key, ParameterEstimate]


@dataclass(frozen=True)
class ParameterRow:
    """One parameter in all sessions.

    Attributes
    ----------
    key: which.
    unit: of all values.
    estimates: one a session; None where its model does not have it.
    deviations: how far the last value is from the first, in standard errors of the difference as if the two
        were independent; NaN where that is not known.
    """

    key: Key
    unit: str
    estimates: tuple[ParameterEstimate | None, ...]
    deviations: float

    @property
    def name(self) -> str:
        """The parameter."""
        return self.key[0]

    @property
    def place(self) -> str:
        """Where it belongs."""
        return ", ".join(part for part in self.key[1:] if part)


@dataclass(frozen=True)
class SessionComparison:
    """Sessions in the order they were given, and every parameter that any of them has."""

    sessions: tuple[SessionSummary, ...]
    rows: tuple[ParameterRow, ...]

    @property
    def same_data(self) -> bool:
        """Whether all of them look at the same data."""
        return len({summary.set_sha256 for summary in self.sessions}) == 1

    def to_json(self) -> dict[str, Any]:
        """For programs; what is not known is null."""
        return {
            "format": 1,
            "same_data": self.same_data,
            "sessions": [
                {
                    "name": s.name,
                    "set": s.set_name,
                    "set_sha256": s.set_sha256,
                    "changed": list(s.changed),
                    "verdict": s.verdict or None,
                    "effects": list(s.effects),
                    "observer": s.observer or None,
                    "refined": s.refined,
                    "source": s.source or None,
                    "errors_from": s.errors_from or None,
                    "joints": list(s.joints),
                    "rms": list(s.rms),
                    "rms_validation": list(s.rms_validation),
                    "noise_floor": list(s.noise_floor),
                }
                for s in self.sessions
            ],
            "parameters": [
                {
                    "name": row.name,
                    "joint": row.key[1],
                    "payload": row.key[2],
                    "group": row.key[3],
                    "unit": row.unit,
                    "values": [None if e is None else e.value for e in row.estimates],
                    "std": [None if e is None else e.std for e in row.estimates],
                    "identifiable": [None if e is None else e.identifiable for e in row.estimates],
                    "deviations": row.deviations,
                }
                for row in self.rows
            ],
        }


def compare(opened: Sequence[OpenedSession]) -> SessionComparison:
    """Put two sessions or more side by side."""
    if len(opened) < 2:
        raise InputError(f"{len(opened)} session to compare; two or more would be right")
    found = [results(one) for one in opened]
    sessions = _named(
        [
            summary(one, source_of(found, mine, VALUES), source_of(found, mine, ERRORS))
            for one, mine in zip(opened, found, strict=True)
        ]
    )
    keys = dict.fromkeys(key for one in sessions for key in one.parameters)
    rows = []
    for key in keys:
        estimates = tuple(one.parameters.get(key) for one in sessions)
        unit = next(e.unit for e in estimates if e is not None)
        rows.append(ParameterRow(key, unit, estimates, deviations(estimates[0], estimates[-1])))
    return SessionComparison(tuple(sessions), tuple(rows))


def summary(opened: OpenedSession, values: Source, errors: Source) -> SessionSummary:
    """What a session ends with: parameters of one source, errors of one source."""
    analysis, measurements = opened.session.analysis, opened.measurements
    found = results(opened)
    result, diagnosis = found.identification, found.diagnosis
    rms: tuple[float, ...] = ()
    rms_validation: tuple[float, ...] | None = None
    floor: tuple[float, ...] = ()
    if errors == "identification" and result is not None:
        residual = result.residual
        rms, rms_validation, floor = residual.rms, residual.rms_validation, residual.noise_floor
    elif errors == "diagnosis" and diagnosis is not None and diagnosis.steps:
        step = diagnosis.steps[-1]
        rms, rms_validation, floor = step.rms, step.rms_validation, step.noise_floor
    fitted = result if values == "identification" else diagnosis if values == "diagnosis" else None
    parameters = fitted.parameters if fitted is not None else ()
    return SessionSummary(
        opened.folder.resolve().name,
        measurements.name,
        fingerprint(measurements).sha256,
        opened.changed,
        diagnosis.verdict if diagnosis is not None else "",
        (*measurements.effects, *analysis.effects),
        result.observer_name if result is not None else "",
        result.refined if result is not None else False,
        values,
        errors,
        measurements.joints,
        rms,
        rms_validation or (),
        floor,
        {(p.name, p.joint, p.payload, p.group): p for p in parameters},
    )


@dataclass(frozen=True)
class Results:
    """What belongs to the present settings, or, where data have changed, did."""

    identification: Identification | None
    diagnosis: Diagnosis | None

    def has(self, source: Source) -> bool:
        """Whether numbers can be had from there."""
        if source == "identification":
            return self.identification is not None
        return self.diagnosis is not None and bool(self.diagnosis.parameters)


def results(opened: OpenedSession) -> Results:
    """The results of a session's present settings."""
    analysis = opened.session.analysis
    older = bool(opened.changed)  # then nothing counts as up to date, and that is said instead
    return Results(
        analysis.identification if analysis.up_to_date or older else None,
        analysis.diagnosis if analysis.diagnosis_up_to_date or older else None,
    )


def source_of(found: Sequence[Results], one: Results, order: Sequence[Source]) -> Source:
    """Where a session's numbers come from: what all sessions have, in this order; else what it has itself."""
    for source in order:
        if all(other.has(source) for other in found):
            return source
    for source in order:
        if one.has(source):
            return source
    return ""


def deviations(first: ParameterEstimate | None, last: ParameterEstimate | None) -> float:
    """How far apart two estimates are, in standard errors of their difference as if they were independent."""
    if first is None or last is None:
        return math.nan
    spread = math.hypot(first.std, last.std)
    return abs(last.value - first.value) / spread if 0 < spread < math.inf else math.nan


def _named(found: list[SessionSummary]) -> list[SessionSummary]:
    """Names that differ, where folders are called the same."""
    names = [one.name for one in found]
    return [
        replace(one, name=f"{one.name} ({names[: i + 1].count(one.name)})")
        if names.count(one.name) > 1
        else one
        for i, one in enumerate(found)
    ]
