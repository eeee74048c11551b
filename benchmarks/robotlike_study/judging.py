"""What counts as right where many effects act at once.

An effect must be found if its rms torque on the held-out motion is at least 3 % of the spread of its joint's
torque. It counts as found when the final model has it, or a twin, on its joint. Twins are motor and link
Coulomb friction, which stiff joints cannot tell apart, and spring and offset, as the rest angle of a spring
is an offset. What the final model has besides is false, unless it stands on a joint with a law of no library:
there it is an imitation, counted apart. For the calibration an imitation is wrong. A free curve claims only
that some law of no library acts on its joint, and is false where none does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from benchmarks.diagnosis_study.judging import stated_confidence
from flexviz.effects import free_curve

Json = dict[str, Any]

MUST = 0.03  # share from which on an effect must be found
TWINS = {
    frozenset(("coulomb_friction", "link_coulomb_friction")),
    frozenset(("torque_offset", "cable_spring")),
}
SIGNLESS = {"amplitude"}  # a sign change is a phase of π
UNKNOWN, NOTHING = "unknown", "nothing-missing"


@dataclass(frozen=True)
class HiddenEffect:
    """An effect of the library that a set hides.

    Attributes:
        joint: None for the delay of a filtered torque.
        share: rms torque over the spread of its joint's torque.
        found: whether the final model has it or a twin.
    """

    effect: str
    joint: str | None
    share: float
    found: bool

    @property
    def must(self) -> bool:
        """Whether it is large enough to be demanded."""
        return self.share >= MUST


@dataclass(frozen=True)
class Addition:
    """An effect that a diagnosis added.

    Attributes:
        confidence: as stated, of the family where its members tie; None if none is stated.
        right: whether it or its twin is hidden on that joint.
        imitation: whether it is wrong and stands on a joint with a law of no library.
        kept: whether the final model still has it.
    """

    effect: str
    joint: str | None
    confidence: float | None
    right: bool
    imitation: bool
    kept: bool


@dataclass(frozen=True)
class Scored:
    """One case and what was said of it.

    Attributes:
        error: why there was no answer, or None.
        hidden: effects of the library.
        laws: kinds of the laws of no library that must be noticed.
        additions: in their order.
        last: the last verdict.
        held_out: held-out error of the last step over that of the first, norm over joints; None without one.
        parameter_errors: ("effect.parameter", |found / true − 1|) of effects found by name.
        wall, cpu: [s].
        peak: largest resident memory [MB].
    """

    case: str
    robot: str
    error: str | None
    hidden: tuple[HiddenEffect, ...]
    laws: tuple[str, ...]
    additions: tuple[Addition, ...]
    last: str | None
    held_out: float | None
    parameter_errors: tuple[tuple[str, float], ...]
    wall: float
    cpu: float
    peak: float

    @property
    def must(self) -> list[HiddenEffect]:
        """The effects that must be found."""
        return [e for e in self.hidden if e.must]

    @property
    def false(self) -> list[Addition]:
        """What the final model has and should not, imitations apart."""
        return [a for a in self.additions if a.kept and not a.right and not a.imitation]

    @property
    def imitations(self) -> list[Addition]:
        """What the final model has on joints with a law of no library, and is not hidden there."""
        return [a for a in self.additions if a.kept and a.imitation]

    @property
    def last_right(self) -> bool:
        """Whether the last verdict is right: unknown where there is a law of no library."""
        return self.last == (UNKNOWN if self.laws else NOTHING)


def matches(true: Json, added: Json) -> bool:
    """Whether the added effect is the hidden one, or its twin on the same joint."""
    if true["joint"] != added.get("joint"):
        return False
    return true["effect"] == added["effect"] or frozenset((true["effect"], added["effect"])) in TWINS


def score(truth: Json, result: Json) -> Scored:
    """One case: its truth, and the result of its diagnosis."""
    library = [e for e in truth["effects"] if e["effect"] != UNKNOWN]
    every_law = [e for e in truth["effects"] if e["effect"] == UNKNOWN]
    laws = [e for e in every_law if e["share"] >= MUST]
    got = result.get("diagnosis") or {}
    final = got.get("model", {}).get("effects", [])
    steps = got.get("steps") or []
    additions = _additions(library, {e["joint"] for e in laws}, got, final)
    curved = {e["joint"] for e in every_law}
    return Scored(
        case=truth["case"],
        robot=truth["robot"],
        error=None if got else result.get("error", "no answer"),
        hidden=tuple(
            HiddenEffect(e["effect"], e["joint"], e["share"], any(matches(e, a) for a in final))
            for e in library
        ),
        laws=tuple(e.get("kind", UNKNOWN) for e in laws),
        additions=tuple(a for a in additions if free_curve(a.effect) is None or a.joint not in curved),
        last=steps[-1].get("verdict") if steps else got.get("verdict"),
        held_out=_held_out(steps),
        parameter_errors=tuple(_parameter_errors(library, final)),
        wall=result.get("wall", float("nan")),
        cpu=result.get("cpu", float("nan")),
        peak=result.get("peak_mb", float("nan")),
    )


def _additions(library: list[Json], places: set[str], got: Json, final: list[Json]) -> Iterator[Addition]:
    """What was added in the steps, then what the final model has without a step of its own."""
    steps = [step["added"] for step in got.get("steps") or [] if step.get("added")]
    stated = {_place(c): stated_confidence(c) for c in reversed(got.get("candidates", [])[:1])}
    given = ((_place(a), stated_confidence(a)) for a in (*steps, *final))
    stated |= {place: sure for place, sure in given if sure is not None}
    kept = {_place(a) for a in final}
    for place in dict.fromkeys(_place(a) for a in (*steps, *final)):
        added = {"effect": place[0], "joint": place[1]}
        right = any(matches(e, added) for e in library)
        yield Addition(
            effect=place[0],
            joint=place[1],
            confidence=stated.get(place),
            right=right,
            imitation=not right and place[1] in places,
            kept=place in kept,
        )


def _place(effect: Json) -> tuple[str, str | None, str | None, str | None]:
    return effect["effect"], effect.get("joint"), effect.get("group"), effect.get("payload")


def _held_out(steps: list[Json]) -> float | None:
    if not steps or not steps[-1].get("rms_validation") or not steps[0].get("rms_validation"):
        return None
    first, last = (sum(x**2 for x in step["rms_validation"]) ** 0.5 for step in (steps[0], steps[-1]))
    return last / max(first, 1e-12)


def _parameter_errors(library: list[Json], final: list[Json]) -> Iterator[tuple[str, float]]:
    """Errors of must-find effects that were found by name; an offset beside a spring is not defined."""
    springs = {e["joint"] for e in (*library, *final) if e["effect"] == "cable_spring"}
    for true in library:
        if true["share"] < MUST or (true["effect"] == "torque_offset" and true["joint"] in springs):
            continue
        for found in final:
            if (found["effect"], found.get("joint")) != (true["effect"], true["joint"]):
                continue
            for name, value in true["parameters"].items():
                entry = found.get("parameters", {}).get(name)
                if entry is None or not value or name == "order":
                    continue
                number = float(entry["value"])
                ratio = abs(number / value) if name in SIGNLESS else number / value
                yield f"{true['effect']}.{name}", abs(ratio - 1.0)
