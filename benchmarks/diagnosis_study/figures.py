"""What was to be shown, and what was reached."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.diagnosis_study import statistics as st
from benchmarks.diagnosis_study.judging import Judged
from benchmarks.diagnosis_study.tables import Table, percent

SECONDS = (("2-DOF", ("2r",), 4.0), ("Panda and UR5", st.ARMS, 20.0))
KINDS = 4  # of laws that the library does not have, at least


@dataclass(frozen=True)
class Figure:
    """One of them; `passed` None where nothing is required."""

    what: str
    required: str
    reached: str
    passed: bool | None = None


def figures(cases: Sequence[Judged]) -> list[Figure]:
    """All of them."""
    planar, arms = st.singles(cases, ("2r",)), st.singles(cases, st.ARMS)
    limit = st.singles(cases, ("2r", *st.ARMS), "limit")
    pairs = [c for c in cases if c.kind == "pair" and c.decidable]
    each = [c for c in pairs if c.each_decidable]
    rest = [c for c in pairs if not c.each_decidable]
    return [
        _first_named("2-DOF", planar, 200),
        _first_named("Panda and UR5", arms, 40),
        Figure("one effect, right in every respect", "–", st.share(planar + arms, lambda c: c.right).text),
        Figure(
            "around the detection limit, first named right",
            "–",
            st.share(limit, lambda c: c.first_right).text,
        ),
        _both_found(each),
        Figure(
            "the same where they are decidable only together", "–", st.share(rest, lambda c: c.all_found).text
        ),
        _false_alarms([c for c in cases if c.kind == "clean"]),
        _recognised([c for c in cases if c.kind == "unknown" and c.decidable]),
        *_parameters(planar + arms),
        _near_the_limit(limit),
        _held_out(planar + arms),
        *_sure(cases),
        *(_time(cases, *row) for row in SECONDS),
    ]


def table(rows: Sequence[Figure]) -> Table:
    """As rows of text."""
    mark = {True: "pass", False: "**fail**", None: ""}
    return [["", "required", "reached", ""], *([f.what, f.required, f.reached, mark[f.passed]] for f in rows)]


def _first_named(robots: str, cases: Sequence[Judged], least: int) -> Figure:
    got = st.share(cases, lambda c: c.first_right)
    passed = got.count >= least and got.value >= 0.98
    return Figure(f"{robots}, one effect, first named right", f"≥ 98 % of ≥ {least}", got.text, passed)


def _both_found(pairs: Sequence[Judged]) -> Figure:
    got = st.share(pairs, lambda c: c.all_found)
    return Figure(
        "two effects, each decidable, both found", "≥ 90 %", got.text, got.count > 0 and got.value >= 0.9
    )


def _false_alarms(clean: Sequence[Judged]) -> Figure:
    got = st.share(clean, lambda c: not c.right)
    return Figure(
        "clean sets, false alarms", "≤ 2 % of ≥ 150", got.text, got.count >= 150 and got.value <= 0.02
    )


def _recognised(foreign: Sequence[Judged]) -> Figure:
    got, kinds = st.share(foreign, lambda c: c.right), len({c.truth[0]["kind"] for c in foreign})
    return Figure(
        "not in the library, recognised with the right joint",
        f"≥ 95 % of ≥ 60, ≥ {KINDS} kinds",
        f"{got.text}, {kinds} kinds",
        got.count >= 60 and kinds >= KINDS and got.value >= 0.95,
    )


def _parameters(cases: Sequence[Judged]) -> list[Figure]:
    """Beside each, in brackets, what the fit that knows the truth reaches in the same cases."""
    out = []
    for what, backlash, q, most in (
        ("effect parameters, error, median", False, 0.5, 0.003),
        ("effect parameters, error, nine in ten", False, 0.9, 0.02),
        ("backlash, error, nine in ten", True, 0.9, 0.15),
    ):
        got = st.quantile(st.parameter_errors(cases, backlash), q)
        best = st.quantile(st.parameter_errors(cases, backlash, knowing=True), q)
        text = f"{percent(got)} ({percent(best)})"
        out.append(Figure(f"{what} (truth-knowing)", f"≤ {percent(most)}", text, got <= most))
    return out


def _near_the_limit(cases: Sequence[Judged]) -> Figure:
    got, best = (st.quantile(st.parameter_errors(cases, False, knowing=k), 0.9) for k in (False, True))
    text = f"{percent(got)} ({percent(best)})"
    return Figure("the same around the detection limit, nine in ten", "–", text)


def _held_out(cases: Sequence[Judged]) -> Figure:
    ratios = [abs(c.held_out) for c in cases if c.right and c.held_out is not None]
    most = st.quantile(ratios, 0.9)
    text = f"{percent(most)}, median {percent(st.quantile(ratios, 0.5))}"
    return Figure("held-out error beside truth-knowing, nine in ten", "within 1 %", text, most <= 0.01)


def _sure(cases: Sequence[Judged]) -> list[Figure]:
    stated = [s for c in cases for s in c.stated]
    about, low, high = st.about(stated), *st.ABOUT
    passed = about.count > 0 and low <= about.value <= high
    return [
        Figure("findings stated at 90 % (85 to 95 %), right", "85–95 %", about.text, passed),
        Figure("findings stated at ≥ 90 %, right", "–", st.sure(stated).text),
    ]


def _time(cases: Sequence[Judged], what: str, robots: Sequence[str], most: float) -> Figure:
    chosen = [c for c in cases if c.robot in robots and c.verdict != "error"]
    wall = st.quantile([c.wall for c in chosen], 0.5)
    cpu = st.quantile([c.cpu for c in chosen], 0.5)
    text = f"{wall:.1f} s ({cpu:.1f} s)"
    return Figure(f"{what}, median time of a diagnosis (CPU)", f"≤ {most:g} s", text, wall <= most)
