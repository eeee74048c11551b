"""The study's tables: rows of text, first row the head."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from benchmarks.diagnosis_study import statistics as st
from benchmarks.diagnosis_study.answers import DECIDABLE, NOTHING, UNKNOWN, Json
from benchmarks.diagnosis_study.cases import NOISES
from benchmarks.diagnosis_study.judging import Judged
from benchmarks.diagnosis_study.laws import EXTRA_LAWS
from benchmarks.diagnosis_study.sizes import SIZES
from flexviz.effects import EFFECTS
from flexviz.statistics import NORMAL_95

Table = list[list[str]]
Outcome = tuple[Judged, Json]  # a case and its truth

GAINS = ((300.0, 3e3), (3e3, 1e5), (1e5, 1e7), (1e7, float("inf")))
CODES = {
    "coulomb_friction": "Cou", "stribeck_friction": "Str", "quadratic_friction": "Qua",
    "load_dependent_friction": "Loa", "presliding_hysteresis": "Pre", "friction_drift": "Dri",
    "torque_ripple": "Rip", "torque_offset": "Off", "torque_gain": "Gai", "torque_delay": "Del",
    "stiffness_hardening": "Har", "backlash": "Bac", "joint_damping": "Dam", "transmission_error": "Tra",
    "link_coulomb_friction": "LCo", "cable_spring": "Cab", "payload_error": "Pay", "base_tilt": "Til",
    "external_contact": "Con", "motor_coupling": "Mot", NOTHING: "none", UNKNOWN: "unk",
}  # fmt: skip


def by_kind(outcomes: Sequence[Outcome]) -> Table:
    """Counts and shares right, by robot and kind."""
    rows = [["kind", "robot", "cases", "decidable", "first named right", "all found", "wholly right"]]
    cases = [c for c, _ in outcomes]
    for kind in dict.fromkeys(c.kind for c in cases):
        for robot in dict.fromkeys(c.robot for c in cases):
            chosen = [c for c in cases if c.kind == kind and c.robot == robot]
            if not chosen:
                continue
            judged = chosen if kind == "clean" else [c for c in chosen if c.decidable]
            named = kind in ("single", "limit", "pair")
            rows.append(
                [
                    kind, robot, str(len(chosen)), "" if kind == "clean" else str(len(judged)),
                    st.share(judged, lambda c: c.first_right).text if named else "",
                    st.share(judged, lambda c: c.all_found).text if named else "",
                    st.share(judged, lambda c: c.right).text,
                ]
            )  # fmt: skip
    return rows


def by_gain(outcomes: Sequence[Outcome]) -> Table:
    """One effect, decidable or not: shares by what the truth-knowing fit gains."""
    rows = [
        [
            "gain of the truth-knowing fit",
            "2-DOF named right",
            "wholly right",
            "arms named right",
            "wholly right",
        ]
    ]
    edges = ((float("-inf"), DECIDABLE), *GAINS)
    for low, high in edges:
        row = [f"below {high:g}" if low < 0 else f"{low:g} to {high:g}" if high < 1e99 else f"above {low:g}"]
        for robots in (("2r",), st.ARMS):
            chosen = [
                c
                for c, _ in outcomes
                if c.kind in ("single", "limit") and c.robot in robots and low <= c.gain < high
            ]
            row += [st.share(chosen, lambda c: c.first_right).text, st.share(chosen, lambda c: c.right).text]
        rows.append(row)
    return rows


def confusion(outcomes: Sequence[Outcome]) -> Table:
    """True effect → first named, one effect hidden, decidable; ✗: on a wrong joint or payload."""
    columns = [*SIZES, NOTHING, UNKNOWN]
    rows = [["", *(CODES[name] for name in columns)]]
    chosen = [c for c, _ in outcomes if c.kind in ("single", "limit") and c.decidable]
    for name in SIZES:
        here = [c for c in chosen if c.truth[0]["effect"] == name]
        count = Counter(c.named[0] for c in here)
        misplaced = sum(c.named[0] == name and not c.first_right for c in here)
        cells = [str(count[column]) if count[column] else "" for column in columns]
        if misplaced:
            own = columns.index(name)
            cells[own] = f"{count[name] - misplaced}+{misplaced}✗"
        rows.append([f"{CODES[name]} {name}", *cells])
    return rows


def extra_laws(outcomes: Sequence[Outcome]) -> Table:
    """What is not in the library, kind by kind."""
    rows = [["law", "cases", "decidable", "called unknown", "with the right joint", "first named instead"]]
    for name in EXTRA_LAWS:
        chosen = [c for c, _ in outcomes if c.kind == "unknown" and c.truth[0]["kind"] == name]
        if not chosen:
            continue
        judged = [c for c in chosen if c.decidable]
        instead = Counter(c.named[0] for c in judged if not c.right)
        rows.append(
            [
                name, str(len(chosen)), str(len(judged)),
                st.share(judged, lambda c: "unknown" in c.answer).text,
                st.share(judged, lambda c: c.right).text,
                ", ".join(f"{k} × {n}" for k, n in instead.most_common()),
            ]
        )  # fmt: skip
    return rows


def sizes(outcomes: Sequence[Outcome], robots: Sequence[str]) -> Table:
    """Smallest size found at 90 %, by effect and noise, beside what the truth-knowing fit could decide."""
    head = ["effect", "size", *(f"noise {noise:g}" for noise in NOISES), "relative to", "limit at noise 1"]
    rows = [head]
    for name, size in SIZES.items():  # an effect without cases is left out
        here = [
            (c, t) for c, t in outcomes
            if c.kind in ("single", "limit") and c.robot in robots and c.truth[0]["effect"] == name
        ]  # fmt: skip
        if not here:
            continue
        unit = EFFECTS[name].units[size.parameter]
        cells, pairs = [], []
        for noise in NOISES:
            data = []
            for case, truth in here:
                true = truth["effects"][0]
                relative = st.relative_size(true, _torque(truth))
                if case.noise == noise:
                    data.append((relative, true["size"], case.first_right))
                if case.gain > 30.0:
                    pairs.append((relative / case.noise, case.gain))
            got = st.smallest(data)
            if got.size is None or got.relative is None:
                cells.append(f"– ({got.count})")
            else:
                cells.append(f"{got.size:.2g} {unit} = {got.relative:.2g} ({got.count})".replace(" - ", " "))
        to = "rms torque" if name in st.TORQUES else "natural size"
        least = st.limit(list(dict.fromkeys(pairs)), DECIDABLE)
        rows.append([name, size.parameter, *cells, to, f"{least:.2g}" if least == least else "–"])
    return rows


def errors(outcomes: Sequence[Outcome]) -> Table:
    """Errors of the effects' parameters, where they were named right."""
    head = ["parameter", "cases", "median", "nine in ten", "truth-knowing: median", "nine in ten"]
    rows = [[*head, "within 95 % interval"]]
    chosen = [c for c, _ in outcomes if c.kind in ("single", "limit") and c.decidable and c.first_right]
    names = dict.fromkeys(
        name
        for effect in SIZES
        for c in chosen
        for name in c.parameter_errors
        if name.startswith(effect + ".")
    )
    for name in names:
        found = [c.parameter_errors[name] for c in chosen if name in c.parameter_errors]
        best = [c.knowing_errors[name] for c in chosen if name in c.knowing_errors]
        cells = [percent(st.quantile(v, q)) for v in (found, best) for q in (0.5, 0.9)]
        inside = [c.deviations[name] < NORMAL_95 for c in chosen if name in c.deviations]
        rows.append([name, str(len(found)), *cells, st.Share(sum(inside), len(inside)).text])
    return rows


