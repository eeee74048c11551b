"""Entries of the results document.

They are built from the records of an identification or a diagnosis by their attributes; infinities and NaN
become null.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AliasChoices,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
    model_validator,
)

from flexviz.results.grades import Grade, NoteKind, Verdict


def _nullable(value: Any, info: ValidationInfo) -> Any:
    """Numbers and arrays of a record with None for what is not finite; files are left to the strict check."""
    if info.mode == "json":
        return value
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_nullable(item, info) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _named(names: tuple[str, ...], data: Any) -> Any:
    """A tuple of a record with its names; anything else as it is."""
    return dict(zip(names, data, strict=True)) if isinstance(data, tuple) else data


Number = Annotated[float, Field(allow_inf_nan=False)]
Nullable = Annotated[Number | None, BeforeValidator(_nullable)]
Column = Annotated[list[Number | None], BeforeValidator(_nullable)]
Rows = Annotated[list[Column], BeforeValidator(_nullable)]


class ResultEntry(BaseModel):
    """Part of a document."""

    model_config = ConfigDict(extra="ignore", frozen=True, from_attributes=True, populate_by_name=True)


class ParameterEntry(ResultEntry):
    """One parameter with its uncertainty."""

    name: str
    joint: str | None
    value: Number
    std: Nullable
    unit: str
    start: Nullable = None
    identifiable: Grade
    tied_to: list[str] = []
    at_bound: bool = False
    payload: str | None = None
    group: str | None = None

    @property
    def label(self) -> str:
        """`izz:joint1`, `payload_error.relative_mass_error:p2`"""
        return ":".join(part for part in (self.name, self.joint, self.payload, self.group) if part)


class CombinationEntry(ResultEntry):
    """A base parameter: the smallest combination of inertias that motion can show."""

    name: str
    weights: dict[str, Number] = {}
    value: Number
    std: Nullable
    unit: str
    identifiable: Grade


class ObserverEntry(ResultEntry):
    """The observer; its bandwidth [rad/s] is one number or one per joint."""

    name: str
    bandwidth: Number | list[Number]


class ResidualEntry(ResultEntry):
    """Residual per joint [Nm], unweighted."""

    joints: list[str]
    rms: list[Number]
    rms_validation: list[Number] | None
    noise_floor: list[Number]


class ValueEntry(ResultEntry):
    """The value of an effect's parameter."""

    value: Number
    std: Nullable = None
    unit: str = ""
    identifiable: Grade | None = None

    @model_validator(mode="before")
    @classmethod
    def _from_tuple(cls, data: Any) -> Any:
        return _named(("value", "std", "unit"), data)


class EffectEntry(ResultEntry):
    """An effect of the model with its place and values; an export adds title and equation."""

    effect: str
    joint: str | None = None
    group: str | None = None
    payload: str | None = None
    title: str | None = None
    equation: str | None = None
    parameters: dict[str, ValueEntry]


class TieEntry(ResultEntry):
    """Another effect that the data hardly tell from this one, and what would separate the two."""

    effect: str
    joint: str | None
    correlation: Number
    would_separate: Annotated[str, Field(validation_alias=AliasChoices("would_separate", "breaks"))] = ""


class AbsorbedEntry(ResultEntry):
    """A parameter that moved when the effect was added, having absorbed it before."""

    name: str
    joint: str | None
    before: Number
    after: Number
    unit: str
    deviations: Nullable


class PlaceEntry(ResultEntry):
    """An effect and where it acts."""

    effect: str
    joint: str | None
    group: str | None = None
    payload: str | None = None
    inseparable_from: list[TieEntry] = []
    absorbed: list[AbsorbedEntry] = []


class CandidateEntry(PlaceEntry):
    """A candidate for what is missing."""

    score: Number
    confidence: Number
    parameters: dict[str, ValueEntry]


class LocationEntry(ResultEntry):
    """A joint and a variable that explain a share of the residual."""

    joint: str
    variable: str
    explained: Nullable
    range: Annotated[list[Number | None], BeforeValidator(_nullable)]


class GroupErrorEntry(ResultEntry):
    """The error of one group [Nm per joint]."""

    name: str
    rms: list[Number]
    validation: bool

    @model_validator(mode="before")
    @classmethod
    def _from_tuple(cls, data: Any) -> Any:
        return (
            dict(zip(("name", "rms", "validation"), data, strict=True)) if isinstance(data, tuple) else data
        )


class StepEntry(ResultEntry):
    """A model on the way: what was added, its errors [Nm per joint] and the verdict on it."""

    added: PlaceEntry | None = None
    rms: list[Number] = []
    rms_validation: list[Number] | None = None
    noise_floor: list[Number] = []
    groups: list[GroupErrorEntry] = []
    verdict: Verdict


