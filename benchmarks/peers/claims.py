"""What the comparison was to show: first or within noise in accuracy, 20 and 50 times as fast."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.peers.sets import Case
from benchmarks.peers.tables import Row, percent

FAST = (("mujoco_sysid", 20.0), ("trust_constr", 50.0))


@dataclass(frozen=True)
class Claim:
    """One claim on one set.

    Attributes:
        kind: "accuracy", "held out", or the name of the method whose time is compared.
        text: a sentence with the figures.
        met: None where the other method gave no result.
    """

    kind: str
    text: str
    met: bool | None


def claims(case: Case, rows: Sequence[Row]) -> list[Claim]:
    """All claims that the rows of one set can decide."""
    mine = ours(case, rows)
    peers = [row for row in rows if not row.method.name.startswith("flexviz") and row.outcome.answer]
    if mine is None or not peers:
        return []
    found = [accuracy(mine, peers)] if mine.judged else []
    best = min(peers, key=lambda row: row.held_out)
    first = mine.held_out <= best.held_out
    figures = f"{percent(mine.held_out)} % against {percent(best.held_out)} % of {best.method.label}"
    text = f"Held-out error: {mine.method.label} {'first' if first else 'not first'}, {figures}."
    found.append(Claim("held out", text, first))
    plain = next((r for r in rows if r.method.name == "flexviz_identify" and r.outcome.answer), mine)
    for name, times in FAST:
        one = plain if name == "trust_constr" else mine  # the same equation, neither refined
        found += [faster(one, row, times) for row in rows if row.method.name == name and timed(row)]
    return found


def ours(case: Case, rows: Sequence[Row]) -> Row | None:
    """flexviz as one would use it: `diagnose` where something is hidden, else `identify --refine`."""
    name = "flexviz_diagnose" if case.hidden else "flexviz_refine"
    return next((row for row in rows if row.method.name == name and row.outcome.answer), None)


def timed(row: Row) -> bool:
    """Whether the method has run."""
    return bool(np.isfinite(row.outcome.cpu))


def faster(one: Row, other: Row, times: float) -> Claim:
    """How many times as fast flexviz is, with the start of the interpreter and without."""
    assert one.outcome.answer is not None
    ratio = other.outcome.cpu / one.outcome.cpu
    ended = other.outcome.answer is not None
    if not ended and ratio < 1:
        text = f"Speed: {other.method.label} failed at once: nothing to compare."
        return Claim(other.method.name, text, None)
    met = ratio >= times if ended or ratio >= times else None
    mark = {True: "met", False: "not met", None: "open, it gave no result"}[met]
    least = "" if ended else "at least "
    text = f"Speed: {one.method.label} {least}{ratio:.1f} times as fast as {other.method.label} in CPU time, "
    text += f"start included (claim {times:.0f}: {mark})"
    if other.outcome.answer is not None:
        own = other.outcome.answer["computing"] / one.outcome.answer["computing"]
        text += f"; computing alone {own:.0f} times"
    return Claim(other.method.name, text + ".", met)


def accuracy(mine: Row, peers: Sequence[Row]) -> Claim:
    """Of how many quantities flexviz's error is the smallest, or larger by less than its own interval."""
    first, alone, near, behind = 0, 0, 0, []
    for k, judged in enumerate(mine.judged):
        others = [(row.judged[k].error, row.method.label) for row in peers]
        best, by = min(((e, label) for e, label in others if e is not None), default=(np.inf, ""))
        error = np.inf if judged.error is None else judged.error
        if error <= best:
            first += 1
            alone += not np.isfinite(best)
        elif error - best <= judged.noise:
            near += 1
        else:
            behind.append(f"{judged.quantity.name} ({percent(error)} % against {percent(best)} % of {by})")
    total = len(mine.judged)
    text = f"Accuracy: {mine.method.label} first in {first} of {total} quantities"
    text += f" ({alone} that no other method gave)" if alone else ""
    text += f", within noise in {near}"
    return Claim("accuracy", text + (f"; behind in {', '.join(behind)}." if behind else "."), not behind)


def overall(found: Iterable[tuple[str, Sequence[Claim]]]) -> list[str]:
    """Per claim: the sets on which it is met, not met, or open."""
    titles = {
        "accuracy": "First or within noise in every quantity",
        "held out": "Smallest held-out error",
        "mujoco_sysid": "At least 20 times as fast as mujoco.sysid",
        "trust_constr": "At least 50 times as fast as trust-constr",
    }
    by_set = list(found)
    lines = []
    for kind, title in titles.items():
        parts = []
        for met, word in ((True, "met on"), (False, "not met on"), (None, "open on")):
            names = [name for name, all_ in by_set for c in all_ if c.kind == kind and c.met is met]
            if names:
                parts.append(f"{word} {', '.join(names)}")
        lines.append(f"{title}: {'; '.join(parts) or 'not measured'}.")
    return lines
