"""Effects and the findings of a diagnosis as HTML: choice, hints, explanation cards, verdict."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from xml.etree import ElementTree

from flexviz.diagnosis import Diagnosis, Finding
from flexviz.effects import EFFECTS, Effect
from flexviz.resources import data_dir
from flexviz.wording import (
    absorbed_list,
    bounds_text,
    enters_text,
    escape,
    finding_name,
    parameter_text,
    share_text,
    tie_text,
    values_text,
    verdict_text,
)

COMMON_EFFECTS = tuple(name for name, effect in EFFECTS.items() if effect.common)
"""Always listed; the others are in folded sections."""

LIKELY_CONFIDENCE = 0.5  # a finding with at least this is highlighted
MAX_PICTURE_BYTES = 60_000
KINDS = {
    "motor": "Motor side",
    "sensing": "Recorded torque",
    "joint": "Elastic gear",
    "link": "Link side and load",
    "load": "Link side and load",
}


def addable_effects() -> tuple[str, ...]:
    """Names of the effects that can be added by name: all but episodes, whose times must be searched for."""
    return tuple(name for name, effect in EFFECTS.items() if effect.scope != "episode")


def more_effects() -> dict[str, tuple[str, ...]]:
    """Kind -> names of the less common effects."""
    groups: dict[str, tuple[str, ...]] = {}
    for where, kind in KINDS.items():
        names = tuple(n for n in addable_effects() if EFFECTS[n].where == where and n not in COMMON_EFFECTS)
        groups[kind] = (*groups.get(kind, ()), *names)
    return {kind: names for kind, names in groups.items() if names}


def effect_hint(effect: Effect) -> str:
    """An effect in a few sentences."""
    return f"{effect.title}. {effect.explanation} {effect.equation}"


def why_fixed(effect: str, own: Iterable[str], payloads: bool) -> str:
    """The reason why an effect can be neither added nor removed; empty if it can."""
    if effect in own:
        return "the measurement set names it, so it stays in"
    if EFFECTS[effect].scope == "payload" and not payloads:
        return "the set's groups carry no payload"
    return ""


def effects_note(names: Iterable[str], own: Iterable[str]) -> str:
    """Remarks on the effects of the model, one sentence each."""
    chosen = tuple(dict.fromkeys(name.partition(":")[0] for name in (*own, *names)))
    notes = []
    if own:
        notes.append(f"{', '.join(own)}: named by the measurement set, stays in.")
    for name in chosen:
        effect = EFFECTS[name]
        if effect.replaces in chosen:
            notes.append(f"{name} takes the place of {effect.replaces}.")
        if effect.beside is not None and not any(
            other == effect.beside or EFFECTS[other].replaces == effect.beside for other in chosen
        ):
            notes.append(f"{name} makes sense beside {effect.beside}.")
    return " ".join(notes)


@cache
def picture(name: str) -> str:
    """The effect's SVG picture from the documentation; empty if there is none."""
    file = data_dir("docs/effects") / f"{name}.svg"
    if name not in EFFECTS or not file.is_file() or file.stat().st_size > MAX_PICTURE_BYTES:
        return ""
    text = file.read_text(encoding="utf-8")
    try:
        ElementTree.fromstring(text)
    except ElementTree.ParseError:
        return ""
    return re.sub(r' width="480" height="\d+"', ' width="100%"', text, count=1)


def card_html(name: str) -> str:
    """The card of one effect, initially folded."""
    effect = EFFECTS.get(name)
    if effect is None:
        return ""
    rows = "".join(
        f"<tr><td>{escape(parameter_text(p))}</td><td>{escape(bounds_text(p))}</td>"
        f"<td>{escape(p.explanation)}</td></tr>"
        for p in effect.parameters
    )
    return (
        f'<div class="fv"><details class="fv-card"><summary>What is {escape(lower(effect.title))}?</summary>'
        f"<p>{escape(effect.explanation)}</p>"
        f'<pre class="fv-equation">{escape(effect.equation)}</pre>'
        f'<p class="fv-dim">{escape(enters_text(effect))}</p>'
        f'<table class="fv-table fv-left">{rows}</table>'
        f"{picture(name)}"
        f"<p><b>In a residual.</b> {escape(effect.signature)}</p>"
        f"<p><b>What confirms it.</b> {escape(effect.confirm)}</p>"
        f'<p class="fv-dim">{escape(effect.reference)}</p></details></div>'
    )


def lower(title: str) -> str:
    """A title inside a sentence; proper names keep their capital."""
    names = ("Coulomb", "Stribeck")
    return title if title.startswith(names) else title[:1].lower() + title[1:]


def verdict_html(diagnosis: Diagnosis | None, up_to_date: bool = True) -> str:
    """The verdict in its box, with notes and warnings."""
    if diagnosis is None:
        return (
            '<div class="fv fv-dim">Is the model complete? <b>Find the missing effect</b> identifies it if '
            "necessary, examines the residual, and tries every known effect.</div>"
        )
    shown = [note for note in diagnosis.notes if diagnosis.free_curve is None or note.kind != "free-curve"]
    notes = "".join(
        f'<div class="fv-dim">{escape(note.text[:1].upper() + note.text[1:])}.</div>' for note in shown
    )
    if diagnosis.stopped:
        notes += '<div class="fv-warn">Stopped before the end: these are the findings so far.</div>'
    if not up_to_date:
        notes += (
            '<div class="fv-warn">The model or the groups have changed since: press Find the missing effect.'
            "</div>"
        )
    return (
        f'<div class="fv fv-verdict {escape(diagnosis.verdict)}">{escape(verdict_text(diagnosis))}</div>'
        + (f'<div class="fv">{notes}</div>' if notes else "")
    )


def heading_html(diagnosis: Diagnosis | None) -> str:
    """The heading above findings of which none is credible."""
    if diagnosis is None or diagnosis.verdict == "missing" or not diagnosis.findings:
        return ""
    return '<div class="fv fv-dim">Tried, but not credible explanations of the residual:</div>'


def finding_html(finding: Finding, rank: int, full: bool) -> str:
    """A finding: name, values, share, confidence; with `full` also all ties and absorbing parameters."""
    likely = " fv-likely" if finding.confidence >= LIKELY_CONFIDENCE else ""
    values = values_text(finding)
    lines = [f"<div><b>{rank}. {escape(finding_name(finding))}</b></div>"]
    lines.append(
        f'<div class="fv-bar"><span style="width:{100 * min(max(finding.confidence, 0.0), 1.0):.0f}%"></span>'
        f"</div><div>confidence {share_text(finding.confidence)}, explains {share_text(finding.score)}</div>"
    )
    if values:
        lines.append(f"<div>{escape(values)}</div>")
    ties = finding.inseparable_from if full else finding.inseparable_from[:1]
    lines += [f'<div class="fv-warn">{escape(tie_text(tie))}</div>' for tie in ties]
    if full and finding.absorbed:
        named = escape(absorbed_list(finding.absorbed))
        lines.append(f'<div class="fv-dim">Was absorbed by other parameters: {named}.</div>')
    return f'<div class="fv fv-finding{likely}">{"".join(lines)}</div>'
