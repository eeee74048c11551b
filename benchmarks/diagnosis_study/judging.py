"""What counts as right: the rules by which a diagnosis is scored."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.diagnosis_study.answers import (
    COMPLETE,
    DECIDABLE,
    NOTHING,
    Answer,
    Json,
    effect_text,
    library_effects,
    read_answer,
    same,
    stated_confidence,
    value_errors,
    value_pairs,
)


@dataclass(frozen=True)
class Stated:
    """A finding as stated: how sure, of its family where members tie; whether it was right; features."""

    confidence: float
    right: bool
    features: tuple[float, ...] = ()


@dataclass(frozen=True)
class Estimate:
    """A joint's stiffness or motor inertia: |found / true − 1|, and that in standard errors."""

    name: str
    joint: int
    error: float
    deviation: float


@dataclass(frozen=True)
class Judged:
    """One case, and what was said of it.

    Attributes:
        case, kind, robot, noise: of the case.
        truth: the hidden effects as the truth file has them.
        chi: largest mean square of the whitened residual of a fit that knows the truth, over joints.
        gain, gains: of a fit that knows the truth, in all and for each effect, in χ².
        verdict: for the model the set starts with; "error" when there was no answer.
        named: the first named effect and its joint; NOTHING or UNKNOWN when none was named.
        first_right: the first named effect is a hidden one.
        all_found, extra: every hidden effect was added; names of what was added besides.
        right: right in every respect.
        parameter_errors: "effect.parameter" → |found / true − 1| in the final model.
        knowing_errors: the same of the fit that knows the truth.
        deviations: "effect.parameter" → |found − true| in the standard errors that are stated with it.
        base: stiffnesses and motor inertias, where nothing is missing in the end.
        held_out: final held-out error over that of the fit that knows the truth, minus one, or None.
        stated: findings with their confidence: the first named, then what was added later.
        wall, cpu: seconds of the diagnosis.
        answer: in words.
    """

    case: str
    kind: str
    robot: str
    noise: float
    truth: tuple[Json, ...]
    chi: float
    gain: float
    gains: tuple[float, ...]
    verdict: str
    named: tuple[str, str | None]
    first_right: bool
    all_found: bool
    extra: tuple[str, ...]
    right: bool
    parameter_errors: dict[str, float]
    knowing_errors: dict[str, float]
    deviations: dict[str, float]
    base: tuple[Estimate, ...]
    held_out: float | None
    stated: tuple[Stated, ...]
    wall: float
    cpu: float
    answer: str

    @property
    def decidable(self) -> bool:
        """Whether a fit that knows the truth gains enough in all."""
        return self.gain >= DECIDABLE

    @property
    def each_decidable(self) -> bool:
        """Whether every hidden effect gains enough by itself, the others being known."""
        return min(self.gains, default=self.gain) >= DECIDABLE


def judge(truth: Json, known: Json, result: Json) -> Judged:
    """One case: its truth, the fit that knows it, and the diagnosis."""
    got = result.get("diagnosis")
    if got is None:
        return _judged(truth, known, result, "error", (NOTHING, None), answer=f"error: {result.get('error')}")
    library, answer = library_effects(truth), read_answer(truth, got)
    effects = got["model"]["effects"]
    return _judged(
        truth, known, result, answer.verdict, answer.named,
        first_right=answer.first_right, all_found=all(answer.found),
        extra=tuple(map(effect_text, answer.extra)), right=answer.right,
        parameter_errors=value_errors(library, effects),
        deviations=_deviations(library, effects),
        base=_base(truth, got["model"]["parameters"]) if answer.final == COMPLETE else (),
        stated=_stated(answer, result["features"], library),
        answer=answer.words,
    )  # fmt: skip


def _judged(
    truth: Json, known: Json, result: Json, verdict: str, named: tuple[str, str | None], **more: Any
) -> Judged:
    library = library_effects(truth)
    values: Json = {"first_right": False, "all_found": False, "extra": (), "right": False, "answer": ""}
    values |= {"parameter_errors": {}, "deviations": {}, "base": (), "stated": ()}
    errors, best = result.get("errors"), known.get("errors")
    return Judged(
        case=truth["case"],
        kind=truth["kind"],
        robot=truth["robot"],
        noise=truth["noise_scale"],
        truth=tuple(truth["effects"]),
        chi=max(known["chi"]),
        gain=known["gain"],
        gains=tuple(known["gains"]),
        verdict=verdict,
        named=named,
        knowing_errors=value_errors(library, known["effects"]),
        held_out=None
        if not errors or not best
        else float(np.linalg.norm(errors) / np.linalg.norm(best)) - 1.0,
        wall=result.get("wall", float("nan")),
        cpu=result.get("cpu", float("nan")),
        **(values | more),
    )


def _stated(answer: Answer, features: list[list[float]], library: list[Json]) -> tuple[Stated, ...]:
    """What was added, in its order; nothing where the first was not named."""
    if answer.first is None:
        return ()
    rows = [(stated_confidence(a), a, tuple(f)) for a, f in zip(answer.added, features, strict=True)]
    return tuple(Stated(p, any(same(a, t) for t in library), f) for p, a, f in rows if p is not None)


def _deviations(library: list[Json], effects: list[Json]) -> dict[str, float]:
    return {key: abs(found - true) / std for key, true, found, std in value_pairs(library, effects) if std}


def _base(truth: Json, parameters: list[Json]) -> tuple[Estimate, ...]:
    out = []
    for found in parameters:
        if found["name"] in ("stiffness", "motor_inertia") and found["std"]:
            joint = truth["joints"].index(found["joint"])
            true = truth[found["name"]][joint]
            off = abs(found["value"] - true)
            out.append(Estimate(found["name"], joint, off / true, off / found["std"]))
    return tuple(out)
