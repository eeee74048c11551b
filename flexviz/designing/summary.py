"""A design in lines of text."""

from __future__ import annotations

from flexviz.designing.run import Design
from flexviz.equation import INERTIAL_NAMES
from flexviz.results import interval
from flexviz.wording import effect_text_name, plural, unit_text

MOST_LIMITS = 3  # per group
FROM_PRIOR = 0.5  # share of a variance from the prior, above which the motion does not show a parameter


def summary_lines(design: Design) -> list[str]:
    """What to record, what it uses of the limits, and what it is expected to show."""
    lines = [f"{design.subject}: {plural(len(design.groups), 'group')}, seed {design.seed}"]
    for group in design.groups:
        planned = group.planned
        used = ", ".join(f"{one.limit} {100 * one.share:.0f} %" for one in group.used[:MOST_LIMITS])
        lines.append(f"  {planned.name}: payload {planned.payload}, {planned.duration:g} s; uses {used}")
    if design.beside:
        lines.append(f"  beside the recorded groups {', '.join(design.beside)}")
    lines.append("")
    unit = f" {design.unit}" if design.unit else ""
    random = f"a random motion within the limits {design.before:.3g}{unit}"
    lines.append(f"{design.criterion}: {design.value:.3g}{unit}, of {random}")
    lines += _separation(design)
    lines += ["", "Expected of identify --refine with these groups alone (± 95 %):"]
    rows, hidden = [], 0
    for error in design.errors:
        if error.prior_share > FROM_PRIOR or error.name in INERTIAL_NAMES:
            hidden += error.prior_share > FROM_PRIOR and error.name not in INERTIAL_NAMES
            continue
        value, width = interval(error.value, error.std)
        rows.append((error.label, value, f"± {width}", unit_text(error.unit)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)] if rows else []
    lines += ["  " + "  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
    if hidden:
        lines.append(f"({hidden} parameters that these motions do not show are left out)")
    if design.stopped:
        lines.append("stopped early: the best groups so far")
    return lines


def _separation(design: Design) -> list[str]:
    if not design.separates:
        return []
    first, second = (effect_text_name(text) for text in design.separates)
    lines = [
        f"  if {true} is the true one, it is expected to win over {false} by {gain:.3g} in log likelihood"
        for true, false, gain in ((first, second, design.gains[0]), (second, first, design.gains[1]))
    ]
    if design.recorded_gains:
        known = " and ".join(f"{gain:.3g}" for gain in design.recorded_gains)
        lines.append(f"  with the recorded groups alone: {known}")
    return lines
