"""What a diagnosis gives back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from flexviz.identification import ParameterEstimate


@dataclass(frozen=True)
class Tie:
    """Another effect that the data hardly tell from this one, with the correlation of their signatures."""

    effect: str
    joint: str | None
    correlation: float


@dataclass(frozen=True)
class Finding:
    """One candidate for what is missing.

    Attributes:
        effect, joint, group, payload: which effect, where.
        score: share of the excess held-out variance that it removes after refitting.
        confidence: probability that it is the right one.
        parameters: name → (value, standard error, unit).
        inseparable_from: what the data cannot tell from it.
        gain: fall of the objective when it is added.
    """

    effect: str
    joint: str | None
    group: str | None
    payload: str | None
    score: float
    confidence: float
    parameters: dict[str, tuple[float, float, str]]
    inseparable_from: tuple[Tie, ...]
    gain: float

    def to_json(self) -> dict[str, Any]:
        """One entry of the contract's `candidates`."""
        return {
            "effect": self.effect,
            "joint": self.joint,
            "group": self.group,
            "payload": self.payload,
            "score": self.score,
            "confidence": self.confidence,
            "parameters": {k: {"value": v, "std": s, "unit": u} for k, (v, s, u) in self.parameters.items()},
            "inseparable_from": [
                {"effect": t.effect, "joint": t.joint, "correlation": t.correlation}
                for t in self.inseparable_from
            ],
        }


@dataclass(frozen=True)
class Place:
    """Where the residual lives: a joint and a variable that explains a share of it out of sample."""

    joint: str
    variable: str
    explained: float
    range: tuple[float, float]


@dataclass(frozen=True)
class Step:
    """The model after one more effect (none for the first): errors in Nm, and what is missing then."""

    added: Finding | None
    rms: tuple[float, ...]
    rms_validation: tuple[float, ...] | None
    verdict: str


@dataclass(frozen=True)
class Diagnosis:
    """The answer.

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
    """

    set_name: str
    verdict: str
    findings: tuple[Finding, ...]
    where: tuple[Place, ...]
    steps: tuple[Step, ...]
    effects: tuple[dict[str, Any], ...]
    parameters: tuple[ParameterEstimate, ...]
    seconds: float
    stopped: bool = False
    notes: tuple[str, ...] = field(default=())

    def to_json(self) -> dict[str, Any]:
        """The contract's `diagnose --json` document (format 1)."""
        return {
            "format": 1,
            "set": self.set_name,
            "verdict": self.verdict,
            "candidates": [f.to_json() for f in self.findings],
            "where": [
                {"joint": p.joint, "variable": p.variable, "explained": p.explained, "range": list(p.range)}
                for p in self.where
            ],
            "steps": [
                {
                    "added": None if s.added is None else _added(s.added),
                    "rms": list(s.rms),
                    "rms_validation": None if s.rms_validation is None else list(s.rms_validation),
                    "verdict": s.verdict,
                }
                for s in self.steps
            ],
            "model": {
                "effects": list(self.effects),
                "parameters": [
                    {
                        "name": p.name,
                        "joint": p.joint,
                        "value": p.value,
                        "std": p.std if p.std < float("inf") else None,
                        "unit": p.unit,
                        "identifiable": p.identifiable,
                        "tied_to": list(p.tied_to),
                    }
                    for p in self.parameters
                ],
            },
            "stopped": self.stopped,
            "seconds": self.seconds,
        }


def _added(finding: Finding) -> dict[str, Any]:
    whole = finding.to_json()
    return {key: whole[key] for key in ("effect", "joint", "group", "payload", "inseparable_from")}
