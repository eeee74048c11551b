"""The effects of a model joint by joint: joints × effects as a table, and what a tick changes."""

from __future__ import annotations

from collections.abc import Sequence

from flexviz.content.view.effects import SERVO_ONLY, addable_effects, suits
from flexviz.content.wording import effect_title, escape, short_names
from flexviz.model.effects import EFFECTS

OWN, ADDED = "●", "✓"
SHORT_HEAD = 3  # characters of the head of a column that is not set upright


def joint_effects(goals: bool = False) -> tuple[str, ...]:
    """Names of the effects that a single joint may have; `goals`: one that follows them."""
    known = (*addable_effects(), *(SERVO_ONLY if goals else ()))
    return tuple(name for name in known if EFFECTS[name].scope == "joint" and suits(name, goals))


def joints_with(effect: str, effects: Sequence[str], joints: Sequence[str]) -> tuple[str, ...]:
    """The joints that have an effect in a model; "name" stands for all of them."""
    return tuple(joint for joint in joints if effect in effects or f"{effect}:{joint}" in effects)


def with_joints(
    effect: str, chosen: Sequence[str], effects: Sequence[str], joints: Sequence[str]
) -> tuple[str, ...]:
    """The effects with this one on the `chosen` joints and no others."""
    own = {effect, *(f"{effect}:{joint}" for joint in joints)}
    others = tuple(text for text in effects if text not in own)
    if len(set(chosen)) == len(joints):
        return (*others, effect)
    return (*others, *(f"{effect}:{joint}" for joint in joints if joint in chosen))


def matrix_html(own: Sequence[str], added: Sequence[str], joints: Sequence[str]) -> str:
    """The model at a glance: a row for each of its effects, a column for each joint."""
    names = dict.fromkeys(text.partition(":")[0] for text in (*own, *added))
    names = [name for name in names if name in EFFECTS and EFFECTS[name].scope == "joint"]
    if not names:
        return ""
    rows = []
    for name in names:
        fixed, ticked = joints_with(name, own, joints), joints_with(name, added, joints)
        cells = (OWN if joint in fixed else ADDED if joint in ticked else "·" for joint in joints)
        row = "".join(f"<td>{cell}</td>" for cell in cells)
        rows.append(f"<tr><td>{escape(effect_title(name))}</td>{row}</tr>")
    head, tall = joint_heads(joints)
    return (
        f'<div class="fv"><table class="fv-table fv-heat fv-matrix{tall}"><tr><th></th>{head}</tr>'
        f"{''.join(rows)}</table>"
        f'<div class="fv-dim">{ADDED} in the model, {OWN} named by the set.</div></div>'
    )


def joint_heads(joints: Sequence[str]) -> tuple[str, str]:
    """The heads of a column for each joint, and the class of a table in which they are set upright.

    Numbers if the joints' names differ in nothing else, otherwise short names.
    """
    stems = [joint.rstrip("0123456789") for joint in joints]
    numbers = [joint.removeprefix(stem) for joint, stem in zip(joints, stems, strict=True)]
    heads = numbers if len(set(stems)) == 1 and all(numbers) else short_names(tuple(joints))
    cells = (
        f'<th title="{escape(joint)}">{escape(short)}</th>'
        for joint, short in zip(joints, heads, strict=True)
    )
    return "".join(cells), " fv-tall" if max(map(len, heads)) > SHORT_HEAD else ""
