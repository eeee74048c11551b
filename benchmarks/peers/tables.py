"""The comparison as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.peers.judging import KINDS, Judged
from benchmarks.peers.running import Method, Outcome, lines
from benchmarks.tables import markdown

NONE = "—"
MARK = " \\*"  # behind a value that its own program calls undetermined


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
    out = [heads]
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
        out.append(cells)
    return markdown(out)


def details(rows: Sequence[Row]) -> str:
    """The error of every quantity, one column per method that answered."""
    answered = [row for row in rows if row.judged]
    if not answered:
        return ""
    heads = ["", "truth", *(row.method.label for row in answered)]
    out = [heads]
    for k, one in enumerate(answered[0].judged):
        judged = [row.judged[k] for row in answered]
        errors = [percent(j.error) + MARK * j.undetermined for j in judged]
        out.append([one.quantity.name, f"{one.truth:.4g}", *errors])
    return markdown(out)
