"""Result of a diagnosis."""

from __future__ import annotations

import math
from dataclasses import dataclass as std_dataclass
from dataclasses import replace
from typing import Annotated, Any

from pydantic import TypeAdapter
from pydantic.dataclasses import dataclass

from flexviz.analysis.diagnosis.plots import DiagnosisPlots
from flexviz.analysis.laws import LawThroughData
from flexviz.base.fields import RECORD, Floats, Once
from flexviz.content.records import (
    CandidateEffect,
    EffectEntry,
    ModelEntry,
    Note,
    ParameterEstimate,
    StepEntry,
    TorqueEntry,
    Verdict,
)
from flexviz.content.results import (
    BandwidthCheck,
    DataFrame,
    DiagnosisFields,
    GuardEntry,
    ResultDocument,
    curve_entries,
    find_parameter,
    note_entries,
    parameter_frame,
    shared_fields,
    torque_side,
)
from flexviz.content.wording import finding_key, found_shares
from flexviz.robot.model import FlexibleModel


@std_dataclass(frozen=True, eq=False)
class Evidence:
    """Residual of one joint and the part that an effect explains.

    Attributes:
        joint: joint whose residual changes most.
        groups: (name, first row, row after the last) of each group.
        time: shape (N,) [s], within the group.
        residual: shape (N,) [Nm], before the effect is added.
        signature: shape (N,) [Nm], part explained by the effect.
    """

    joint: str
    groups: tuple[tuple[str, int, int], ...]
    time: Floats
    residual: Floats
    signature: Floats


@dataclass(frozen=True, eq=False, kw_only=True, config=RECORD)
class Finding(CandidateEffect):
    """A candidate for the missing effect; what documents have of it is in `CandidateEffect`.

    Attributes:
        gain: decrease of the objective when it is added.
        evidence: explained part of the residual; None for candidates that were not added.
        features: input of the confidence (`confidence.features`).
        law: its law through the data, in the last model; None for candidates that were not added.
    """

    gain: float = 0.0
    evidence: Evidence | None = None
    features: tuple[float, ...] = ()
    law: LawThroughData | None = None

    def to_dict(self) -> dict[str, Any]:
        """One entry of the contract's `candidates`."""
        return TypeAdapter(CandidateEffect).dump_python(self, mode="json")


@dataclass(frozen=True, eq=False, config=RECORD)
class Step(StepEntry):
    """One step of the diagnosis, with the effect that it adds and its `model`."""

    added: Finding | None = None
    model: FlexibleModel | None = None


@std_dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Diagnosis(DiagnosisFields):
    """The result of one diagnosis; what documents have under the same name is in `DiagnosisFields`.

    Attributes:
        verdict, findings: "missing", "nothing-missing" or "unknown", and ranked candidates, for the set's own
            model.
        steps: initial model, then one step per added effect.
        effects, parameters, model: the final model.
        seconds: wall time.
        notes: they accompany the verdict.
        guard: result of the bandwidth check; None if not run.
        torque_spread: standard deviation of each joint's recorded torque [Nm]; empty if unknown.
    """

    set_name: str
    verdict: Verdict
    findings: tuple[Finding, ...]
    steps: tuple[Annotated[Step, Once()], ...]
    effects: tuple[EffectEntry, ...]
    parameters: tuple[ParameterEstimate, ...]
    seconds: float
    notes: tuple[Note, ...] = ()
    model: FlexibleModel | None = None
    guard: BandwidthCheck | None = None
    torque_spread: tuple[float, ...] = ()

    def __getitem__(self, key: str | tuple[str, str | None]) -> ParameterEstimate:
        """A parameter of the final model by name and joint: `diagnosis["stiffness", "joint1"]`.

        Raises:
            ParameterNotFound: unknown name or joint, with suggestions (a FlexvizError and KeyError).
        """
        return find_parameter(self.parameters, key)

    def __repr__(self) -> str:
        found = "".join(f", {finding.text}" for finding in self.findings[:1])
        return f"<Diagnosis of {self.set_name}: {self.verdict}{found}>"

    @property
    def typed_notes(self) -> tuple[Note, ...]:
        """The notes, under their name in a results document."""
        return self.notes

    def summary(self, width: int = 140) -> str:
        """Verdict, candidates, steps and notes as text."""
        return self.document().summary(width)

    def _repr_html_(self) -> str:
        return self.document()._repr_html_()

    @property
    def plot(self) -> DiagnosisPlots:
        """Figures: `plot.staircase()`, `plot.law("coulomb_friction", joint="joint2")`, `plot.residual()`."""
        return DiagnosisPlots(self)

    def to_frame(self) -> DataFrame:
        """The final model's parameters as a table of pandas; MissingPackage if that is not installed."""
        return parameter_frame(self.parameters)

    def to_dict(self, *, steps: bool = True) -> dict[str, Any]:
        """The `diagnose --json` document; `steps=False` as without `--apply`."""
        document = self.document().to_dict()
        if not steps:
            del document["steps"]
        return document

    def document(self) -> ResultDocument:
        """The result as a document for files."""
        shares = found_shares(self)

        def told(finding: Finding) -> Finding:
            return replace(finding, share=shares.get(finding_key(finding)))

        def physical(finding: Finding) -> Finding:
            return replace(finding, confidence=math.nan) if finding.stopgap else finding

        known: dict[str, Any] = {"torque_side": torque_side(self.parameters)} if self.parameters else {}
        if self.model is not None and self.torque_spread:
            known["torque"] = TorqueEntry(self.model.joints, self.torque_spread, self.steps[0].units)
        return ResultDocument(
            format=1,
            set=self.set_name,
            verdict=self.verdict,
            candidates=tuple(sorted(map(told, self.findings), key=lambda one: -(one.share or 0.0))),
            steps=tuple(replace(s, added=s.added and physical(told(s.added))) for s in self.steps),
            model=ModelEntry(self.effects, self.parameters),
            guard=self.guard and GuardEntry.of(self.guard),
            seconds=self.seconds,
            **shared_fields(self, DiagnosisFields),
            **note_entries(self.notes),
            **curve_entries(self.parameters),
            **known,
        )
