"""Entries of the results document.

Records of a diagnosis are entries themselves. Others are built from the records of an identification or a
diagnosis by their attributes. Infinities and NaN become null.
"""

from __future__ import annotations

import operator
from typing import Literal, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from flexviz.effects import free_curve
from flexviz.model import EffectValue
from flexviz.results.bandwidth import GuardEntry
from flexviz.results.base import (
    Grade,
    Note,
    Nullable,
    Number,
    ResultEntry,
    TupleEntry,
    Verdict,
    check_lengths,
)
from flexviz.results.curves import CurveTable, FreeCurve, ResidualLocation, ResidualMap
from flexviz.results.findings import Absorbed, Family, Tie
from flexviz.results.trace import DecoysEntry, Move


class ParameterEntry(ResultEntry):
    """One parameter with its uncertainty."""

    name: str
    joint: str | None
    value: Number
    std: Nullable
    unit: str
    start: Nullable = None
    identifiable: Grade
    tied_to: list[str] = Field(default_factory=list)
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
    weights: dict[str, Number] = Field(default_factory=dict)
    value: Number
    std: Nullable
    unit: str
    identifiable: Grade


class GainsEntry(ResultEntry):
    """Gains β1 … β6 of the observers of θ and τ [1/sⁱ], at the first joint's bandwidth."""

    theta: list[Number]
    tau: list[Number]


class ObserverEntry(ResultEntry):
    """The observer; its bandwidth [rad/s] is one number or one per joint; gains only if set by hand."""

    name: str
    bandwidth: Number | list[Number]
    gains: GainsEntry | None = None

    @property
    def tuning(self) -> str:
        """Bandwidth and gains as text."""
        width = ", ".join(f"{value:.4g}" for value in np.atleast_1d(self.bandwidth)) + " rad/s"
        if self.gains is None:
            return width
        theta, tau = (", ".join(f"{one:.4g}" for one in row) for row in (self.gains.theta, self.gains.tau))
        return f"{width}, gains β1 … β6 set by hand: {theta if theta == tau else f'{theta} (θ), {tau} (τ)'}"


class ResidualEntry(ResultEntry):
    """Residual per joint [Nm], unweighted, and the standard deviation of the recorded torque.

    `rms_between_reversals` is over samples that no reversal disturbs; absent where no effect needs it.
    `noise_share` is the share of the noise in the torque, in the band of the fit; 1: nothing but noise.
    """

    joints: list[str]
    rms: list[Number]
    rms_validation: list[Number] | None
    noise_floor: list[Number]
    torque_spread: list[Number] = Field(default_factory=list)
    rms_between_reversals: list[Number] = Field(default_factory=list, exclude_if=operator.not_)
    noise_share: list[Number] = Field(default_factory=list)

    @model_validator(mode="after")
    def _per_joint(self) -> Self:
        lists = {"rms": self.rms, "rms_validation": self.rms_validation, "noise_floor": self.noise_floor}
        for name in ("torque_spread", "rms_between_reversals", "noise_share"):
            lists[name] = getattr(self, name) or None
        check_lengths(len(self.joints), "one per joint", **lists)
        return self


class TorqueEntry(ResultEntry):
    """Standard deviation of the recorded torque per joint [Nm], over all groups."""

    joints: list[str]
    spread: list[Number]

    @model_validator(mode="after")
    def _per_joint(self) -> Self:
        check_lengths(len(self.joints), "one per joint", spread=self.spread)
        return self


class ValueEntry(TupleEntry):
    """The value of an effect's parameter."""

    value: Number
    std: Nullable = None
    unit: str = ""
    identifiable: Grade | None = None


class EffectEntry(ResultEntry):
    """An effect of the model with its place and values; an export adds title and equation."""

    effect: str
    joint: str | None = None
    group: str | None = None
    payload: str | None = None
    title: str | None = None
    equation: str | None = None
    parameters: dict[str, ValueEntry]


class PlaceEntry(ResultEntry):
    """An effect and where it acts.

    `family` is absent for an effect of none, `share` (of the held-out error that it removes) where unknown.
    """

    effect: str
    joint: str | None
    group: str | None = None
    payload: str | None = None
    inseparable_from: list[Tie] = Field(default_factory=list)
    absorbed: list[Absorbed] = Field(default_factory=list)
    family: Family | None = Field(default=None, exclude_if=operator.not_)
    share: Number | None = Field(default=None, exclude_if=lambda share: share is None)

    @property
    def text(self) -> str:
        """`coulomb_friction:joint1`, `external_contact:joint1@g2`"""
        return EffectValue(self.effect, self.joint, {}, self.group, self.payload).text


