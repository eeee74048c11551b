"""The fields of a document, and those that it shares with an identification or a diagnosis."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from flexviz.base.fields import Number, Real, check_lengths, is_none
from flexviz.content.records import (
    CandidateEffect,
    Combination,
    CriterionNumbers,
    CurveTable,
    Decoys,
    DetectionLimit,
    EffectEntry,
    EffectParameter,
    FreeCurve,
    ModelEntry,
    Move,
    Note,
    ObserverEntry,
    ParameterEstimate,
    RecordingEntry,
    ResidualLocation,
    ResidualMap,
    ResidualSummary,
    StepEntry,
    TorqueEntry,
    Verdict,
)
from flexviz.content.results.bandwidth import GuardEntry
from flexviz.content.results.link_side import LinkSide


@dataclass(frozen=True, eq=False, kw_only=True)
class EveryResult:
    """What an identification, a diagnosis and a document have under the same name.

    Attributes:
        stopped: whether the user stopped it; the result is what it had.
        link_side: what the link encoders show of the stiffness; empty without any.
        recording: what the robot contradicts in the recording; mostly nothing.
    """

    stopped: bool = False
    link_side: Annotated[tuple[LinkSide, ...], Field(exclude_if=operator.not_)] = ()
    recording: Annotated[tuple[RecordingEntry, ...], Field(exclude_if=operator.not_)] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class FitFields(EveryResult):
    """What an identification and a document have under the same name.

    Attributes:
        refined: whether the instrumental-variables refinement has run.
        validation_groups: names.
        converged: how it ended.
    """

    refined: bool = False
    validation_groups: tuple[str, ...] = ()
    converged: bool = True


@dataclass(frozen=True, eq=False, kw_only=True)
class DiagnosisFields(EveryResult):
    """What a diagnosis and a document have under the same name.

    Attributes:
        where: locations of what no effect explains: of the final model's residual, without free curves
            beside which it was estimated; if the place of an unknown law is known, with parameters that the
            law does not bias, like `maps` and `free_curve`.
        maps: residual of the final model against each variable, joint by joint.
        free_curve: curve of an unexplained residual, as a stopgap; None if nothing is unexplained.
        trace: the moves that the search tried, in order.
        decoys: candidates that cannot be right; None if none were tried.
        limit: down to what a last verdict of "nothing-missing" holds; None if unknown.
        criterion: the numbers of the criterion by which models were compared; None in older results.
    """

    where: tuple[ResidualLocation, ...] = ()
    maps: tuple[ResidualMap, ...] = ()
    free_curve: FreeCurve | None = None
    trace: tuple[Move, ...] = ()
    decoys: Annotated[Decoys | None, Field(exclude_if=is_none)] = None
    limit: Annotated[DetectionLimit | None, Field(exclude_if=is_none)] = None
    criterion: Annotated[CriterionNumbers | None, Field(exclude_if=is_none)] = None


class ResultFields(BaseModel, FitFields, DiagnosisFields, frozen=True):
    """The fields of a `ResultDocument`."""

    model_config = ConfigDict(extra="ignore", defer_build=True)

    message: str = ""
    condition_number: Real = math.nan
    format: Literal[1]
    set: str
    set_sha256: str | None = None
    verdict: Verdict | None = None
    candidates: tuple[CandidateEffect, ...] = ()
    steps: tuple[StepEntry, ...] = ()
    model: ModelEntry | None = None
    observer: ObserverEntry | None = None
    groups: tuple[str, ...] | None = None
    iterations: int | None = None
    parameters: tuple[ParameterEstimate, ...] | None = None
    base_parameters: tuple[Combination, ...] = ()
    effects: tuple[EffectEntry, ...] | None = None
    residual: ResidualSummary | None = None
    notes: tuple[str, ...] = ()
    typed_notes: tuple[Note, ...] = ()
    curves: tuple[CurveTable, ...] = ()
    guard: GuardEntry | None = None
    torque: TorqueEntry | None = None
    torque_side: Literal["motor", "joint"] | None = None
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
    def all_parameters(self) -> tuple[ParameterEstimate, ...]:
        """Parameters of the final model, or of the fit."""
        return self.model.parameters if self.model is not None else self.parameters or ()

    @property
    def all_effects(self) -> tuple[EffectEntry, ...]:
        """Effects of the final model, or of the fit; if none are listed, those of its parameters."""
        listed = self.effects if self.model is None else self.model.effects
        if listed is not None:
            return listed
        found: dict[tuple[str, str | None, str | None, str | None], dict[str, EffectParameter]] = {}
        for p in self.all_parameters:
            effect, dot, name = p.name.partition(".")
            if dot:
                values = found.setdefault((effect, p.joint, p.group, p.payload), {})
                values[name] = EffectParameter(p.value, p.std, p.unit, p.identifiable)
        return tuple(
            EffectEntry(effect, values, joint, group, payload)
            for (effect, joint, group, payload), values in found.items()
        )

    @property
    def final_verdict(self) -> Verdict | None:
        """Verdict on the final model; `verdict` of a diagnosis refers to its first one."""
        return self.steps[-1].verdict if self.steps else self.verdict

    @property
    def torque_spread(self) -> tuple[float, ...]:
        """Standard deviation of the recorded torque per joint [Nm]; empty if unknown."""
        return () if self.torque is None else self.torque.spread

    @property
    def final_errors(self) -> ResidualSummary | None:
        """Errors of the final model, or of the fit; None where the document has none."""
        if not self.steps or not self.steps[-1].rms:
            return self.residual
        last, known = self.steps[-1], self.torque
        joints = tuple(dict.fromkeys(p.joint for p in self.all_parameters if p.joint))
        return ResidualSummary(
            joints if known is None else known.joints,
            last.rms, last.rms_validation, last.noise_floor, self.torque_spread, units=last.units,
        )  # fmt: skip

    @property
    def findings(self) -> tuple[CandidateEffect, ...]:
        """The candidates, by their name in `Diagnosis`."""
        return self.candidates
