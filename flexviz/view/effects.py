"""The effects a person can add to a model by name, in the order and with the words of the screen."""

from __future__ import annotations

from collections.abc import Iterable

from flexviz.effects import EFFECTS, Effect

COMMON_EFFECTS = tuple(name for name, effect in EFFECTS.items() if effect.common)
"""The ones always in sight."""

KINDS = {
    "motor": "Motor side",
    "sensing": "Recorded torque",
    "joint": "Elastic gear",
    "link": "Link side and load",
    "load": "Link side and load",
}


def addable_effects() -> tuple[str, ...]:
    """Names of the effects that can be added by name: not those that happen at an instant nobody named."""
    return tuple(name for name, effect in EFFECTS.items() if effect.scope != "episode")


def more_effects() -> dict[str, tuple[str, ...]]:
    """Kind -> names of the effects that are not among the common ones."""
    groups: dict[str, tuple[str, ...]] = {}
    for where, kind in KINDS.items():
        names = tuple(n for n in addable_effects() if EFFECTS[n].where == where and n not in COMMON_EFFECTS)
        groups[kind] = (*groups.get(kind, ()), *names)
    return {kind: names for kind, names in groups.items() if names}


def effect_hint(effect: Effect) -> str:
    """What an effect is, in a few sentences."""
    return f"{effect.title}. {effect.explanation} {effect.equation}"


def why_fixed(effect: str, own: Iterable[str], payloads: bool) -> str:
    """Why an effect can be neither added nor taken out, or ""."""
    if effect in own:
        return "the measurement set names it, so it stays in"
    if EFFECTS[effect].scope == "payload" and not payloads:
        return "the set's groups carry no payload"
    return ""


def effects_note(names: Iterable[str], own: Iterable[str]) -> str:
    """What else to know about these effects of the model, one sentence each."""
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
