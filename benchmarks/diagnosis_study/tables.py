"""The tables of the study that need the fit that is given the hidden effects."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from benchmarks.diagnosis_study.cases import NOISES
from benchmarks.diagnosis_study.judging import NOTHING, UNKNOWN, Judgement, Value, effect_values, judge
from benchmarks.diagnosis_study.laws import EXTRA_LAWS
from benchmarks.diagnosis_study.sizes import SIZES
from benchmarks.running import Json
from benchmarks.tables import NONE, Table, percent, quantile, share
from flexviz.model.effects import EFFECTS

PLANAR, ARMS = ("2r",), ("panda", "ur5")
DECIDABLE = 300.0  # χ² that a fit that is given the hidden effects gains at least
GAINS = (float("-inf"), DECIDABLE, 3e3, 1e5, 1e7, float("inf"))
FOUND = 0.9  # share from which on an effect of a size counts as found
ABOUT = (0.85, 0.95)  # confidences that are about 90 %
# effects whose size is a torque
TORQUES = {name for name, size in SIZES.items() if EFFECTS[name].units[size.parameter] == "Nm"}
CODES = {
    "coulomb_friction": "Cou", "stribeck_friction": "Str", "quadratic_friction": "Qua",
    "load_dependent_friction": "Loa", "presliding_hysteresis": "Pre", "friction_drift": "Dri",
    "torque_ripple": "Rip", "torque_offset": "Off", "torque_gain": "Gai", "torque_delay": "Del",
    "stiffness_hardening": "Har", "backlash": "Bac", "joint_damping": "Dam", "transmission_error": "Tra",
    "link_coulomb_friction": "LCo", "cable_spring": "Cab", "payload_error": "Pay", "base_tilt": "Til",
    "external_contact": "Con", "motor_coupling": "Mot", NOTHING: "none", UNKNOWN: "unk",
}  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """One case: its truth, what a fit that is given it finds, and what was said.

    Attributes:
        best: values of that fit.
        held_out: held-out error of the last model over that fit's, minus one; None without one.
    """

    truth: Json
    known: Json
    said: Judgement
    best: tuple[Value, ...]
    held_out: float | None

    @property
    def gain(self) -> float:
        """χ² that the fit that is given the hidden effects gains."""
        return self.known["gain"]

    @property
    def decidable(self) -> bool:
        """Whether that is enough in all."""
        return self.gain >= DECIDABLE

    @property
    def each_decidable(self) -> bool:
        """Whether every hidden effect gains enough by itself, the others being known."""
        return min(self.known["gains"], default=self.gain) >= DECIDABLE

    @property
    def hidden(self) -> str:
        """The first hidden effect, NOTHING or UNKNOWN."""
        return self.truth["effects"][0]["effect"] if self.truth["effects"] else NOTHING

    def of(self, kinds: Sequence[str], robots: Sequence[str] = (*PLANAR, *ARMS)) -> bool:
        """Whether the case is one of these."""
        return self.truth["kind"] in kinds and self.truth["robot"] in robots


def outcome(truth: Json, known: Json, result: Json) -> Outcome:
    """The outcome of one case."""
    library = [e for e in truth["effects"] if e["effect"] != UNKNOWN]
    errors, best = result.get("errors"), known.get("errors")
    held_out = float(np.linalg.norm(errors) / np.linalg.norm(best)) - 1.0 if errors and best else None
    # whether each is decidable is asked here, not whether the truth calls it weak
    said = judge(truth | {"weak": False}, result)
    return Outcome(truth, known, said, tuple(effect_values(library, known["effects"])), held_out)


def first_right(one: Outcome) -> bool:
    return one.said.first_right


def right(one: Outcome) -> bool:
    return one.said.right


def all_found(one: Outcome) -> bool:
    return not one.said.missed


def figures(given: Sequence[Outcome]) -> tuple[Table, bool]:
    """What is required and what is reached, and whether it all is."""
    single = [o for o in given if o.of(("single",)) and o.decidable]
    planar, arms = ([o for o in single if o.of(("single",), robots)] for robots in (PLANAR, ARMS))
    limit = [o for o in given if o.of(("limit",)) and o.decidable]
    pairs = [o for o in given if o.of(("pair",)) and o.decidable]
    clean, foreign = (
        [o for o in given if o.of(("clean",))],
        [o for o in given if o.of(("unknown",)) and o.decidable],
    )
    stated = [a for o in given for a in o.said.additions if a.confidence is not None]
    about = share(a.right for a in stated if a.confidence and ABOUT[0] <= a.confidence < ABOUT[1])
    kinds = len({o.truth["effects"][0]["kind"] for o in foreign})
    ratios = [abs(o.held_out) for o in single if right(o) and o.held_out is not None]
    rows: list[tuple[str, str, str, bool | None]] = []

    def at_least(
        what: str, cases: Sequence[Outcome], hit: Callable[[Outcome], bool], least: float, count: int
    ) -> None:
        got = share(cases, hit)
        passed = got.count >= count and got.value >= least if least else None
        rows.append((what, f"≥ {100 * least:g} % of ≥ {count}" if least else NONE, got.text, passed))

    def at_most(what: str, got: float, most: float, best: float | None = None) -> None:
        beside = "" if best is None else f" ({percent(best)})"
        rows.append((what, f"≤ {percent(most)}", f"{percent(got)}{beside}", got <= most))

    at_least("2-DOF, one effect, first named right", planar, first_right, 0.98, 200)
    at_least("Panda and UR5, one effect, first named right", arms, first_right, 0.98, 40)
    at_least("one effect, right in every respect", single, right, 0, 0)
    at_least("around the detection limit, first named right", limit, first_right, 0, 0)
    at_least(
        "two effects, each decidable, both found", [o for o in pairs if o.each_decidable], all_found, 0.9, 1
    )
    rest = [o for o in pairs if not o.each_decidable]
    at_least("the same where they are decidable only together", rest, all_found, 0, 0)
    at_least("clean sets without a false alarm", clean, right, 0.98, 150)
    at_least(f"not in the library, {kinds} kinds, recognised with the right joint", foreign, right, 0.95, 60)
    for what, backlash, q, most in (
        ("effects' values, error, median (given the effects)", False, 0.5, 0.003),
        ("effects' values, error, nine in ten (given the effects)", False, 0.9, 0.02),
        ("backlash, error, nine in ten (given the effects)", True, 0.9, 0.15),
    ):
        got, best = (quantile(errors(single, backlash, known), q) for known in (False, True))
        at_most(what, got, most, best)
    at_most("held-out error beside that given the effects, nine in ten", quantile(ratios, 0.9), 0.01)
    rows.append(("findings stated at 90 % (85 to 95 %), right", "85–95 %", about.text,
                 about.count > 0 and ABOUT[0] <= about.value <= ABOUT[1]))  # fmt: skip
    for what, robots, most in (("2-DOF", PLANAR, 4.0), ("Panda and UR5", ARMS, 20.0)):
        chosen = [o.said for o in given if o.truth["robot"] in robots and o.said.error is None]
        wall, cpu = (quantile([getattr(j, name) for j in chosen], 0.5) for name in ("wall", "cpu"))
        text = f"{wall:.1f} s ({cpu:.1f} s)"
        rows.append((f"{what}, median time of a diagnosis (CPU)", f"≤ {most:g} s", text, wall <= most))
    mark = {True: "pass", False: "**fail**", None: ""}
    table = [["", "required", "reached", ""], *([*texts, mark[passed]] for *texts, passed in rows)]
    return table, all(passed is not False for *_, passed in rows)


def errors(given: Iterable[Outcome], backlash: bool, known: bool) -> list[float]:
    """Errors of the hidden effects' values in the cases that were named right; `known`: given the effects."""
    chosen = [value for o in given if first_right(o) for value in (o.best if known else o.said.values)]
    return [v.error for v in chosen if "." in v.name and v.name.startswith("backlash.") == backlash]


