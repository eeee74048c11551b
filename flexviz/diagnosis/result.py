"""Result of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import free_curve
from flexviz.identification import ParameterEstimate
from flexviz.laws import LawThroughData
from flexviz.model import EffectValue, FlexibleModel
from flexviz.results import (
    Absorbed,
    BandwidthCheck,
    CandidateEntry,
    Family,
    FreeCurve,
    Move,
    Note,
    ResidualLocation,
    ResidualMap,
    ResultDocument,
    Tie,
    Verdict,
    curve_entries,
    find_parameter,
    note_entries,
)
from flexviz.wording import finding_key, found_shares

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
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
    time: Array
    residual: Array
    signature: Array


class EffectParameter(NamedTuple):
    """A parameter of an effect: value, standard error (None if unknown), unit."""

    value: float
    std: float | None
    unit: str


@dataclass(frozen=True, eq=False)
class Finding:
    """A candidate for the missing effect.

    Attributes:
        effect, joint, group, payload: effect and location.
        score: share of the excess held-out variance removed after refitting.
        confidence: probability that the candidate is correct.
        parameters: name → value, standard error and unit.
        inseparable_from: effects that the data cannot distinguish from it.
        gain: decrease of the objective when it is added.
        absorbed: parameters that absorbed the effect before, the largest change first.
        evidence: explained part of the residual; None for candidates that were not added.
        features: input of the confidence (`confidence.features`).
        family: the family of effects that it belongs to; None if it belongs to none.
        share: of the held-out mean squared error, relative to each joint's torque, that it removes in the
            order in which the effects are added (`flexviz.wording.step_shares`); None if unknown.
        law: its law through the data, in the last model; None for candidates that were not added.
    """

    effect: str
    joint: str | None
    group: str | None
    payload: str | None
    score: float
    confidence: float
    parameters: dict[str, EffectParameter]
    inseparable_from: tuple[Tie, ...]
    gain: float
    absorbed: tuple[Absorbed, ...] = ()
    evidence: Evidence | None = None
    features: tuple[float, ...] = ()
    family: Family | None = None
    share: float | None = None
    law: LawThroughData | None = None

    def __post_init__(self) -> None:
        named = {name: EffectParameter(*value) for name, value in self.parameters.items()}
        object.__setattr__(self, "parameters", named)

    @property
    def text(self) -> str:
        """Name on the command line: `name:joint`, `name:payload`, `name:joint@group`."""
        return EffectValue(self.effect, self.joint, {}, self.group, self.payload).text

    @property
    def stopgap(self) -> bool:
        """Whether it is a free curve: not physics."""
        return free_curve(self.effect) is not None

    def to_dict(self) -> dict[str, Any]:
        """One entry of the contract's `candidates`."""
        return CandidateEntry.model_validate(self).model_dump(mode="json", exclude_unset=True)


@dataclass(frozen=True, eq=False)
class Step:
    """One step of the diagnosis: the model after adding an effect.

    Attributes:
        added: the effect; None for the initial model.
        rms, rms_validation, groups, noise_floor: its errors [Nm], as in `PredictionErrors`.
        verdict: "missing", "nothing-missing" or "unknown".
    """

    added: Finding | None
    rms: tuple[float, ...]
    rms_validation: tuple[float, ...] | None
    verdict: Verdict
    groups: tuple[tuple[str, tuple[float, ...], bool], ...] = ()
    noise_floor: tuple[float, ...] = ()
    model: FlexibleModel | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis:
    """The result of one diagnosis.

    Attributes:
        verdict, findings: "missing", "nothing-missing" or "unknown", and ranked candidates, for the set's own
            model.
        where: locations of what no effect explains: of the final model's residual, without free curves
            beside which it was estimated; if the place of an unknown law is known, with parameters that the
            law does not bias, like `maps` and `free_curve`.
        steps: initial model, then one step per added effect.
        effects, parameters, model: the final model.
        seconds, stopped: wall time; whether the user stopped it, with the findings so far.
        notes: they accompany the verdict.
        maps: residual of the final model against each variable, joint by joint.
        free_curve: curve of an unexplained residual, as a stopgap; None if nothing is unexplained.
        guard: result of the bandwidth check; None if not run.
        torque_spread: standard deviation of each joint's recorded torque [Nm]; empty if unknown.
        trace: the moves that the search tried, in order.
        decoys: (accepted, tried) candidates that cannot be right; None if none were tried.
    """

    set_name: str
    verdict: Verdict
    findings: tuple[Finding, ...]
    where: tuple[ResidualLocation, ...]
    steps: tuple[Step, ...]
    effects: tuple[dict[str, Any], ...]
    parameters: tuple[ParameterEstimate, ...]
    seconds: float
    stopped: bool = False
    notes: tuple[Note, ...] = ()
    model: FlexibleModel | None = None
    maps: tuple[ResidualMap, ...] = ()
    free_curve: FreeCurve | None = None
    guard: BandwidthCheck | None = None
    torque_spread: tuple[float, ...] = ()
    trace: tuple[Move, ...] = ()
    decoys: tuple[int, int] | None = None

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

        known: dict[str, Any] = {} if self.decoys is None else {"decoys": self.decoys}
        if self.model is not None and self.torque_spread:
            known["torque"] = {"joints": self.model.joints, "spread": self.torque_spread}
        return ResultDocument.model_validate(
            {
                "format": 1,
                "set": self.set_name,
                "verdict": self.verdict,
                "candidates": sorted(map(told, self.findings), key=lambda one: -(one.share or 0.0)),
                "where": self.where,
                "steps": [replace(s, added=s.added and told(s.added)) for s in self.steps],
                "model": {"effects": self.effects, "parameters": self.parameters},
                **note_entries(self.notes),
                "maps": self.maps,
                "free_curve": self.free_curve,
                **curve_entries(self.parameters),
                "guard": self.guard,
                **known,
                "trace": self.trace,
                "stopped": self.stopped,
                "seconds": self.seconds,
            }
        )
