"""One result against the truth of its set: the same few figures for every class.

Few hidden effects are judged by the rules of `benchmarks.diagnosis_study`, many by those of
`benchmarks.robotlike_study`. No fit that knows the truth is made, so effects that no method could see count
as missed, unless the truth says that they are weak. Of a recorded robot nothing is known but its errors.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

from benchmarks.diagnose_command import Json
from benchmarks.diagnosis_study.answers import (
    COMPLETE,
    UNKNOWN,
    effect_text,
    held_out_ratio,
    library_effects,
    read_answer,
    same,
    stated_confidence,
    value_errors,
)
from benchmarks.diagnosis_study.making import UNSCORED
from benchmarks.measuring_stick.sets import CLASSES, MANY, RECORDED, StickSet
from benchmarks.robotlike_study.judging import matches, score
from flexviz.effects import free_curve


@dataclass(frozen=True)
class Judgement:
    """What one command said of one set. None: not asked there, or no answer.

    Attributes:
        error: why there was no answer.
        must: effects that have to be found.
        missed: those that were not.
        false: what was added and is not hidden; an imitation of a law that no library has is not counted.
        verdict: the last one.
        verdict_right: with a few hidden effects also the first one.
        first_right: the first candidate is a hidden effect.
        right: all that must be is found, nothing is false, and the verdict is right.
        held_out: held-out error of the last step over that of the first.
        value_errors: |found / true − 1| of the parameters of effects found by name.
        stated: (confidence, whether right) of what was added.
        added: in words.
        cpu, wall: [s].
        peak: [MB].
    """

    error: str | None
    must: tuple[str, ...]
    missed: tuple[str, ...]
    false: tuple[str, ...]
    verdict: str | None
    verdict_right: bool | None
    first_right: bool | None
    right: bool | None
    held_out: float | None
    value_errors: tuple[float, ...]
    stated: tuple[tuple[float, bool], ...]
    added: tuple[str, ...]
    cpu: float
    wall: float
    peak: float

    @property
    def said(self) -> tuple[object, ...]:
        """What two commands may differ in."""
        places = tuple(sorted(self.missed)), tuple(sorted(self.false)), tuple(sorted(self.added))
        return self.error is None, self.verdict, self.first_right, *places


def judge(one: StickSet, result: Json) -> Judgement:
    """The judgement of a set's result."""
    truth = json.loads(one.truth.read_text(encoding="utf-8")) if one.truth else None
    how, got = CLASSES[one.kind], result.get("diagnosis")
    if how == RECORDED or truth is None:
        rest = _without_answer(()) if got is None else _recorded(got)
    elif how == MANY:
        rest = _many(truth, result)
    else:
        rest = _few(truth, got)
    cost = {"cpu": result["cpu"], "wall": result["wall"], "peak": result["peak_mb"]}
    error = None if got is not None else str(result.get("error", "no answer"))
    steps = (got or {}).get("steps") or []
    added = tuple(effect_text(s["added"]) for s in steps if s.get("added"))
    return Judgement(error=error, held_out=held_out_ratio(steps), added=added, **rest, **cost)


def _without_answer(must: tuple[str, ...]) -> Json:
    """No answer is a wrong one."""
    asked = {"must": must, "missed": must, "verdict_right": False, "first_right": False if must else None}
    return asked | {"right": False, "verdict": None, "false": (), "value_errors": (), "stated": ()}


def _recorded(got: Json) -> Json:
    steps = got.get("steps") or []
    return {
        "must": (), "missed": (), "false": (), "verdict": steps[-1]["verdict"] if steps else got["verdict"],
        "verdict_right": None, "first_right": None, "right": None, "value_errors": (), "stated": (),
    }  # fmt: skip


def _few(truth: Json, got: Json | None) -> Json:
    library, weak = library_effects(truth), bool(truth.get("weak"))
    asked = [] if weak else library
    must = tuple(map(effect_text, asked))
    if got is None:
        return _without_answer(must)
    answer = read_answer(truth, got)
    foreign = {e["joint"] for e in truth["effects"] if e["effect"] == UNKNOWN}
    if library:
        verdict_right = answer.verdict_right
    elif foreign:
        verdict_right = UNKNOWN in (answer.verdict, answer.final)
    else:
        verdict_right = answer.verdict == COMPLETE
    errors = value_errors(library, got["model"]["effects"])
    stated = [(stated_confidence(a), any(same(a, t) for t in library)) for a in answer.added]
    found = [t for t, hit in zip(library, answer.found, strict=True) if hit]
    return {
        "must": must,
        "missed": tuple(effect_text(t) for t in asked if t not in found),
        "false": tuple(effect_text(a) for a in answer.extra if a.get("joint") not in foreign),
        "verdict": answer.final,
        "verdict_right": None if weak else verdict_right,
        "first_right": answer.first_right if asked else None,
        "right": None if weak else answer.right,
        "value_errors": tuple(e for key, e in errors.items() if key.split(".")[1] not in UNSCORED),
        "stated": tuple((p, right) for p, right in stated if p is not None),
    }


def _many(truth: Json, result: Json) -> Json:
    scored, got = score(truth, result), result.get("diagnosis")
    must = tuple(effect_text({"effect": e.effect, "joint": e.joint}) for e in scored.must)
    if got is None:
        return _without_answer(must)
    missed = [e for e in scored.must if not e.found]
    first = got["candidates"][:1]
    curved = {e["joint"] for e in truth["effects"] if e["effect"] == UNKNOWN}
    named = [c for c in first if free_curve(c["effect"]) is None or c.get("joint") not in curved]
    return {
        "must": must,
        "missed": tuple(effect_text({"effect": e.effect, "joint": e.joint}) for e in missed),
        "false": tuple(effect_text({"effect": a.effect, "joint": a.joint}) for a in scored.false),
        "verdict": scored.last,
        "verdict_right": scored.last_right,
        "first_right": any(matches(e, c) for e in library_effects(truth) for c in named) if must else None,
        "right": not missed and not scored.false and scored.last_right,
        "value_errors": tuple(error for _, error in scored.parameter_errors),
        "stated": tuple((a.confidence, a.right) for a in scored.additions if a.confidence is not None),
    }
