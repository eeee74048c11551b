"""What was found and added wrongly, at which cost, and how far stated confidences and intervals hold."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from benchmarks.diagnosis_study.judging import Addition, Judgement, Value
from benchmarks.tables import NONE, Table, markdown, number, percent, plain, quantile, quantiles, share

BINS = (0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0)  # of stated confidence
SURE = 0.9  # confidence from which the table of classes counts
Judged = Mapping[str, Mapping[str, Judgement]]  # command → set → judgement


def report(judged: Judged, classes: Mapping[str, str]) -> list[str | Table]:
    """Texts and tables; `classes` names the class of every set, in their order."""
    names = list(judged)
    both = [key for key in classes if all(key in judged[name] for name in names)]
    answers = sum(all(judged[name][key].error is None for name in names) for key in both)
    parts: list[str | Table] = [
        f"{len(both)} of {len(classes)} sets have a result of every command, {answers} an answer",
        class_rows(judged, {key: classes[key] for key in both}),
    ]
    for name in names:
        chosen = [judged[name][key] for key in both]
        additions = [a for j in chosen for a in j.additions]
        parts += [
            f"{name}: found by effect, and what is too small or weak to be demanded", found_rows(chosen),
            f"{name}: false additions; imitations stand on a joint with an unmodelled torque",
            false_rows(chosen),
            f"{name}: errors of the values, and how many 95 % intervals contain the truth",
            value_rows([value for j in chosen for value in j.values]),
            f"{name}: stated confidence of what was added, and how much of it is hidden there",
            calibration_rows(additions),
        ]  # fmt: skip
    for first, second in pairwise(names):
        told = differences(judged[first], judged[second], both, (first, second))
        parts.append("\n".join([f"Sets on which {first} and {second} differ", *told]))
    if len(names) == 1:
        parts.append("\n".join(f"- {key}: {judged[names[0]][key].words}" for key in both))
    return parts


def text(parts: Sequence[str | Table], in_markdown: bool = False) -> str:
    """The report as text, or in Markdown."""
    drawn = markdown if in_markdown else plain
    return "\n\n".join(part if isinstance(part, str) else drawn(part) for part in parts)


def class_rows(judged: Judged, classes: Mapping[str, str]) -> Table:
    """A row for each class and command, and the sums."""
    names = list(judged)
    rows = [["class", "command", "sets", "found", "false", "right", "verdict right", "first right",
             "held out ×", "value error, 90 %", f"stated ≥ {SURE:g}", "CPU [s]",
             "most", "CPU ×", "most MB"]]  # fmt: skip
    for kind in (*dict.fromkeys(classes.values()), ""):
        keys = [key for key in classes if kind in ("", classes[key])]
        costs = {name: sum(judged[name][key].cpu for key in keys) for name in names}
        for name in names if keys else ():
            cells = class_cells([judged[name][key] for key in keys])
            cells.insert(-1, f"{costs[name] / max(costs[names[0]], 1e-12):.2f}")
            rows.append([kind or "all", name, *cells])
    return rows


def class_cells(given: Sequence[Judgement]) -> list[str]:
    """Figures of some sets: from their number to the largest memory, without the ratio of times."""
    must, missed = sum(len(j.must) for j in given), sum(len(j.missed) for j in given)
    errors = quantiles([error for j in given for error in j.effect_errors])
    asked = [j for j in given if j.asked]
    sure = [a.right for j in given for a in j.additions if a.confidence is not None and a.confidence >= SURE]
    counts = [
        share(j.right for j in asked),
        share(j.verdict_right for j in asked),
        share(j.first_right for j in given if j.must),
    ]
    return [
        str(len(given)),
        f"{must - missed}/{must}" if must else NONE,
        str(sum(len(j.false) for j in given)) if asked else NONE,
        *(f"{one.hits}/{one.count}" if one.count else NONE for one in counts),
        number(quantile([j.held_out for j in given if j.held_out is not None], 0.5)),
        NONE if NONE in errors else ", ".join(errors),
        f"{sum(sure)}/{len(sure)}" if sure else NONE,
        f"{sum(j.cpu for j in given):.0f}",
        f"{max(j.cpu for j in given):.0f}",
        f"{max(j.peak for j in given):.0f}",
    ]


def found_rows(given: Sequence[Judgement]) -> Table:
    """Found of all, by kind of effect."""
    hidden = [e for j in given for e in j.hidden]
    rows = [["effect", "must found", "others found"]]
    for name in (*sorted({e.effect for e in hidden}), ""):
        chosen = [e for e in hidden if name in ("", e.effect)]
        cells = [share(e.found for e in chosen if e.must is must).text for must in (True, False)]
        rows.append([name or "all", *cells])
    return rows


def false_rows(given: Sequence[Judgement]) -> Table:
    """Additions that are not hidden, by kind."""
    false = Counter(name.partition(":")[0] for j in given for name in j.false)
    imitations = Counter(name.partition(":")[0] for j in given for name in j.imitations)
    rows = [["effect", "false", "imitations"]]
    for name in sorted({*false, *imitations}, key=lambda name: (-false[name], name)):
        rows.append([name, str(false[name]), str(imitations[name])])
    total = max(len(given), 1)
    return [*rows, ["per set", f"{false.total() / total:.2f}", f"{imitations.total() / total:.2f}"]]


def value_rows(values: Sequence[Value], best: Sequence[Value] = ()) -> Table:
    """Relative errors by name, beside those of a fit that is given the hidden effects."""
    head = ["value", "count", "median", "nine in ten", "within 95 % interval"]
    rows = [[*head, *(["given the effects: median", "nine in ten"] if best else [])]]
    for name in sorted({value.name for value in values}):
        chosen = [value for value in values if value.name == name]
        errors = [[value.error for value in some if value.name == name] for some in (values, best)]
        cells = [[percent(quantile(one, q)) for q in (0.5, 0.9)] for one in errors]
        inside = share(chosen, lambda value: value.covered).text
        rows.append([name, str(len(chosen)), *cells[0], inside, *(cells[1] if best else [])])
    return rows


def calibration_rows(additions: Iterable[Addition]) -> Table:
    """Mean stated confidence against the share that is right, by stated confidence."""
    given = list(additions)
    rows = [["stated", "count", "mean stated", "right", "right or imitation"]]
    for low, high in pairwise(BINS):
        chosen = [a for a in given if a.confidence is not None and within(a.confidence, low, high)]
        stated = [a.confidence for a in chosen if a.confidence is not None]
        mean = float(np.mean(stated)) if stated else None
        rows.append([f"{low:g} to {high:g}", str(len(chosen)), number(mean, ".3f"), *_right(chosen)])
    silent = [a for a in given if a.confidence is None]
    return [*rows, ["none stated", str(len(silent)), NONE, *_right(silent)]]


def within(confidence: float, low: float, high: float) -> bool:
    """Whether it is in a bin; the last one contains its end."""
    return low <= confidence < high or confidence == high == BINS[-1]


def _right(additions: Sequence[Addition]) -> tuple[str, str]:
    return share(a.right for a in additions).text, share(a.right or a.imitation for a in additions).text


def differences(
    first: Mapping[str, Judgement],
    second: Mapping[str, Judgement],
    keys: Iterable[str],
    names: tuple[str, str],
) -> list[str]:
    """What both said, where it is not the same."""
    lines = []
    for key in keys:
        a, b = first[key], second[key]
        if a.said != b.said:
            mark = "" if not a.asked or a.right == b.right else " (worse)" if a.right else " (better)"
            lines += [
                f"- {key}{mark}",
                *(f"    - {n}: {j.words}" for n, j in zip(names, (a, b), strict=True)),
            ]
    return lines or ["none"]
