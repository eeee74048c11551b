"""The comparison as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.peers.judging import KINDS, Judged
from benchmarks.peers.running import Method, Outcome, lines
from benchmarks.peers.sets import Case

NONE = "—"


@dataclass(frozen=True)
class Row:
    """One method on one set.

    Attributes:
        method, outcome: which, and how it ended.
        judged: every quantity beside its truth; empty without a truth or an answer.
        held_out: mean over joints, rms ÷ spread; nan without an answer.
    """

    method: Method
    outcome: Outcome
    judged: tuple[Judged, ...] = ()
    held_out: float = float("nan")

    def worst(self, kind: str) -> float | None:
        """Largest relative error of one kind; None if the method does not estimate all of that kind."""
        found = [j.error for j in self.judged if j.quantity.kind == kind]
        return None if not found or None in found else max(e for e in found if e is not None)


def percent(share: float | None) -> str:
    """A share in per cent with two significant figures."""
    if share is None or not np.isfinite(share):
        return NONE
    if share > 10:
        return "> 1000"
    return np.format_float_positional(100 * share, precision=2, fractional=False, trim="-")


def number(value: float, digits: int = 0) -> str:
    """A number, or a dash."""
    return f"{value:.{digits}f}" if np.isfinite(value) else NONE


def summary(rows: Sequence[Row]) -> str:
    """One line per method."""
    kinds = [k for k in KINDS if any(j.quantity.kind == k for row in rows for j in row.judged)]
    heads = ["method", *(f"{k} [%]" for k in kinds), "held out [%]"]
    heads += ["CPU [s]", "computing [s]", "wall [s]", "evaluations", "MB", "lines"]
    out = [line(heads), line(["---", *["---:"] * (len(heads) - 1)])]
    for row in rows:
        done = row.outcome
        cells = [row.method.label]
        if done.answer is None:
            cells += [done.failure, *[NONE] * len(kinds), number(done.cpu, 1), NONE, number(done.wall, 1)]
            cells += [NONE, number(done.megabytes), str(lines(row.method))]
        else:
            ended = "" if done.answer["converged"] else " (not converged)"
            cells = [row.method.label + ended, *(percent(row.worst(k)) for k in kinds), percent(row.held_out)]
            cells += [number(done.cpu, 1), number(done.answer["computing"], 1), number(done.wall, 1)]
            cells += [str(done.answer["evaluations"]), number(done.megabytes), str(lines(row.method))]
        out.append(line(cells))
    return "\n".join(out)


def details(rows: Sequence[Row]) -> str:
    """The error of every quantity, one column per method that answered."""
    answered = [row for row in rows if row.judged]
    if not answered:
        return ""
    heads = ["", "truth", *(row.method.label for row in answered)]
    out = [line(heads), line(["---", *["---:"] * (len(heads) - 1)])]
    for k, one in enumerate(answered[0].judged):
        errors = [percent(row.judged[k].error) for row in answered]
        out.append(line([one.quantity.name, f"{one.truth:.4g}", *errors]))
    return "\n".join(out)


def line(cells: Sequence[str]) -> str:
    """A row of a Markdown table."""
    return "| " + " | ".join(cells) + " |"


def ours(case: Case, rows: Sequence[Row]) -> Row | None:
    """flexviz as one would use it: `diagnose` where something is hidden, else `identify --refine`."""
    name = "flexviz_diagnose" if case.hidden else "flexviz_refine"
    return next((row for row in rows if row.method.name == name and row.outcome.answer), None)


def findings(case: Case, rows: Sequence[Row]) -> list[str]:
    """What the set says of the claims: accuracy first or within noise, 20 and 50 times as fast."""
    mine = ours(case, rows)
    peers = [row for row in rows if not row.method.name.startswith("flexviz") and row.outcome.answer]
    if mine is None or not peers:
        return []
    found = [accuracy(mine, peers)] if mine.judged else []
    best = min(peers, key=lambda row: row.held_out)
    place = "first" if mine.held_out <= best.held_out else "not first"
    found.append(
        f"Held-out error: {mine.method.label} {place}, {percent(mine.held_out)} % against "
        f"{percent(best.held_out)} % of {best.method.label}."
    )
    plain = next((r for r in rows if r.method.name == "flexviz_identify" and r.outcome.answer), mine)
    for name, times, one in (("mujoco_sysid", 20, mine), ("trust_constr", 50, plain)):
        found += [faster(one, row, times) for row in rows if row.method.name == name]
    return [text for text in found if text]


def faster(one: Row, other: Row, times: float) -> str:
    """How many times as fast flexviz is, with the start of the interpreter and without."""
    if one.outcome.answer is None or not np.isfinite(other.outcome.cpu):
        return ""
    ratio = other.outcome.cpu / one.outcome.cpu
    least = "at least " if other.outcome.answer is None else ""
    met = "met" if ratio >= times else "not met" if other.outcome.answer else "open"
    own = other.outcome.answer and other.outcome.answer["computing"] / one.outcome.answer["computing"]
    alone = f"; computing alone {own:.0f} times" if own else ""
    text = (
        f"Speed: {one.method.label} is {least}{ratio:.1f} times as fast as {other.method.label} in CPU time"
    )
    return f"{text}, start included (claim {times}: {met}){alone}."


def accuracy(mine: Row, peers: Sequence[Row]) -> str:
    """Of how many quantities flexviz's error is the smallest, or larger by less than its own interval."""
    first, near, behind = 0, 0, []
    for k, judged in enumerate(mine.judged):
        others = [(row.judged[k].error, row) for row in peers]
        best, by = min(((e, row.method.label) for e, row in others if e is not None), default=(np.inf, ""))
        error = np.inf if judged.error is None else judged.error
        if error <= best:
            first += 1
        elif error - best <= judged.noise:
            near += 1
        else:
            behind.append(f"{judged.quantity.name} ({percent(error)} % against {percent(best)} % of {by})")
    text = (
        f"Accuracy: {mine.method.label} first in {first} of {len(mine.judged)} quantities, within noise in "
    )
    return text + f"{near}" + (f"; behind in {', '.join(behind)}." if behind else ".")
