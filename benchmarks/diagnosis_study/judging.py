"""What counts as right: a diagnosis against what is hidden in its set.

With few hidden effects each must be found, unless the truth says that it is weak: on its joint or payload, or
tied with what was found there and of its family. With many, an effect must be found if its rms torque on the
held-out motion is at least 3 % of the spread of its joint's torque, by name or as its twin on that joint:
motor and link Coulomb friction, which stiff joints cannot tell apart, or spring and offset, as the rest angle
of a spring is an offset. What the final model has besides is false, unless it stands on a joint with an
unmodelled torque: there it is an imitation, counted apart and wrong for the calibration. A free curve claims
only that such a torque acts on its joint, and is false where none does. Of a recorded robot nothing is known
but its errors.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from benchmarks.diagnosis_study.cases import TWINS
from benchmarks.diagnosis_study.making import UNSCORED
from benchmarks.running import Json
from flexviz.base.statistics import NORMAL_95
from flexviz.model.effects import EFFECTS, free_curve

MUST = 0.03  # share from which on one of many effects must be found
JOINTLESS = {name for name, effect in EFFECTS.items() if effect.scope in ("set", "payload")}
SIGNLESS = {"amplitude"}  # a sign change is a phase of π
ALIKE = {
    frozenset(("coulomb_friction", "link_coulomb_friction")),
    frozenset(("torque_offset", "cable_spring")),
}
NOTHING, UNKNOWN = "nothing", "unknown"
COMPLETE, MISSING = "nothing-missing", "missing"


@dataclass(frozen=True)
class Hidden:
    """An effect of the library that a set hides.

    Attributes:
        name: with its joint or payload.
        must, found: whether it is demanded, and whether the final model has it.
    """

    effect: str
    name: str
    must: bool
    found: bool


@dataclass(frozen=True)
class Addition:
    """An effect of the final model that the set's model has not.

    Attributes:
        name: with its joint or payload.
        confidence: as stated, of its family where members tie; None if none is stated.
        right: whether it is hidden there.
        imitation: whether it is wrong and stands on a joint with an unmodelled torque.
    """

    effect: str
    name: str
    confidence: float | None
    right: bool
    imitation: bool


@dataclass(frozen=True)
class Value:
    """A value of the final model beside its truth; `std` None where no standard error is stated."""

    name: str
    true: float
    found: float
    std: float | None

    @property
    def error(self) -> float:
        """Relative."""
        return abs(self.found / self.true - 1.0)

    @property
    def covered(self) -> bool | None:
        """Whether the stated 95 % interval contains the truth."""
        return abs(self.found - self.true) < NORMAL_95 * self.std if self.std else None


@dataclass(frozen=True)
class Judgement:
    """What was said of one set.

    Attributes:
        robot: of the set; "" if it is recorded.
        error: why there was no answer.
        asked: whether right and wrong count: neither of a recorded robot nor of what is too weak.
        laws: kinds of the unmodelled torques that must be noticed.
        verdict, last: for the model that the set starts with, and for the last one.
        named: the first candidate and its joint; NOTHING or UNKNOWN without one.
        verdict_right: the last verdict; with few hidden effects also the first one.
        first_right: the first candidate is hidden.
        right: all that must be is found, nothing is false, and the verdicts are right.
        held_out: held-out error of the last step over that of the first, norm over joints.
        values: of the effects that must be found and were, by name; of stiffness and motor inertia of each
            joint where nothing is missing in the end.
        wall, cpu: [s].
        peak: largest resident memory [MB].
    """

    case: str
    robot: str
    error: str | None
    asked: bool
    hidden: tuple[Hidden, ...]
    laws: tuple[str, ...]
    additions: tuple[Addition, ...]
    verdict: str | None
    last: str | None
    named: tuple[str, str | None]
    verdict_right: bool
    first_right: bool
    right: bool
    held_out: float | None
    values: tuple[Value, ...]
    wall: float
    cpu: float
    peak: float

    @property
    def must(self) -> list[str]:
        """The effects that must be found."""
        return [e.name for e in self.hidden if e.must]

    @property
    def missed(self) -> list[str]:
        """Those of them that were not."""
        return [e.name for e in self.hidden if e.must and not e.found]

    @property
    def false(self) -> list[str]:
        """What was added and is not hidden, imitations apart."""
        return [a.name for a in self.additions if self.robot and not (a.right or a.imitation)]

    @property
    def imitations(self) -> list[str]:
        """What was added on joints with an unmodelled torque, and is not hidden there."""
        return [a.name for a in self.additions if a.imitation]

    @property
    def effect_errors(self) -> list[float]:
        """Relative errors of the effects' values."""
        return [value.error for value in self.values if "." in value.name]

    @property
    def said(self) -> tuple[object, ...]:
        """What two commands may differ in."""
        places = sorted(self.missed), sorted(self.false), sorted(a.name for a in self.additions)
        return self.error is None, self.last, self.first_right, *places

    @property
    def words(self) -> str:
        """In a line."""
        if self.error is not None:
            return f"no answer ({self.error.splitlines()[-1]})"
        lists = {"added": [a.name for a in self.additions], "missed": self.missed}
        lists |= {"false": self.false, "imitations": self.imitations, "unmodelled": list(self.laws)}
        wrong = " (wrong)" if self.asked and not self.verdict_right else ""
        out = [f"{self.verdict}, last {self.last}{wrong}"]
        return "; ".join(out + [f"{name} {', '.join(items)}" for name, items in lists.items() if items])


