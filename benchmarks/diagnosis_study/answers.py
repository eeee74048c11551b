"""A diagnosis against what is hidden: the rules that need nothing but the truth and the answer."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from benchmarks.diagnosis_study.cases import TWINS
from flexviz.effects import EFFECTS

Json = dict[str, Any]

DECIDABLE = 300.0  # χ² that a fit that knows the truth gains at least
JOINTLESS = {name for name, effect in EFFECTS.items() if effect.scope in ("set", "payload")}
SIGNLESS = {"amplitude"}  # a sign change is a phase of π
NOTHING, UNKNOWN = "nothing", "unknown"
COMPLETE, MISSING = "nothing-missing", "missing"


@dataclass(frozen=True)
class Answer:
    """What a diagnosis said of one case.

    Attributes:
        verdict, final: for the model the set starts with, and for the last one.
        first: the first candidate, where something is missing.
        named: the effect of that and its joint; NOTHING or UNKNOWN when none was named.
        first_right: the first named effect is a hidden one.
        added: every added effect, in order.
        found: of each hidden effect of the library, whether it was added.
        extra: what was added besides.
        right: right in every respect.
        words: the answer in words.
    """

    verdict: str
    final: str
    first: Json | None
    named: tuple[str, str | None]
    first_right: bool
    added: tuple[Json, ...]
    found: tuple[bool, ...]
    extra: tuple[Json, ...]
    right: bool
    words: str

    @property
    def verdict_right(self) -> bool:
        """Whether first and last verdict go together: something is missing, then nothing is."""
        return self.verdict == MISSING and self.final == COMPLETE


def library_effects(truth: Json) -> list[Json]:
    """The hidden effects that the library has."""
    return [e for e in truth["effects"] if e["effect"] != UNKNOWN]


def read_answer(truth: Json, got: Json) -> Answer:
    """The truth of a case and the JSON of its diagnosis."""
    hidden, library = truth["effects"], library_effects(truth)
    verdict, steps, candidates = got["verdict"], got.get("steps") or [], got["candidates"]
    added = [s["added"] for s in steps if s.get("added")]
    final = steps[-1]["verdict"] if steps else verdict
    extra = [a for a in added if not any(same(a, t) for t in library) and a["effect"] not in truth["base"]]
    found = [any(same(a, t) for a in added) for t in library]
    first = candidates[0] if candidates and verdict == MISSING else None
    first_right = first is not None and any(same(first, t) for t in library)
    places = got.get("where") or [{}]
    if not hidden:
        right = verdict == COMPLETE and not added
    elif not library:
        right = UNKNOWN in (verdict, final) and places[0].get("joint") == hidden[0]["joint"]
    else:
        right = verdict == MISSING and first_right and all(found) and not extra and final == COMPLETE
    words = [verdict, *map(effect_text, added)]
    if final != verdict:
        words.append(f"then {final}")
    if UNKNOWN in (verdict, final) and got.get("where"):
        words.append("at {joint}, {variable}".format(**places[0]))
    named = (first["effect"], first["joint"]) if first else (UNKNOWN if verdict == UNKNOWN else NOTHING, None)
    return Answer(
        verdict, final, first, named, first_right, tuple(added), tuple(found), tuple(extra), right,
        ", ".join(words),
    )  # fmt: skip


def same(found: Json, true: Json) -> bool:
    """Whether it is the true effect in its place, or one of the same family that is reported as tied."""
    ties = found.get("inseparable_from", [])
    if any((tie["effect"], tie["joint"]) == (true["effect"], true["joint"]) for tie in ties):
        found = found | {"joint": true["joint"]}
    jointless = true["effect"] in JOINTLESS or found["effect"] in JOINTLESS
    joint_right = jointless or found.get("joint") == true["joint"]
    if found["effect"] == true["effect"]:
        same_payload = found.get("payload") == true["payload"]
        return joint_right and (same_payload or EFFECTS[true["effect"]].scope != "payload")
    tied = any(tie["effect"] == true["effect"] for tie in ties)
    family = found.get("family")
    together = bool(family) and family["tied"] and true["effect"] in family["members"]
    twins = frozenset((found["effect"], true["effect"])) in TWINS
    return tied and joint_right and (together or twins)


def stated_confidence(added: Json) -> float | None:
    """How sure a finding is stated to be: of the family, where its members tie; None if it is not stated."""
    family = added.get("family")
    return family["confidence"] if family and family["tied"] else added.get("confidence")


def value_errors(library: list[Json], effects: list[Json]) -> dict[str, float]:
    """ "effect.parameter" → |found / true − 1| of effects that were found by name."""
    return {key: abs(found / true - 1.0) for key, true, found, _ in value_pairs(library, effects)}


def value_pairs(library: list[Json], effects: list[Json]) -> Iterator[tuple[str, float, float, float | None]]:
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


def held_out_ratio(steps: list[Json]) -> float | None:
    """Held-out error of the last step over that of the first, norm over joints."""
    if not steps or not steps[-1].get("rms_validation") or not steps[0].get("rms_validation"):
        return None
    first, last = (sum(x**2 for x in step["rms_validation"]) ** 0.5 for step in (steps[0], steps[-1]))
    return last / max(first, 1e-12)


def effect_text(effect: Json) -> str:
    """An effect and its joint or payload."""
    place = effect.get("joint") or effect.get("payload")
    return effect["effect"] + (f":{place}" if place else "")
