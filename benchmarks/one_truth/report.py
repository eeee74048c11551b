"""A line for each set, then the figures that a study was made for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.diagnosis_study.judging import effect_text
from benchmarks.diagnosis_study.report import calibration_rows
from benchmarks.measuring_stick.sets import StickSet
from benchmarks.one_truth.answers import FOUND, PARTS
from benchmarks.one_truth.judging import CHECKS, LIMIT, Answers, Checks, figures
from benchmarks.tables import number, plain, share

HEAD = ["set", "truth", "said", "error [%]", "CPU [s]", "MB", "missed"]
MOST = ("both found", "worn: both found", "gain named", "late torque named", LIMIT, "named")
REQUIRED = {"hidden effect named first": 0.95, "lag of the torque named": 0.8} | dict.fromkeys(MOST, 0.9)
"""What is asked of the sets → the share for which it must hold; all, if it is not here."""
COUNTED, ABOUT, RIGHT = (0.5, 0.99), (0.85, 0.95), (0.85, 0.95)  # confidences; how many of those about .9


def report(study: str, sets: Sequence[StickSet], results: Path) -> bool:
    """Print what a command's answers show; whether all that is asked for is reached."""
    asked = [Answers(one, results) for one in sets]
    parts = PARTS.get(study) or (FOUND,)
    there = [one for one in asked if all(one.file(part).is_file() for part in parts)]
    print(f"\n{study}, {results.name}: {len(there)} of {len(asked)} sets have an answer")
    if study == "confidence":
        return _confidences(there)
    checks = [CHECKS[study](one) if one.found else {"an answer": False} for one in there]
    numbers = [figures(study, one) for one in there]
    rows = [_row(*line) for line in zip(there, checks, numbers, strict=True)]
    print(plain([HEAD, *rows]))
    reached = bool(there)
    for name in dict.fromkeys(name for one in checks for name in one):
        counted, required = share(checks, lambda one: one.get(name)), REQUIRED.get(name, 1.0)  # noqa: B023
        reached &= counted.value >= required
        end = "%" if counted.value >= required else "%: MISSED"
        print(f"{name}: {counted.text}, required {100 * required:g} {end}")
    for name in dict.fromkeys(name for one in numbers for name in one):
        print(f"{name}: at most {number(max(one[name] for one in numbers))}")
    cpu, peak = ([getattr(one.judged, name) for one in there] for name in ("cpu", "peak"))
    print(f"CPU {sum(cpu):.0f} s, at most {max(cpu, default=0):.0f} s; peak {max(peak, default=0):.0f} MB")
    return reached


def _row(of: Answers, checks: Checks, numbers: dict[str, float]) -> list[str]:
    judged, truth = of.judged, " ".join(map(effect_text, of.hidden)) or "nothing"
    added = [a.name + (f" {a.confidence:.2f}" if a.confidence is not None else "") for a in judged.additions]
    said = judged.error or " ".join(
        [f"{judged.last}:", *added, *(f"({number(x)})" for x in numbers.values())]
    )
    missed = "; ".join(name for name, holds in checks.items() if not holds)
    cost = number(100 * of.error(FOUND)), number(judged.cpu, ".1f"), number(judged.peak, ".0f")
    return [of.one.key, truth if of.truth else "–", said, *cost, missed]


def _confidences(there: Sequence[Answers]) -> bool:
    """How often what is stated is right, of everything that was added where the truth is known."""
    counted = [
        (a, a.confidence)
        for one in there
        if one.truth is not None and one.judged.asked
        for a in one.judged.additions
        if a.confidence is not None and COUNTED[0] <= a.confidence <= COUNTED[1]
    ]
    print(plain(calibration_rows([a for a, _ in counted])))
    about = share([a for a, p in counted if ABOUT[0] <= p <= ABOUT[1]], lambda a: a.right)
    good = RIGHT[0] <= about.value <= RIGHT[1]
    print(f"stated .5 to .99: {share(counted, lambda one: one[0].right).text} right")
    print(f"right among those stated about .9: {about.text}, required 85 to 95 %{'' if good else ': MISSED'}")
    return good
