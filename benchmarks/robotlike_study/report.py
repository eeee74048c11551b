"""The report: what was found, what was added wrongly, at which cost, and how far stated confidences hold."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

import numpy as np

from benchmarks.diagnosis_study.making import truth_file
from benchmarks.diagnosis_study.running import result_file
from benchmarks.paper_study.tables import Table, plain
from benchmarks.robotlike_study.judging import Addition, Scored, score
from benchmarks.robotlike_study.running import made_cases

T = TypeVar("T")

BINS = (0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0)  # of stated confidence


def scored_cases(work: Path, label: str, only: str = "") -> list[Scored]:
    """Every case that has a result."""
    out = []
    for name in made_cases(work, only):
        path = result_file(work, name, label)
        if path.is_file():
            truth, result = (
                json.loads(p.read_text(encoding="utf-8")) for p in (truth_file(work, name), path)
            )
            out.append(score(truth, result))
    return out


def report(cases: Sequence[Scored], planned: int) -> str:
    """The report as text."""
    answered = [c for c in cases if c.error is None]
    parts: list[str | Table] = [
        f"{len(cases)} of {planned} cases have a result, {len(answered)} an answer",
        *map(case_line, cases),
        "\nFound by effect; must: share of 3 % or more, small: below",
        found_rows(answered),
        "\nFalse additions by kind; imitations stand on a joint with a law of no library",
        false_rows(answered),
        "\nBy robot",
        robot_rows(cases),
        "\nCost",
        cost_rows(cases),
        "\nErrors of the parameters of must-find effects, found by name",
        error_rows(answered),
        "\nStated confidence of what was added, and how much of it is hidden there (or its twin)",
        calibration_rows([a for c in answered for a in c.additions]),
    ]
    return "\n".join(part if isinstance(part, str) else plain(part) for part in parts)


def case_line(case: Scored) -> str:
    """One case in a line."""
    if case.error is not None:
        return (
            f"{case.case}: no answer ({case.error.splitlines()[-1]}), {case.wall:.0f} s, {case.peak:.0f} MB"
        )
    words = [f"{sum(e.found for e in case.must)}/{len(case.must)} found"]
    missed = [f"{_short(e.effect, e.joint)} {e.share:.2f}" for e in case.must if not e.found]
    lists = {
        "missed": missed,
        "false": [_short(a.effect, a.joint) for a in case.false],
        "imitations": [_short(a.effect, a.joint) for a in case.imitations],
        "unknown laws": case.laws,
    }
    words += [f"{name} {', '.join(items)}" for name, items in lists.items() if items]
    words.append(f"last {case.last} ({'right' if case.last_right else 'wrong'})")
    words.append(f"held out × {_number(case.held_out, '.3f')}")
    return f"{case.case}: {'; '.join(words)}; {case.wall:.0f} s, {case.peak:.0f} MB"


def found_rows(cases: Sequence[Scored]) -> Table:
    """Found of all, by kind of effect."""
    hidden = [e for c in cases for e in c.hidden]
    rows = [["effect", "must found", "small found"]]
    for name in (*sorted({e.effect for e in hidden}), ""):
        chosen = [e for e in hidden if name in ("", e.effect)]
        must, small = [e for e in chosen if e.must], [e for e in chosen if not e.must]
        rows.append([name or "all", _share(must, lambda e: e.found), _share(small, lambda e: e.found)])
    return rows


def false_rows(cases: Sequence[Scored]) -> Table:
    """Additions of the final models that are not hidden, by kind."""
    false = Counter(a.effect for c in cases for a in c.false)
    imitations = Counter(a.effect for c in cases for a in c.imitations)
    rows = [["effect", "false", "imitations"]]
    for name in sorted({*false, *imitations}, key=lambda name: (-false[name], name)):
        rows.append([name, str(false[name]), str(imitations[name])])
    total = max(len(cases), 1)
    rows.append(["per set", f"{false.total() / total:.2f}", f"{imitations.total() / total:.2f}"])
    return rows


def robot_rows(cases: Sequence[Scored]) -> Table:
    """What was found, by robot."""
    rows = [
        ["robot", "answered", "must found", "false per set", "last verdict right", "with unknown laws",
         "held out × median", "90 %", "parameter error median", "90 %"],
    ]  # fmt: skip
    for robot, chosen in _by_robot(cases):
        good = [c for c in chosen if c.error is None]
        rows.append(
            [
                robot,
                f"{len(good)}/{len(chosen)}",
                _share([e for c in good for e in c.must], lambda e: e.found),
                f"{sum(len(c.false) for c in good) / max(len(good), 1):.2f}",
                _share(good, lambda c: c.last_right),
                _share([c for c in good if c.laws], lambda c: c.last_right),
                *_quantiles([c.held_out for c in good if c.held_out is not None]),
                *_quantiles([error for c in good for _, error in c.parameter_errors]),
            ]
        )
    return rows


def cost_rows(cases: Sequence[Scored]) -> Table:
    """Median and largest time and memory, by robot; a diagnosis that was stopped counts as long as it ran."""
    rows = [["robot", "wall s", "most", "CPU s", "most", "MB", "most"]]
    for robot, chosen in _by_robot(cases):
        columns = ([c.wall for c in chosen], [c.cpu for c in chosen], [c.peak for c in chosen])
        rows.append([robot, *(f"{f(x):.0f}" for x in columns if x for f in (np.median, np.max))])
    return rows


def _by_robot(cases: Sequence[Scored]) -> Iterator[tuple[str, list[Scored]]]:
    """The cases of each robot, then all."""
    for robot in dict.fromkeys(c.robot for c in cases):
        yield robot, [c for c in cases if c.robot == robot]
    if cases:
        yield "all", list(cases)


def error_rows(cases: Sequence[Scored]) -> Table:
    """Relative errors by parameter."""
    rows = [["parameter", "count", "median", "90 %"]]
    pairs = [pair for c in cases for pair in c.parameter_errors]
    for name in (*sorted({name for name, _ in pairs}), ""):
        errors = [error for key, error in pairs if name in ("", key)]
        rows.append([name or "all", str(len(errors)), *_quantiles(errors)])
    return rows


def calibration_rows(additions: Iterable[Addition]) -> Table:
    """Mean stated confidence against the share that is right, by stated confidence."""
    given = list(additions)
    rows = [["stated", "count", "mean stated", "right", "right or imitation"]]
    stated = [(a.confidence, a) for a in given if a.confidence is not None]
    for low, high in pairwise(BINS):
        inside = [(p, a) for p, a in stated if low <= p < high or (high == BINS[-1] and p == high)]
        mean = float(np.mean([p for p, _ in inside])) if inside else None
        chosen = [a for _, a in inside]
        rows.append(
            [
                f"{low:g} to {high:g}",
                str(len(chosen)),
                _number(mean, ".3f"),
                _share(chosen, lambda a: a.right),
                _share(chosen, lambda a: a.right or a.imitation),
            ]
        )
    silent = [a for a in given if a.confidence is None]
    rows.append(
        ["none stated", str(len(silent)), "–", _share(silent, lambda a: a.right),
         _share(silent, lambda a: a.right or a.imitation)]
    )  # fmt: skip
    return rows


def _share(items: Sequence[T], hit: Callable[[T], bool]) -> str:
    hits = sum(map(hit, items))
    return f"{hits}/{len(items)} ({100 * hits / len(items):.0f} %)" if items else "–"


def _quantiles(values: Sequence[float]) -> tuple[str, str]:
    """Median and 90 % quantile."""
    if not values:
        return "–", "–"
    median, most = np.quantile(values, (0.5, 0.9))
    return f"{median:.3f}", f"{most:.3f}"


def _number(value: float | None, form: str) -> str:
    return "–" if value is None else format(value, form)


def _short(effect: str, joint: str | None) -> str:
    return f"{effect}:{joint}" if joint else effect
