"""Effects and the findings of a diagnosis as HTML: choice, hints, explanation cards, verdict."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from xml.etree import ElementTree

from flexviz.base.progress import BestSoFar
from flexviz.base.resources import data_dir
from flexviz.content.wording import (
    bounds_text,
    effect_text_name,
    effect_title,
    enters_text,
    escape,
    lower,
    parameter_text,
)
from flexviz.model.effects import EFFECTS, GOAL_EFFECT_NAMES, Effect
from flexviz.model.servo import SERVO_EFFECTS

COMMON_EFFECTS = tuple(name for name, effect in EFFECTS.items() if effect.common)
"""Always listed; the others are in folded sections."""
SERVO_ONLY = tuple(name for name in SERVO_EFFECTS if name in GOAL_EFFECT_NAMES)
"""Parts of the law of a servo that follows goals."""
SERVO_KIND = "Servo and its goal"

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


def suits(effect: str, goals: bool) -> bool:
    """Whether joints can have an effect: those that follow `goals`, or those whose torque was recorded."""
    return effect in SERVO_EFFECTS if goals else effect not in SERVO_ONLY


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


def so_far_html(best: BestSoFar | None, running: bool) -> str:
    """The best model of a search that runs or was stopped: not yet a verdict."""
    if best is None:
        return ""
    text = (best.running if running else best.stopped).text
    return f'<div class="fv fv-so-far">{escape(text[:1].upper() + text[1:])}</div>'
