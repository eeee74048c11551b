"""The report in Markdown: a table of classes, recorded robots, calibration, and where two commands differ."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.measuring_stick.judging import Judgement, judge
from benchmarks.measuring_stick.recorded import HEAD as RECORDED_HEAD
from benchmarks.measuring_stick.recorded import recorded_rows
from benchmarks.measuring_stick.running import read_result
from benchmarks.measuring_stick.sets import CLASSES, StickSet

Judged = dict[str, dict[str, Judgement]]  # set's key → command → judgement

SURE = 0.9  # confidence from which the table of classes counts
BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0)  # of stated confidence
HEAD = """| class | command | sets | found | false | right | verdict right | first right | held out × | \
value error, 90 % | stated ≥ .9 | CPU [s] | CPU × | most MB |
|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"""


def report(work: Path, sets: Sequence[StickSet], names: Sequence[str]) -> str:
    """The whole report of the commands with these names."""
    judged = judgements(work, sets, names)
    both = [one for one in sets if len(judged[one.key]) == len(names)]
    parts = [
        f"{len(both)} of {len(sets)} sets have a result of every command",
        "",
        class_table(both, names, judged),
    ]
    recorded = recorded_rows(work, [one for one in sets if one.kind == "real"], names)
    if recorded:
        parts += ["", "Recorded robots: held-out rms while moving, last model", "", RECORDED_HEAD, *recorded]
    parts += ["", "Stated confidence: how many, share right", "", calibration(both, names, judged)]
    for first, second in pairwise(names):
        parts += ["", f"Sets on which {first} and {second} differ", *differences(both, first, second, judged)]
    if len(names) == 1:
        parts += ["", "Sets that are not right", *wrong(both, names[0], judged)]
    return "\n".join(parts)


def judgements(work: Path, sets: Sequence[StickSet], names: Sequence[str]) -> Judged:
    """Every result that is there."""
    out: Judged = {}
    for one in sets:
        results = {name: read_result(work, name, one.key) for name in names}
        out[one.key] = {name: judge(one, result) for name, result in results.items() if result is not None}
    return out


def class_table(sets: Sequence[StickSet], names: Sequence[str], judged: Judged) -> str:
    """A row for each class and command, and the sums."""
    rows = [HEAD]
    for kind in (*CLASSES, ""):
        chosen = [one.key for one in sets if kind in ("", one.kind)]
        costs = {name: sum(judged[key][name].cpu for key in chosen) for name in names}
        for name in names if chosen else ():
            cells = class_cells([judged[key][name] for key in chosen])
            cells.insert(-1, f"{costs[name] / max(costs[names[0]], 1e-12):.2f}")
            rows.append("| " + " | ".join([kind or "all", name, *cells]) + " |")
    return "\n".join(rows)


def class_cells(given: Sequence[Judgement]) -> list[str]:
    """Figures of some sets: from their number to the largest memory, without the ratio of times."""
    must, missed = sum(len(j.must) for j in given), sum(len(j.missed) for j in given)
    errors = [error for j in given for error in j.value_errors]
    sure = [right for j in given for p, right in j.stated if p >= SURE]
    return [
        str(len(given)),
        f"{must - missed}/{must}" if must else "–",
        str(sum(len(j.false) for j in given)) if any(j.right is not None for j in given) else "–",
        share(j.right for j in given),
        share(j.verdict_right for j in given),
        share(j.first_right for j in given),
        quantile([j.held_out for j in given if j.held_out is not None], 0.5),
        f"{quantile(errors, 0.5)}, {quantile(errors, 0.9)}" if errors else "–",
        share(sure),
        f"{sum(j.cpu for j in given):.0f}",
        f"{max(j.peak for j in given):.0f}",
    ]


def calibration(sets: Sequence[StickSet], names: Sequence[str], judged: Judged) -> str:
    """Stated confidence of what was added against how often it is right."""
    rows = ["| stated | " + " | ".join(names) + " |", "|---|" + "---|" * len(names)]
    for low, high in pairwise(BINS):
        cells = []
        for name in names:
            pairs = [pair for one in sets for pair in judged[one.key][name].stated]
            cells.append(share(r for p, r in pairs if low <= p < high or p == high == BINS[-1]))
        rows.append(f"| {low:g} to {high:g} | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def differences(sets: Sequence[StickSet], first: str, second: str, judged: Judged) -> list[str]:
    """What both said, where it is not the same."""
    lines = []
    for one in sets:
        a, b = judged[one.key][first], judged[one.key][second]
        if a.said != b.said:
            mark = " (worse)" if a.right and not b.right else " (better)" if b.right and not a.right else ""
            lines += [f"- {one.key}{mark}", f"    - {first}: {words(a)}", f"    - {second}: {words(b)}"]
    return lines or ["none"]


def wrong(sets: Sequence[StickSet], name: str, judged: Judged) -> list[str]:
    """What was said where it is not right."""
    found = [(one.key, judged[one.key][name]) for one in sets]
    return [f"- {key}: {words(j)}" for key, j in found if j.right is False] or ["none"]


def words(judgement: Judgement) -> str:
    """A judgement in a line."""
    if judgement.error is not None:
        return judgement.error.splitlines()[-1]
    out = [f"{judgement.verdict}{' (wrong)' if judgement.verdict_right is False else ''}"]
    out.append(f"added {', '.join(judgement.added) or 'nothing'}")
    for label, items in (("missed", judgement.missed), ("false", judgement.false)):
        out += [f"{label} {', '.join(items)}"] if items else []
    return "; ".join(out)


def share(hits: Iterable[bool | None]) -> str:
    """How many of those that are asked."""
    asked = [hit for hit in hits if hit is not None]
    return f"{sum(asked)}/{len(asked)}" if asked else "–"


def quantile(values: Sequence[float], part: float) -> str:
    """A quantile, or a dash."""
    return f"{np.quantile(values, part):.3g}" if values else "–"
