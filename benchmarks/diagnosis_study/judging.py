"""What counts as right: the rules by which a diagnosis is scored."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.diagnosis_study.cases import TWINS
from flexviz.effects import EFFECTS

Json = dict[str, Any]

DECIDABLE = 300.0  # χ² that a fit that knows the truth gains at least
JOINTLESS = {name for name, effect in EFFECTS.items() if effect.scope in ("set", "payload")}
SIGNLESS = {"amplitude"}  # a sign change is a phase of π
NOTHING, UNKNOWN = "nothing", "unknown"


@dataclass(frozen=True)
class Stated:
    """A finding as it was stated.

    Attributes:
        confidence: that it is right; of its family where the members tie.
        right: whether it was.
        features: what it gains, the standard error of that [nats], and 1 where a model error is left.
    """

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


def same(found: Json, true: Json) -> bool:
    """Whether it is the true effect in its place, or one of the same family that is reported as tied."""
    jointless = true["effect"] in JOINTLESS or found["effect"] in JOINTLESS
    joint_right = jointless or found.get("joint") == true["joint"]
    if found["effect"] == true["effect"]:
        same_payload = found.get("payload") == true["payload"]
        return joint_right and (same_payload or EFFECTS[true["effect"]].scope != "payload")
    tied = any(tie["effect"] == true["effect"] for tie in found.get("inseparable_from", []))
    family = found.get("family")
    together = bool(family) and family["tied"] and true["effect"] in family["members"]
    twins = frozenset((found["effect"], true["effect"])) in TWINS
    return tied and joint_right and (together or twins)


def stated_confidence(added: Json) -> float | None:
    """How sure a finding is stated to be: of the family, where its members tie; None if it is not stated."""
    family = added.get("family")
    return family["confidence"] if family and family["tied"] else added.get("confidence")


def judge(truth: Json, known: Json, result: Json) -> Judged:
    """One case: its truth, the fit that knows it, and the diagnosis."""
    hidden = truth["effects"]
    library = [e for e in hidden if e["effect"] != "unknown"]
    got = result.get("diagnosis")
    if got is None:
        return _judged(truth, known, result, "error", (NOTHING, None), answer=f"error: {result.get('error')}")
    verdict, steps, candidates = got["verdict"], got.get("steps") or [], got["candidates"]
    added = [s["added"] for s in steps if s.get("added")]
    final = steps[-1]["verdict"] if steps else verdict
    extra = [a for a in added if not any(same(a, t) for t in library) and a["effect"] not in truth["base"]]
    found = all(any(same(a, t) for a in added) for t in library)
    first = candidates[0] if candidates and verdict == "missing" else None
    named = (
        (first["effect"], first["joint"]) if first else (UNKNOWN if verdict == "unknown" else NOTHING, None)
    )
    first_right = first is not None and any(same(first, t) for t in library)
    if not hidden:
        right = verdict == "nothing-missing" and not added
    elif not library:
        places = got.get("where") or [{}]
        right = "unknown" in (verdict, final) and places[0].get("joint") == hidden[0]["joint"]
    else:
        right = verdict == "missing" and first_right and found and not extra and final == "nothing-missing"
    words = [verdict, *(_text(a) for a in added)]
    if final != verdict:
        words.append(f"then {final}")
    if "unknown" in (verdict, final) and got.get("where"):
        words.append("at {joint}, {variable}".format(**got["where"][0]))
    return _judged(
        truth, known, result, verdict, named,
        first_right=first_right, all_found=found, extra=tuple(map(_text, extra)), right=right,
        parameter_errors=_errors(library, got["model"]["effects"]),
        deviations=_deviations(library, got["model"]["effects"]),
        base=_base(truth, got["model"]["parameters"]) if final == "nothing-missing" else (),
        stated=_stated(first, added, result["features"], library),
        answer=", ".join(words),
    )  # fmt: skip


def _judged(
    truth: Json, known: Json, result: Json, verdict: str, named: tuple[str, str | None], **more: Any
) -> Judged:
    library = [e for e in truth["effects"] if e["effect"] != "unknown"]
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
        knowing_errors=_errors(library, known["effects"]),
        held_out=None
        if not errors or not best
        else float(np.linalg.norm(errors) / np.linalg.norm(best)) - 1.0,
        wall=result.get("wall", float("nan")),
        cpu=result.get("cpu", float("nan")),
        **(values | more),
    )


def _stated(
    first: Json | None, added: list[Json], features: list[list[float]], library: list[Json]
) -> tuple[Stated, ...]:
    """What was added, in its order; nothing where the first was not named."""
    if first is None:
        return ()
    rows = [(stated_confidence(a), a, tuple(f)) for a, f in zip(added, features, strict=True)]
    return tuple(Stated(p, any(same(a, t) for t in library), f) for p, a, f in rows if p is not None)


def _pairs(library: list[Json], effects: list[Json]) -> Iterator[tuple[str, float, float, float | None]]:
    """(effect.parameter, true value, found value, its standard error); both sizes where no sign counts."""
    for true in library:
        for found in effects:
            place = ("joint", "payload")
            if found["effect"] != true["effect"] or any(found.get(k) != true.get(k) for k in place):
                continue
            for name, value in true["parameters"].items():
                entry = found["parameters"].get(name)
                if entry is None or not value or name == "order":
                    continue
                number, std = (entry["value"], entry["std"]) if isinstance(entry, dict) else (entry, None)
                if name in SIGNLESS:
                    value, number = abs(value), abs(number)
                yield f"{true['effect']}.{name}", value, number, std


def _errors(library: list[Json], effects: list[Json]) -> dict[str, float]:
    return {key: abs(found / true - 1.0) for key, true, found, _ in _pairs(library, effects)}


def _deviations(library: list[Json], effects: list[Json]) -> dict[str, float]:
    return {key: abs(found - true) / std for key, true, found, std in _pairs(library, effects) if std}


def _base(truth: Json, parameters: list[Json]) -> tuple[Estimate, ...]:
    out = []
    for found in parameters:
        if found["name"] in ("stiffness", "motor_inertia") and found["std"]:
            joint = truth["joints"].index(found["joint"])
            true = truth[found["name"]][joint]
            off = abs(found["value"] - true)
            out.append(Estimate(found["name"], joint, off / true, off / found["std"]))
    return tuple(out)


def _text(effect: Json) -> str:
    place = effect.get("joint") or effect.get("payload")
    return effect["effect"] + (f":{place}" if place else "")