def by_kind(given: Sequence[Outcome]) -> Table:
    """Counts and shares right, by robot and kind."""
    rows = [["kind", "robot", "cases", "decidable", "first named right", "all found", "wholly right"]]
    for kind, robot in sorted({(o.truth["kind"], o.truth["robot"]) for o in given}):
        chosen = [o for o in given if o.of((kind,), (robot,))]
        judged = chosen if kind == "clean" else [o for o in chosen if o.decidable]
        cells = [
            share(judged, hit).text if kind in ("single", "limit", "pair") else ""
            for hit in (first_right, all_found)
        ]
        rows.append([kind, robot, str(len(chosen)), str(len(judged)), *cells, share(judged, right).text])
    return rows


def by_gain(given: Sequence[Outcome]) -> Table:
    """One effect, decidable or not: shares by what a fit that is given the effect gains."""
    rows = [
        ["gain given the effect", "2-DOF named right", "wholly right", "arms named right", "wholly right"]
    ]
    for low, high in pairwise(GAINS):
        row = [f"{low:g} to {high:g}"]
        for robots in (PLANAR, ARMS):
            chosen = [o for o in given if o.of(("single", "limit"), robots) and low <= o.gain < high]
            row += [share(chosen, hit).text for hit in (first_right, right)]
        rows.append(row)
    return rows


def confusion(given: Sequence[Outcome]) -> Table:
    """True effect → first named, one effect hidden, decidable; ✗: on a wrong joint or payload."""
    columns = [*SIZES, NOTHING, UNKNOWN]
    rows = [["", *(CODES[name] for name in columns)]]
    for name in SIZES:
        here = [o for o in given if o.of(("single", "limit")) and o.decidable and o.hidden == name]
        count = Counter(o.said.named[0] for o in here)
        misplaced = sum(o.said.named[0] == name and not first_right(o) for o in here)
        cells = {column: str(count[column]) if count[column] else "" for column in columns}
        if misplaced:
            cells[name] = f"{count[name] - misplaced}+{misplaced}✗"
        rows.append([f"{CODES[name]} {name}", *cells.values()])
    return rows


