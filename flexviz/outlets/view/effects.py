"""Effects and the findings of a diagnosis as HTML: choice, hints, explanation cards, verdict."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import cache
from xml.etree import ElementTree

from flexviz.analysis.diagnosis import Diagnosis, Finding
from flexviz.base.progress import BestSoFar
from flexviz.base.resources import data_dir
from flexviz.content.results import hints
from flexviz.content.wording import (
    LIKELY,
    SAID_AS_SHARES,
    TRACE_TITLE,
    MergedFinding,
    absorbed_list,
    added_families,
    bounds_text,
    capitalised,
    confidence_of,
    confidence_range,
    decoys_text,
    effect_text_name,
    effect_title,
    enters_text,
    escape,
    kinds_text,
    lower,
    moved,
    parameter_text,
    removes_text,
    tie_text,
    told_moves,
    values_text,
    verdict_text,
    what_stays,
)
from flexviz.model.effects import EFFECTS, Effect

COMMON_EFFECTS = tuple(name for name, effect in EFFECTS.items() if effect.common)
"""Always listed; the others are in folded sections."""

MAX_PICTURE_BYTES = 60_000
REFUSED = 8  # refused moves in the table of the search
DECREASE = "decrease of the objective [nats]"
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
    """An effect in a few sentences, and its name in files and commands."""
    return f"{effect.explanation} {effect.equation} (In files and commands: {effect.name}.)"


def by_title(names: Iterable[str]) -> dict[str, str]:
    """Title → name of each effect, for a list to choose from; with the name where two share a title."""
    names = list(names)
    titles = [effect_title(name) for name in names]
    return {
        title if titles.count(title) == 1 else f"{title} ({name})": name
        for title, name in zip(titles, names, strict=True)
    }


def why_fixed(effect: str, own: Iterable[str], payloads: bool) -> str:
    """The reason why an effect can be neither added nor removed; empty if it can."""
    if effect in own:
        return "part of the measurement set, stays in"
    if EFFECTS[effect].scope == "payload" and not payloads:
        return "the set's groups carry no payload"
    return ""


def effects_note(names: Iterable[str], own: Iterable[str]) -> str:
    """Remarks on the effects of the model, one sentence each."""
    chosen = tuple(dict.fromkeys(name.partition(":")[0] for name in (*own, *names)))
    notes = []
    if own:
        notes.append(f"{', '.join(map(effect_text_name, own))}: part of the measurement set, stays in.")
    for name in chosen:
        effect = EFFECTS[name]
        if effect.replaces in chosen:
            notes.append(f"{effect.title} replaces {effect_title(effect.replaces)}.")
        if effect.beside is not None and not any(
            other == effect.beside or EFFECTS[other].replaces == effect.beside for other in chosen
        ):
            notes.append(f"{effect.title} needs {effect_title(effect.beside)} in the model, too.")
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


def verdict_html(
    diagnosis: Diagnosis | None,
    up_to_date: bool = True,
    joints: Sequence[str] = (),
    spread: Sequence[float] = (),
) -> str:
    """The verdict in its box, with notes and warnings; `spread` is that of the joints' torque [Nm]."""
    if diagnosis is None:
        return (
            '<div class="fv fv-dim">Fits the model and tries every known effect on what it leaves '
            "unexplained.</div>"
        )
    worst, left = what_stays(joints, diagnosis.steps[-1] if diagnosis.steps else None, spread)
    skipped = (*(SAID_AS_SHARES if spread else ()), *(["free-curve"] if diagnosis.free_curve else []))
    verdict = verdict_text(diagnosis, joints=joints, worst=worst)
    told = [n.text for n in diagnosis.notes if n.kind not in skipped and n.text not in verdict]
    if not up_to_date:
        return (
            f'<div class="fv fv-verdict fv-old"><s>{escape(verdict)}</s><div class="fv-warn">of an earlier '
            "model · look again: press Find the missing effect</div></div>"
        )
    texts = [*([left] if left and diagnosis.verdict == "unknown" else []), *told]
    notes = "".join(f'<div class="fv-dim">{escape(capitalised(text))}.</div>' for text in texts)
    notes += "".join(f'<div class="fv-warn">{escape(hint)}</div>' for hint in hints(diagnosis.parameters))
    if diagnosis.stopped:
        notes += '<div class="fv-warn">Stopped before the end: these are the findings so far.</div>'
    return f'<div class="fv fv-verdict {escape(diagnosis.verdict)}">{escape(verdict)}</div>' + (
        f'<div class="fv">{notes}</div>' if notes else ""
    )