def motor_side(outcomes: Sequence[Outcome]) -> Table:
    """Errors of stiffness and motor inertia, joint by joint, where nothing is missing in the end."""
    head = ["robot", "joint", "sets"]
    for name in ("stiffness", "motor inertia"):
        head += [f"{name}: median", "nine in ten", "within 95 % interval"]
    rows = [head]
    cases = [c for c, _ in outcomes if c.base]
    for robot in dict.fromkeys(c.robot for c in cases):
        here = [e for c in cases if c.robot == robot for e in c.base]
        for joint in sorted({e.joint for e in here}):
            at = [e for e in here if e.joint == joint]
            row = [robot, str(joint + 1), str(sum(e.name == "stiffness" for e in at))]
            for name in ("stiffness", "motor_inertia"):
                found = [e for e in at if e.name == name]
                row += [percent(st.quantile([e.error for e in found], q)) for q in (0.5, 0.9)]
                row.append(st.Share(sum(e.deviation < NORMAL_95 for e in found), len(found)).text)
            rows.append(row)
    return rows


def knowing(outcomes: Sequence[Outcome]) -> Table:
    """Whether the fit that knows the truth reaches the noise: χ² a sample of its worst joint."""
    rows = [["effect", "2-DOF: cases", "median", "worst", "Panda and UR5: cases", "median", "worst"]]
    for name in (*SIZES, NOTHING):
        row = [name]
        for robots in (("2r",), st.ARMS):
            here = [c for c, _ in outcomes if c.robot in robots and c.kind in ("single", "limit", "clean")]
            chosen = [c.chi for c in here if (c.truth[0]["effect"] if c.truth else NOTHING) == name]
            cells = [f"{st.quantile(chosen, q):.3g}" if chosen else "–" for q in (0.5, 1.0)]
            row += [str(len(chosen)), *cells]
        rows.append(row)
    return rows


def calibration(outcomes: Sequence[Outcome]) -> Table:
    """Stated confidence against how many are right: all cases, decidable or not."""
    rows = [["stated", "mean", "first named: right", "later ones: right"]]
    first = [c.stated[0] for c, _ in outcomes if c.stated]
    later = [s for c, _ in outcomes for s in c.stated[1:]]
    for a, b in zip(st.calibration(first), st.calibration(later), strict=True):
        rows.append([f"{a[0]:g}–{a[1]:g}", f"{a[2]:.3f}" if a[2] == a[2] else "–", a[3].text, b[3].text])
    rows.append([f"≥ {st.SURE:g}", "", st.sure(first).text, st.sure(later).text])
    return rows


def wrong(outcomes: Sequence[Outcome]) -> Table:
    """Every case that should be right and is not."""
    rows = [["case", "seed", "noise", "hidden", "gain", "answer"]]
    for case, truth in outcomes:
        if case.right or (case.kind != "clean" and not case.decidable):
            continue
        hidden = "; ".join(map(describe, case.truth)) or "nothing"
        rows.append(
            [case.case, str(truth["seed"]), f"{case.noise:g}", hidden, f"{case.gain:.3g}", case.answer]
        )
    return rows


def describe(true: Json) -> str:
    """A hidden effect in a few words."""
    place = true.get("joint") or true.get("payload") or "all"
    if true["effect"] == "unknown":
        return f"{true['kind']} on {place}"
    parameter = SIZES[true["effect"]].parameter
    unit = EFFECTS[true["effect"]].units[parameter].replace("-", "").strip()
    return f"{true['effect']} on {place}, {true['size']:.3g} {unit}".rstrip()


def percent(value: float) -> str:
    """0.0123 → "1.2 %"."""
    return "–" if value != value else f"{100 * value:.2g} %"


def _torque(truth: Json) -> float | None:
    joint = truth["effects"][0]["joint"]
    return truth["torque_rms"][truth["joints"].index(joint)] if joint else None