def extra_laws(given: Sequence[Outcome]) -> Table:
    """What is not in the library, kind by kind."""
    rows = [["law", "cases", "decidable", "called unknown", "with the right joint", "first named instead"]]
    for name in EXTRA_LAWS:
        chosen = [o for o in given if o.of(("unknown",)) and o.truth["effects"][0]["kind"] == name]
        judged = [o for o in chosen if o.decidable]
        instead = Counter(o.said.named[0] for o in judged if not right(o)).most_common()
        called = share(UNKNOWN in (o.said.verdict, o.said.last) for o in judged).text
        told = ", ".join(f"{k} × {n}" for k, n in instead)
        if chosen:
            rows.append([name, str(len(chosen)), str(len(judged)), called, share(judged, right).text, told])
    return rows


def sizes(given: Sequence[Outcome], robots: Sequence[str]) -> Table:
    """Smallest size found at 90 %, by effect and noise, and what a fit given the effect could decide."""
    head = ["effect", "size", *(f"noise {noise:g}" for noise in NOISES), "relative to", "limit at noise 1"]
    rows = [head]
    for name, size in SIZES.items():  # an effect without cases is left out
        here = [o for o in given if o.of(("single", "limit"), robots) and o.hidden == name]
        if not here:
            continue
        unit = EFFECTS[name].units[size.parameter]
        data: dict[float, list[tuple[float, float, bool]]] = {noise: [] for noise in NOISES}
        limits = []
        for o in here:
            (true,), noise = o.truth["effects"], o.truth["noise_scale"]
            relative = true["size"] / _natural(o.truth)
            data[noise].append((relative, true["size"], first_right(o)))
            if o.gain > 30.0:
                limits.append(relative / noise * np.sqrt(DECIDABLE / o.gain))
        cells = []
        for cases in data.values():
            least = smallest(cases)
            text = NONE if least is None else f"{least[1]:.2g} {unit} = {least[0]:.2g}"
            cells.append(f"{text} ({len(cases)})".replace(" - ", " "))
        to, limit = "rms torque" if name in TORQUES else "natural size", quantile(limits, 0.5)
        rows.append([name, size.parameter, *cells, to, f"{limit:.2g}" if limits else NONE])
    return rows


def smallest(cases: Iterable[tuple[float, float, bool]]) -> tuple[float, float] | None:
    """Of (relative size, size, found): the smallest sizes from which on nine in ten are found."""
    best, found = None, 0
    for k, (relative, size, hit) in enumerate(sorted(cases, reverse=True), 1):
        found += hit
        if hit and found >= FOUND * k:
            best = relative, size
    return best


def knowing(given: Sequence[Outcome]) -> Table:
    """Whether the fit that is given the effect reaches the noise: χ² a sample of its worst joint."""
    rows = [["effect", "2-DOF: cases", "median", "worst", "Panda and UR5: cases", "median", "worst"]]
    for name in (*SIZES, NOTHING):
        row = [name]
        for robots in (PLANAR, ARMS):
            here = [o for o in given if o.of(("single", "limit", "clean"), robots) and o.hidden == name]
            chi = [max(o.known["chi"]) for o in here]
            row += [str(len(chi)), *(f"{quantile(chi, q):.3g}" if chi else NONE for q in (0.5, 1.0))]
        rows.append(row)
    return rows


def wrong(given: Sequence[Outcome]) -> Table:
    """Every case that should be right and is not."""
    rows = [["case", "seed", "noise", "hidden", "gain", "answer"]]
    for o in given:
        if not right(o) and (o.of(("clean",)) or o.decidable):
            hidden = "; ".join(map(describe, o.truth["effects"])) or "nothing"
            about = [o.truth["case"], str(o.truth["seed"]), f"{o.truth['noise_scale']:g}"]
            rows.append([*about, hidden, f"{o.gain:.3g}", o.said.words])
    return rows


def describe(true: Json) -> str:
    """A hidden effect in a few words."""
    place = true.get("joint") or true.get("payload") or "all"
    if true["effect"] == UNKNOWN:
        return f"{true['kind']} on {place}"
    unit = EFFECTS[true["effect"]].units[SIZES[true["effect"]].parameter].replace("-", "").strip()
    return f"{true['effect']} on {place}, {true['size']:.3g} {unit}".rstrip()


def _natural(truth: Json) -> float:
    """What a size is relative to: the rms torque of the joint where it is a torque, else the natural size."""
    (true,) = truth["effects"]
    if true["effect"] in TORQUES and true["joint"]:
        return truth["torque_rms"][truth["joints"].index(true["joint"])]
    return true["natural"]
