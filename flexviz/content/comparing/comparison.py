"""Results of sets, sessions, files or recordings side by side: every parameter that any of them has."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from flexviz.base.errors import InputError
from flexviz.content.records import ParameterEstimate
from flexviz.content.results import ResultDocument
from flexviz.robot.model import EffectValue

Key = tuple[str, str | None, str | None, str | None]  # parameter; its joint, payload, group
MARKED = 3.0  # [standard errors] larger differences are rarely chance, even among 100 parameters


@dataclass(frozen=True, eq=False)
class KnownResults:
    """What one set, session, file or recording has: an identification, a diagnosis, or both of one model.

    Attributes:
        name: of the folder or file.
        set_name, set_sha256: of the measurement set; "" where the hash is not known.
        identification, diagnosis: None where there is none.
        effects: of the model; None: those that the documents list.
        changed: files that have changed since the results were computed.
    """

    name: str
    set_name: str
    identification: ResultDocument | None = None
    diagnosis: ResultDocument | None = None
    set_sha256: str = ""
    effects: tuple[str, ...] | None = None
    changed: tuple[str, ...] = ()

    @property
    def usable(self) -> dict[str, ResultDocument]:
        """The results that have values, a fit before a diagnosis."""
        both: dict[str, ResultDocument | None] = {
            "identification": self.identification,
            "diagnosis": self.diagnosis,
        }
        return {kind: one for kind, one in both.items() if one is not None and one.all_parameters}


@dataclass(frozen=True)
class ResultSummary:
    """What is compared of one result.

    Parameters and their errors come from the same kind of result everywhere if possible; errors are in one
    band, whatever the observer.
    """

    name: str
    set_name: str
    set_sha256: str
    changed: tuple[str, ...]
    verdict: str  # on the model; "" without a diagnosis
    effects: tuple[str, ...]
    observer: str  # of the identification, as the next three; "" without one
    tuning: str
    groups: tuple[str, ...]  # that were fitted
    refined: bool
    source: str  # kind of result that parameters and errors come from; "" for none
    joints: tuple[str, ...]
    rms: tuple[float, ...]  # one per joint [Nm], as the next two; empty if unknown
    rms_validation: tuple[float, ...]
    noise_floor: tuple[float, ...]
    torque_spread: tuple[float, ...]  # of the recorded torque; the errors are stated in per cent of it
    torque_units: tuple[str, ...]  # of each joint; empty if all are in Nm
    parameters: Mapping[Key, ParameterEstimate]


@dataclass(frozen=True)
class ParameterRow:
    """One parameter in all results."""

    key: Key
    unit: str
    estimates: tuple[ParameterEstimate | None, ...]  # one per result; None if its model lacks it
    deviations: float  # last minus first, in standard errors as if independent; NaN if unknown

    @property
    def name(self) -> str:
        return self.key[0]

    @property
    def place(self) -> str:
        """Joint, payload and group."""
        return ", ".join(part for part in self.key[1:] if part)

    @property
    def differs(self) -> bool:
        """Whether first and last differ by more than chance explains."""
        return self.deviations >= MARKED


@dataclass(frozen=True)
class ResultComparison:
    """Results in the given order, and every parameter that any of them has."""

    results: tuple[ResultSummary, ...]
    rows: tuple[ParameterRow, ...]

    @property
    def same_data(self) -> bool:
        """Whether all results are known to be of one measurement set."""
        return len({one.set_sha256 for one in self.results}) == 1 and bool(self.results[0].set_sha256)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for `flexviz compare --json`; unknown values are None."""
        return {
            "format": 1,
            "same_data": self.same_data,
            "sessions": [
                {
                    "set" if field.name == "set_name" else field.name: _plain(getattr(one, field.name))
                    for field in fields(one)
                    if field.name != "parameters"
                }
                for one in self.results
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


def compare(known: Sequence[KnownResults]) -> ResultComparison:
    """Compare two or more results."""
    if len(known) < 2:
        raise InputError(f"{len(known)} result to compare, expected two or more")
    shared = [kind for kind in known[0].usable if all(kind in one.usable for one in known)]
    results = _named([_summary(one, shared) for one in known])
    keys = dict.fromkeys(key for one in results for key in one.parameters)
    rows = []
    for key in keys:
        estimates = tuple(one.parameters.get(key) for one in results)
        unit = next(e.unit for e in estimates if e is not None)
        rows.append(ParameterRow(key, unit, estimates, _deviations(estimates[0], estimates[-1])))
    return ResultComparison(tuple(results), tuple(rows))


def _summary(known: KnownResults, shared: Sequence[str]) -> ResultSummary:
    """What is compared of a result; a kind in `shared`, which all results have, is preferred."""
    source = next(iter((*shared, *known.usable)), "")
    found, fit, diagnosis = known.usable.get(source), known.identification, known.diagnosis
    estimates = () if found is None else found.all_parameters
    of = None if found is None else found.final_errors
    observer = None if fit is None else fit.observer
    listed = () if found is None else effects_of(found)
    return ResultSummary(
        name=known.name,
        set_name=known.set_name,
        set_sha256=known.set_sha256,
        changed=known.changed,
        verdict=next((one.final_verdict for one in (diagnosis, fit) if one and one.final_verdict), ""),
        effects=listed if known.effects is None else known.effects,
        observer="" if observer is None else observer.name,
        tuning="" if observer is None else observer.tuning,
        groups=() if fit is None else fit.groups or (),
        refined=fit is not None and fit.refined,
        source=source,
        joints=() if of is None else of.joints,
        rms=() if of is None else of.rms,
        rms_validation=() if of is None else of.rms_validation or (),
        noise_floor=() if of is None else of.noise_floor,
        torque_spread=() if of is None else of.torque_spread,
        torque_units=() if of is None else of.units,
        parameters={(p.name, p.joint, p.payload, p.group): p for p in estimates},
    )


def effects_of(document: ResultDocument) -> tuple[str, ...]:
    """The effects of a document's model, as options name them."""
    values = (EffectValue(e.effect, e.joint, {}, e.group, e.payload) for e in document.all_effects)
    return tuple(value.text for value in values)


def _deviations(first: ParameterEstimate | None, last: ParameterEstimate | None) -> float:
    """Difference of two estimates in standard errors, as if they were independent; NaN if unknown."""
    if first is None or last is None:
        return math.nan
    spread = math.hypot(first.std, last.std)
    return abs(last.value - first.value) / spread if 0 < spread < math.inf else math.nan


def _named(found: list[ResultSummary]) -> list[ResultSummary]:
    """Number the results whose folders or files have the same name."""
    names = [one.name for one in found]
    numbered = [f"{name} ({names[: i + 1].count(name)})" for i, name in enumerate(names)]
    return [
        replace(one, name=new) if names.count(one.name) > 1 else one
        for one, new in zip(found, numbered, strict=True)
    ]
