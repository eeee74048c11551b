"""The result of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.records import BandwidthCheck, FreeCurve, ResidualMap
from flexviz.identification import ParameterEstimate
from flexviz.model import EffectValue, FlexibleModel
from flexviz.results import CandidateEntry, Note, ResultDocument, Verdict, find_parameter, note_entries

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Tie:
    """Another effect that the data hardly tell from this one.

    Attributes:
        effect, joint: which one.
        correlation: of the two signatures, once everything the model can do by itself is taken out.
        breaks: a sentence: the motion or payload in which the two differ most; empty where nothing is known.
    """

    effect: str
    joint: str | None
    correlation: float
    breaks: str = ""


@dataclass(frozen=True)
class Absorbed:
    """A parameter that had taken up the effect: it moved when the effect was added.

    Attributes:
        name, joint: as in the JSON contract.
        before, after: its value [unit].
        deviations: the change in standard errors.
    """

    name: str
    joint: str | None
    before: float
    after: float
    unit: str
    deviations: float


@dataclass(frozen=True, eq=False)
class Evidence:
    """What an effect takes from the residual of its joint.

    Attributes:
        joint: where it is seen best.
        groups: (name, first row, row after the last) of each.
        time: shape (N,) [s], each group's own.
        residual: shape (N,) [Nm], before the effect is added.
        signature: shape (N,) [Nm], what the effect takes away.
    """

    joint: str
    groups: tuple[tuple[str, int, int], ...]
    time: Array
    residual: Array
    signature: Array


class EffectParameter(NamedTuple):
    """A parameter of an effect: value, standard error (None where it is not known), unit."""

    value: float
    std: float | None
    unit: str


@dataclass(frozen=True, eq=False)
class Finding:
    """One candidate for what is missing.

    Attributes:
        effect, joint, group, payload: which effect, where.
        score: share of the excess held-out variance that it removes after refitting.
        confidence: probability that it is the right one.
        parameters: name → value, standard error and unit.
        inseparable_from: what the data cannot tell from it.
        gain: fall of the objective when it is added.
        absorbed: parameters that had taken it up, the largest change first.
        evidence: what it takes from the residual; None where it was not refitted to the end.
        features: what the confidence was computed from (`confidence.features`).
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

    def __post_init__(self) -> None:
        named = {name: EffectParameter(*value) for name, value in self.parameters.items()}
        object.__setattr__(self, "parameters", named)

    @property
    def text(self) -> str:
        """As it is named on the command line: `name:joint`, `name:payload`, `name:joint@group`."""
        return EffectValue(self.effect, self.joint, {}, self.group, self.payload).text

    def to_dict(self) -> dict[str, Any]:
        """One entry of the contract's `candidates`."""
        return CandidateEntry.model_validate(self).model_dump(mode="json", exclude_unset=True)


@dataclass(frozen=True)
class ResidualLocation:
    """Where the residual lives: a joint and a variable that explains a share of it out of sample."""

    joint: str
    variable: str
    explained: float
    range: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Step:
    """The model after one more effect, and what is missing then.

    Attributes:
        added: the effect; None for the model the diagnosis starts with.
        rms, rms_validation: per joint, over the fit and the validation groups [Nm].
        verdict: "missing", "nothing-missing" or "unknown".
        groups: (name, rms per joint [Nm], whether it is held out) of every group.
        noise_floor: per joint, what measurement noise alone leaves [Nm].
        model: with the values of this step.
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
        set_name: the measurement set.
        verdict: "missing", "nothing-missing" or "unknown", for the model the set starts with.
        findings: ranked candidates for that model.
        where: where the final model's residual lives.
        steps: the staircase.
        effects: the final model's effects with their values.
        parameters: the final model's parameters.
        seconds: wall time.
        stopped: the user stopped it; what was found so far is here.
        notes: what else a reader should know.
        model: the final model.
        maps: its residual against each variable, joint by joint.
        free_curve: where something unknown is left, a curve for it, as a stopgap.
        guard: what moves with the observer's bandwidth; None where that was not looked at.
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

    def __getitem__(self, key: str | tuple[str, str | None]) -> ParameterEstimate:
        """A parameter of the final model by name and joint: `diagnosis["stiffness", "joint1"]`.

        Raises:
            ParameterNotFound: a FlexvizError and KeyError that suggests what was meant.
        """
        return find_parameter(self.parameters, key)

    def __repr__(self) -> str:
        found = ", ".join(finding.text for finding in self.findings[:1])
        return f"<Diagnosis of {self.set_name}: {self.verdict}{f', {found}' if found else ''}>"

    def summary(self, width: int = 140) -> str:
        """Verdict, candidates, steps and notes as text."""
        return self.document().summary(width)

    def _repr_html_(self) -> str:
        return self.document()._repr_html_()

    def to_dict(self, *, steps: bool = True) -> dict[str, Any]:
        """The contract's `diagnose --json` document; without `steps`, that of a diagnosis not applied."""
        document = self.document().to_dict()
        if not steps:
            del document["steps"]
        return document

    def document(self) -> ResultDocument:
        """The result as it is written to files."""
        return ResultDocument.model_validate(
            {
                "format": 1,
                "set": self.set_name,
                "verdict": self.verdict,
                "candidates": self.findings,
                "where": self.where,
                "steps": self.steps,
                "model": {"effects": self.effects, "parameters": self.parameters},
                **note_entries(self.notes),
                "maps": self.maps,
                "free_curve": self.free_curve,
                "guard": self.guard,
                "stopped": self.stopped,
                "seconds": self.seconds,
            }
        )
