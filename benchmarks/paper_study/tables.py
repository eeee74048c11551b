"""Rows of text: compact tables for the screen, full ones for the page."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.paper_study.methods import CAUSAL, EQUAL_50, PAPER, REFINED, ZERO, Method, Outcome
from benchmarks.paper_study.seeds import Statistics
from benchmarks.paper_study.truth import CLASSES, Row
from benchmarks.tables import Table
from flexviz.base.statistics import NORMAL_95

COMPACT_HEAD = [
    "method",
    *(f"{kind} %" for kind in CLASSES),
    "worst error/std",
    "in 95 %",
    "yes/weak/no",
    "condition",
    "residual Nm",
    "held out Nm",
]


def compact(outcomes: Sequence[Outcome]) -> Table:
    """One group from one start: a line a method."""
    best, best_held_out = by_residual(outcomes), by_residual(outcomes, held_out=True)
    rows = [COMPACT_HEAD]
    for o in outcomes:
        rows.append(
            [
                o.method.label + ("" if o.converged else " (not converged)"),
                *(percent(o.worst([kind])) for kind in CLASSES),
                f"{o.worst_score:.1f}",
                f"{o.covered}/{len(o.rows)}",
                o.marks(),
                f"{o.condition:.0f}",
                f"{o.rms:.4f}" + (" least" if o is best else ""),
                f"{o.rms_validation:.4f}" + (" least" if o is best_held_out else ""),
            ]
        )
    return rows


def by_residual(outcomes: Sequence[Outcome], held_out: bool = False) -> Outcome:
    """The causal observer with the least torque residual: how the paper chooses w."""
    causal = [o for o in outcomes if o.method in CAUSAL]
    return min(causal, key=lambda o: o.rms_validation if held_out else o.rms)


def full(outcomes: Sequence[Outcome]) -> Table:
    """One group from one start: every parameter with its 95 % interval, for the main methods."""
    chosen: list[Method] = [PAPER, by_residual(outcomes).method, EQUAL_50, ZERO, REFINED]
    kept = [next(o for o in outcomes if o.method == m) for m in dict.fromkeys(chosen)]
    rows = [["parameter", "truth", *(o.method.label for o in kept)]]
    for i, row in enumerate(kept[0].rows):
        cells = [f"{row.truth:g} {row.unit}", *(cell(o.rows[i]) for o in kept)]
        rows.append([row.label, *cells])
    rows.append(["condition number", "", *(f"{o.condition:.0f}" for o in kept)])
    return rows


def cell(row: Row) -> str:
    """ "999.98 ± 0.02", with its mark unless "yes"; no interval where the parameter is at a bound."""
    mark = "" if row.identifiable == "yes" else f" {row.identifiable}"
    half = NORMAL_95 * row.std
    if not half < 1e3 * max(abs(row.value), abs(row.truth)):
        return f"{row.value:.4g}{mark}"
    digits = max(0, min(7, 2 - _magnitude(half)))
    return f"{row.value:.{digits}f} ± {half:.{digits}f}{mark}"


def _magnitude(x: float) -> int:
    """Power of ten of the leading digit, plus one."""
    return int(f"{x:e}".split("e")[1]) + 1 if x > 0 else 0


def statistics(values: Sequence[Statistics]) -> Table:
    """A line a parameter."""
    rows = [
        [
            "parameter",
            "truth",
            "bias",
            "bias %",
            "bias/spread",
            "spread",
            "reported",
            "in 95 %",
            "spread/bound",
        ]
    ]
    for s in values:
        rows.append(
            [
                s.label,
                f"{s.truth:g}",
                f"{s.bias:+.1e}",
                f"{100 * s.bias / s.truth:+.4f}",
                f"{s.bias / s.spread:+.2f}",
                f"{s.spread:.2e}",
                f"{s.claimed:.2e}",
                f"{s.coverage:.0%}",
                f"{s.ratio:.2f}",
            ]
        )
    return rows


def percent(share: float) -> str:
    """0.0123 → "1.23"; three digits at most."""
    value = 100 * share
    return f"{value:.0f}" if value >= 99.5 else f"{value:.2g}" if value < 1 else f"{value:.3g}"