class CandidateEntry(PlaceEntry):
    """A candidate for what is missing."""

    score: Number
    confidence: Number
    parameters: dict[str, ValueEntry]


class GroupErrorEntry(TupleEntry):
    """The error of one group [Nm per joint]."""

    name: str
    rms: list[Number]
    validation: bool


class AddedEntry(PlaceEntry):
    """An effect that a step adds; a free curve has no confidence: it is not physics."""

    confidence: Number | None = None

    @field_validator("confidence")
    @classmethod
    def _of_physics(cls, value: float | None, info: ValidationInfo) -> float | None:
        return None if free_curve(info.data.get("effect", "")) is not None else value


class StepEntry(ResultEntry):
    """A model on the way: what was added, its errors [Nm per joint] and the verdict on it."""

    added: AddedEntry | None = None
    rms: list[Number] = Field(default_factory=list)
    rms_validation: list[Number] | None = None
    noise_floor: list[Number] = Field(default_factory=list)
    groups: list[GroupErrorEntry] = Field(default_factory=list)
    verdict: Verdict


class ModelEntry(ResultEntry):
    """The final model of a diagnosis."""

    effects: list[EffectEntry]
    parameters: list[ParameterEntry]


class ResultFields(ResultEntry):
    """The fields of a `ResultDocument`."""

    format: Literal[1]
    set: str
    set_sha256: str | None = None
    verdict: Verdict | None = None
    candidates: list[CandidateEntry] = Field(default_factory=list)
    where: list[ResidualLocation] = Field(default_factory=list)
    steps: list[StepEntry] = Field(default_factory=list)
    model: ModelEntry | None = None
    observer: ObserverEntry | None = None
    refined: bool = False
    groups: list[str] | None = None
    validation_groups: list[str] = Field(default_factory=list)
    converged: bool = True
    stopped: bool = False
    message: str = ""
    iterations: int | None = None
    condition_number: Nullable = None
    parameters: list[ParameterEntry] | None = None
    base_parameters: list[CombinationEntry] = Field(default_factory=list)
    effects: list[EffectEntry] | None = None
    residual: ResidualEntry | None = None
    notes: list[str] = Field(default_factory=list)
    typed_notes: list[Note] = Field(default_factory=list)
    maps: list[ResidualMap] = Field(default_factory=list)
    free_curve: FreeCurve | None = None
    curves: list[CurveTable] = Field(default_factory=list)
    guard: GuardEntry | None = None
    torque: TorqueEntry | None = None
    trace: list[Move] = Field(default_factory=list)
    decoys: DecoysEntry | None = None
    seconds: Number | None = None

    @model_validator(mode="after")
    def _steps_per_joint(self) -> Self:
        if self.torque is not None:
            for step in self.steps:
                lists = {
                    name: getattr(step, name) or None for name in ("rms", "rms_validation", "noise_floor")
                }
                check_lengths(len(self.torque.joints), "one per joint", **lists)
        return self

    @property
    def all_parameters(self) -> list[ParameterEntry]:
        """Parameters of the final model, or of the fit."""
        return list(self.model.parameters if self.model is not None else self.parameters or [])

    @property
    def all_effects(self) -> list[EffectEntry]:
        """Effects of the final model, or of the fit; if none are listed, those of its parameters."""
        listed = self.effects if self.model is None else self.model.effects
        if listed is not None:
            return listed
        found: dict[tuple[str | None, ...], dict[str, ValueEntry]] = {}
        for p in self.all_parameters:
            effect, dot, name = p.name.partition(".")
            if dot:
                values = found.setdefault((effect, p.joint, p.group, p.payload), {})
                values[name] = ValueEntry(value=p.value, std=p.std, unit=p.unit)
        return [
            EffectEntry(effect=str(effect), joint=joint, group=group, payload=payload, parameters=values)
            for (effect, joint, group, payload), values in found.items()
        ]

    @property
    def final_verdict(self) -> Verdict | None:
        """Verdict on the final model; `verdict` of a diagnosis refers to its first one."""
        return self.steps[-1].verdict if self.steps else self.verdict

    @property
    def torque_spread(self) -> list[float]:
        """Standard deviation of the recorded torque per joint [Nm]; empty if unknown."""
        return [] if self.torque is None else self.torque.spread

    @property
    def findings(self) -> list[CandidateEntry]:
        """The candidates, by their name in `Diagnosis`."""
        return self.candidates
