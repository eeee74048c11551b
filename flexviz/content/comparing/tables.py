"""A comparison in blocks: tables, and what limits them."""

from __future__ import annotations

import math

from flexviz.content.blocks import Block, Paragraph, TableBlock, table
from flexviz.content.comparing.comparison import MARKED, ResultComparison, ResultSummary
from flexviz.content.records import JointErrors
from flexviz.content.wording import error_whole, interval_words
from flexviz.robot.model import INERTIAL_NAMES


def facts(found: ResultComparison) -> TableBlock:
    """Set, effects and verdict, one column per result."""
    rows = {
        "measurement set": [one.set_name for one in found.results],
        "its SHA-256": [one.set_sha256[:12] or "–" for one in found.results],
        "effects": [", ".join(one.effects) or "none" for one in found.results],
        "verdict": [one.verdict or "not diagnosed" for one in found.results],
        "fitted groups": [", ".join(one.groups) or "–" for one in found.results],
        "values from": [_source(one) for one in found.results],
    }
    head = ("", *(one.name for one in found.results))
    return table(head, [[title, *cells] for title, cells in rows.items()], fold=range(len(head)))


def _source(one: ResultSummary) -> str:
    """Where the parameters of a result come from."""
    if one.source != "identification":
        return one.source or "–"
    return f"identification, {one.observer} {one.tuning}" + (", refined" if one.refined else "")


def numbers(found: ResultComparison, inertial: bool = False) -> TableBlock:
    """Errors of each joint, and parameters with 95 % intervals and the difference of first and last.

    `inertial`: also the single inertial parameters of links, which are seldom identifiable.
    """
    rows = []
    labels = {"rms": "error, fitted", "rms_validation": "error, held out", "noise_floor": "error by noise"}
    for joint in dict.fromkeys(joint for one in found.results for joint in one.joints):
        for key, label in labels.items():
            rows.append([label, joint, *(_error(one, key, joint) for one in found.results), "", ""])
    for row in found.rows:
        if inertial or row.name not in INERTIAL_NAMES:
            cells = ["–" if e is None else interval_words(e) for e in row.estimates]
            apart = f"{row.deviations:.1f}" if math.isfinite(row.deviations) else "–"
            rows.append([row.name, row.place, *cells, apart + (" !" if row.differs else ""), row.unit])
    head = ("", "joint", *(one.name for one in found.results), "difference / std", "unit")
    return table(head, rows, range(2, len(head) - 1), fold=(0, 1, len(head) - 1))


def _error(one: ResultSummary, key: str, joint: str) -> str:
    """The error of a joint in per cent of its torque and in Nm."""
    rms = getattr(one, key)
    if joint not in one.joints or len(rms) != len(one.joints):
        return "–"
    errors = JointErrors(rms, one.torque_spread, (), one.torque_units)
    return error_whole(errors, one.joints.index(joint)).replace(errors.percent, "%")


def remarks(found: ResultComparison) -> list[str]:
    """What limits the comparison."""
    out = []
    if len({one.set_sha256 for one in found.results if one.set_sha256}) > 1:
        out.append("The results are of different data.")
    for one in found.results:
        if one.changed:
            changed = ", ".join(one.changed)
            out.append(f"{one.name}: {changed} changed since; its results belong to the previous data.")
        if not one.source:
            out.append(f"{one.name}: has no result for its current settings.")
    if len({one.source for one in found.results if one.source}) > 1:
        out.append("Parameters and errors come from different kinds of fit.")
    if any(row.differs for row in found.rows):
        out.append(
            f"!: first and last differ by {MARKED:.0f} standard errors or more, as if they were independent; "
            "for the same data even smaller differences are significant."
        )
    return out


def comparison_blocks(found: ResultComparison, inertial: bool = False) -> list[Block]:
    """All of a comparison."""
    return [facts(found), numbers(found, inertial), *map(Paragraph, remarks(found))]