def judge(truth: Json | None, result: Json, many: bool = False) -> Judgement:
    """One result against the truth of its set, None of a recorded robot; `many`: it hides many effects."""
    got, given = result.get("diagnosis") or {}, truth or {"effects": []}
    library = [e for e in given["effects"] if e["effect"] != UNKNOWN]
    laws = [e for e in given["effects"] if e["effect"] == UNKNOWN]
    demanded = [e for e in laws if e.get("share", 1.0) >= MUST]
    steps, final = got.get("steps") or [], got.get("model", {}).get("effects", [])
    added = {_place(e): e for e in (*final, *(s["added"] for s in steps if s.get("added")))}
    kept = [added[_place(e)] for e in final if e["effect"] not in given.get("base", ())]
    match = alike if many else same
    hidden = [
        Hidden(e["effect"], effect_text(e), _must(given, e), any(match(a, e) for a in kept)) for e in library
    ]
    curved, foreign = {e["joint"] for e in laws}, {e["joint"] for e in demanded}
    candidates = got.get("candidates", [])
    additions = []
    for a in kept:
        right = any(match(a, e) for e in library)
        stated = [stated_confidence(c) for c in (a, *candidates[:1]) if _place(c) == _place(a)]
        confidence = next((p for p in stated if p is not None), None)
        one = Addition(a["effect"], effect_text(a), confidence, right, not right and a["joint"] in foreign)
        if free_curve(one.effect) is None or a["joint"] not in curved:
            additions.append(one)
    verdict = got.get("verdict")
    last = steps[-1]["verdict"] if steps else verdict
    first = candidates[0] if candidates and verdict == MISSING else None
    first_right = first is not None and any(match(first, e) for e in library)
    wrong = any(e.must and not e.found for e in hidden) or any(
        not (a.right or a.imitation) for a in additions
    )
    said = (verdict, last)
    if many:
        verdict_right = last == (UNKNOWN if demanded else COMPLETE)
        right = verdict_right and not wrong
    elif library:
        verdict_right = said == (MISSING, COMPLETE)
        right = verdict_right and first_right and all(e.found for e in hidden) and not wrong
    elif laws:
        verdict_right = UNKNOWN in said
        where = (got.get("where") or [{}])[0].get("joint")
        right = verdict_right and where == laws[0]["joint"]
    else:
        verdict_right = verdict == COMPLETE
        right = verdict_right and not additions
    return Judgement(
        case=given.get("case", ""),
        robot=given.get("robot", ""),
        error=None if got else str(result.get("error", "no answer")),
        asked=truth is not None and not given.get("weak"),
        hidden=tuple(hidden),
        laws=tuple(e.get("kind", UNKNOWN) for e in demanded),
        additions=tuple(additions),
        verdict=verdict,
        last=last,
        named=(first["effect"], first["joint"])
        if first
        else (UNKNOWN if verdict == UNKNOWN else NOTHING, None),
        verdict_right=verdict_right,
        first_right=first_right,
        right=right,
        held_out=held_out_ratio(steps),
        values=(
            *effect_values([e for e in library if e.get("share", 1.0) >= MUST], final),
            *(_motor_side(given, got["model"].get("parameters", [])) if last == COMPLETE else ()),
        ),
        wall=result.get("wall", float("nan")),
        cpu=result.get("cpu", float("nan")),
        peak=result.get("peak_mb", float("nan")),
    )


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


def alike(found: Json, true: Json) -> bool:
    """Whether it is the true effect or its twin, on the same joint."""
    if true["joint"] != found.get("joint"):
        return False
    return true["effect"] == found["effect"] or frozenset((true["effect"], found["effect"])) in ALIKE


def stated_confidence(added: Json) -> float | None:
    """How sure a finding is stated to be: of the family, where its members tie; None if it is not stated."""
    family = added.get("family")
    return family["confidence"] if family and family["tied"] else added.get("confidence")


def effect_values(library: list[Json], effects: list[Json]) -> Iterator[Value]:
    """Values of effects found by name: both sizes where no sign counts, no offset beside a spring."""
    springs = {e["joint"] for e in (*library, *effects) if e["effect"] == "cable_spring"}
    for true in library:
        if true["effect"] == "torque_offset" and true["joint"] in springs:
            continue
        for found in effects:
            if _place(found)[:2] != _place(true)[:2] or found.get("payload") != true.get("payload"):
                continue
            for name, value in true["parameters"].items():
                entry = found.get("parameters", {}).get(name)
                if entry is None or not value or name in UNSCORED or name == "order":
                    continue
                number, std = (entry["value"], entry["std"]) if isinstance(entry, dict) else (entry, None)
                if name in SIGNLESS:
                    value, number = abs(value), abs(number)
                yield Value(f"{true['effect']}.{name}", value, number, std)


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


def _must(truth: Json, effect: Json) -> bool:
    return not truth.get("weak") and effect.get("share", 1.0) >= MUST


def _place(effect: Json) -> tuple[str, str | None, str | None, str | None]:
    return effect["effect"], effect.get("joint"), effect.get("group"), effect.get("payload")


def _motor_side(truth: Json, parameters: list[Json]) -> Iterator[Value]:
    for found in parameters:
        if found["name"] in truth and found["name"] in ("stiffness", "motor_inertia") and found["std"]:
            joint = truth["joints"].index(found["joint"])
            name = f"{truth['robot']} joint {joint + 1}: {found['name'].replace('_', ' ')}"
            yield Value(name, truth[found["name"]][joint], found["value"], found["std"])