class ModelEntry(ResultEntry):
    """The final model of a diagnosis."""

    effects: list[EffectEntry]
    parameters: list[ParameterEntry]


class NoteEntry(ResultEntry):
    """A note of a diagnosis."""

    kind: NoteKind
    text: str


class MapEntry(ResultEntry):
    """One joint's residual [Nm] against one variable; one row per curve."""

    joint: str
    variable: str
    unit: str
    curves: list[str]
    centres: Rows
    mean: Rows
    std: Rows
    count: list[list[int]]
    explained: Nullable
    explained_std: Nullable
    explained_by_group: dict[str, Nullable]
    range: Column

    @model_validator(mode="before")
    @classmethod
    def _counts(cls, data: Any) -> Any:
        count = getattr(data, "count", None)
        return {**vars(data), "count": count.tolist()} if isinstance(count, np.ndarray) else data


class FreeCurveEntry(ResultEntry):
    """A free curve of residual torque [Nm] against one variable, a stopgap."""

    joint: str
    variable: str
    unit: str
    directions: list[str]
    centres: Column
    value: Rows
    std: Rows
    explained: Nullable
    explained_std: Nullable
    smoothing: Nullable
    note: str


class GuardJointEntry(ResultEntry):
    """What moves with the bandwidth at one joint [Nm], one number per bandwidth."""

    joint: str
    rms: Column
    change: Column
    change_noise: Column
    observer_error: bool


class GuardParameterEntry(ResultEntry):
    """One parameter over the bandwidth."""

    name: str
    joint: str | None
    place: str | None
    unit: str
    values: Column
    std: Column
    moved: Nullable
    trusted: bool


class GuardEntry(ResultEntry):
    """What moves with the observer's bandwidth [rad/s]."""

    observer: str
    bandwidths: Column
    in_use: int
    joints: list[GuardJointEntry]
    parameters: list[GuardParameterEntry]
    texts: list[str]

    @model_validator(mode="before")
    @classmethod
    def _by_joint(cls, data: Any) -> Any:
        if isinstance(data, Mapping):
            return data
        rows = [
            {
                "joint": joint,
                "rms": data.rms[:, j],
                "change": data.change[:, j],
                "change_noise": data.change_noise[:, j],
                "observer_error": bool(data.observer_error[j]),
            }
            for j, joint in enumerate(data.joints)
        ]
        return {
            "observer": data.observer,
            "bandwidths": data.bandwidths,
            "in_use": int(data.in_use),
            "joints": rows,
            "parameters": data.parameters,
            "texts": data.texts(),
        }


class ResultFields(ResultEntry):
    """A result: of an identification, a diagnosis or an export.

    A diagnosis has `verdict`, `candidates`, `where`, `steps` and `model`; an identification has `parameters`
    and what belongs to one fit. What a result does not have is left out.
    """

    format: Literal[1]
    set: str
    set_sha256: str | None = None
    verdict: Verdict | None = None
    candidates: list[CandidateEntry] = []
    where: list[LocationEntry] = []
    steps: list[StepEntry] = []
    model: ModelEntry | None = None
    observer: ObserverEntry | None = None
    refined: bool = False
    groups: list[str] | None = None
    validation_groups: list[str] = []
    converged: bool = True
    stopped: bool = False
    message: str = ""
    iterations: int | None = None
    condition_number: Nullable = None
    parameters: list[ParameterEntry] | None = None
    base_parameters: list[CombinationEntry] = []
    effects: list[EffectEntry] | None = None
    residual: ResidualEntry | None = None
    notes: list[str] = []
    typed_notes: list[NoteEntry] = []
    maps: list[MapEntry] = []
    free_curve: FreeCurveEntry | None = None
    guard: GuardEntry | None = None
    seconds: Number | None = None

    @property
    def all_parameters(self) -> list[ParameterEntry]:
        """The parameters, wherever they stand."""
        return list(self.model.parameters if self.model is not None else self.parameters or [])

    @property
    def all_effects(self) -> list[EffectEntry] | None:
        """The effects where they are listed; None where only their parameters are."""
        return self.effects if self.model is None else self.model.effects

    @property
    def final_verdict(self) -> Verdict | None:
        """Of the model that the parameters belong to; a diagnosis's `verdict` is of its first one."""
        return self.steps[-1].verdict if self.steps else self.verdict

    @property
    def findings(self) -> list[CandidateEntry]:
        """The candidates, under the name a diagnosis has for them."""
        return self.candidates