def so_far_html(best: BestSoFar | None, running: bool) -> str:
    """The best model of a search that runs or was stopped: not yet a verdict."""
    if best is None:
        return ""
    text = best.running if running else best.stopped
    return f'<div class="fv fv-so-far">{escape(text[:1].upper() + text[1:])}</div>'


def heading_html(diagnosis: Diagnosis | None) -> str:
    """The heading above findings of which none is credible."""
    if diagnosis is None or diagnosis.verdict == "missing" or not diagnosis.findings:
        return ""
    return '<div class="fv fv-dim">Tried, but not credible explanations of the residual:</div>'


def finding_html(merged: MergedFinding[Finding], rank: int, full: bool, joints: Sequence[str] = ()) -> str:
    """A finding: name, values, share, confidence; with `full` also all ties and absorbing parameters.

    Of effects of one kind on several `joints` the values are folded.
    """
    members = merged.members
    likely = min(map(confidence_of, members))
    lines = [f"<div><b>{rank}. {escape(merged.statement(joints))}</b></div>"]
    lines.append(
        f'<div class="fv-bar"><span style="width:{100 * min(max(likely, 0.0), 1.0):.0f}%"></span>'
        f"</div><div>confidence {confidence_range(members)}, {escape(removes_text(merged))}</div>"
    )
    if merged.tied:
        lines.append(f'<div class="fv-dim">{escape(kinds_text(members[0]))}</div>')
    if len(members) == 1:
        values = values_text(members[0])
        lines += [f"<div>{escape(values)}</div>"] if values else []
        ties = members[0].inseparable_from if full else members[0].inseparable_from[:1]
        lines += [f'<div class="fv-warn">{escape(tie_text(tie))}</div>' for tie in ties]
    else:
        lines.append(f"<details><summary>Values per joint</summary>{_member_rows(merged, joints)}</details>")
    absorbed = moved(members)
    if full and absorbed:
        named = escape(absorbed_list(absorbed))
        lines.append(f'<div class="fv-dim">Other parameters had absorbed it: {named}.</div>')
    mark = " fv-likely" if likely >= LIKELY else ""
    return f'<div class="fv fv-finding{mark}">{"".join(lines)}</div>'


def _member_rows(merged: MergedFinding[Finding], joints: Sequence[str]) -> str:
    rows = []
    for one in merged.by_joint(joints):
        ties = ", ".join(lower(effect_title(tie.effect)) for tie in one.inseparable_from)
        hard = f" (hard to tell from {ties})" if ties else ""
        rows.append(f"<div>{escape(one.joint)}: {escape(values_text(one) + hard)}</div>")
    return "".join(rows)


def trace_html(diagnosis: Diagnosis | None, joints: Sequence[str] = ()) -> str:
    """Accepted and best refused moves, folded; empty where none are kept."""
    if diagnosis is None or not diagnosis.trace:
        return ""
    moves = told_moves(diagnosis.trace, joints, added_families(diagnosis), refused=REFUSED)
    rows = "".join(
        f"<tr><td>{'✓' if move.accepted else '–'} {escape(move.text)}</td><td>{escape(move.delta)}</td>"
        f"<td>{escape(move.why)}</td></tr>"
        for move in moves
    )
    decoys = "" if diagnosis.decoys is None else f"<p>{capitalised(decoys_text(diagnosis.decoys))}.</p>"
    return (
        f'<div class="fv"><details class="fv-card"><summary>{TRACE_TITLE}</summary>'
        f'<table class="fv-table fv-left"><tr><th>move</th><th title="{DECREASE}">Δ [nats]</th><th></th></tr>'
        f'{rows}</table>{decoys}<p class="fv-dim">✓ accepted, – refused; Δ: {DECREASE}.</p></details></div>'
    )
