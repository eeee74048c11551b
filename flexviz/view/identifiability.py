"""What the data can identify, in a sentence, before and after a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from flexviz.wording import INERTIAL, SYMBOLS, escape, plain_name, plural

if TYPE_CHECKING:
    from flexviz.identification import Identification, ParameterEstimate

NAMED = 8  # parameters named at most


def parameter_name(p: ParameterEstimate) -> str:
    """ "K joint1"."""
    return f"{SYMBOLS.get(p.name, plain_name(p.name))} {p.joint or ''}".strip()


def listed(parameters: Sequence[ParameterEstimate]) -> str:
    """Their names, not more than a reader wants."""
    names = [parameter_name(p) for p in parameters[:NAMED]]
    more = len(parameters) - NAMED
    return ", ".join(names) + (f" and {plural(more, 'other')}" if more > 0 else "")


def check_html(result: Identification | None) -> str:
    """How many parameters can be identified, and which cannot; inertial ones are counted only.

    Single inertial parameters are seldom identifiable, their combinations are what counts.
    """
    if result is None:
        return ""
    main = [p for p in result.parameters if p.name not in INERTIAL]
    weak = [p for p in main if p.identifiable == "weak"]
    no = [p for p in main if p.identifiable == "no"]
    if not weak and not no:
        text = f"All {len(main)} parameters of joints and effects can be identified."
    else:
        good = len(main) - len(weak) - len(no)
        text = f"{good} of {len(main)} parameters of joints and effects can be identified."
    lines = [f"<div>{text}</div>"]
    if weak:
        lines.append(f'<div class="fv-warn">Weak: {escape(listed(weak))}.</div>')
    if no:
        lines.append(f'<div class="fv-warn">Not identifiable: {escape(listed(no))}.</div>')
    combinations = getattr(result, "combinations", ())
    if combinations:
        good = sum(c.identifiable == "yes" for c in combinations)
        lines.append(f'<div class="fv-dim">Inertia: {good} of {len(combinations)} combinations.</div>')
    return f'<div class="fv"><b>Checked with these groups and effects</b>{"".join(lines)}</div>'
