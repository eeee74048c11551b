"""Which effects a model has, on which joints: from what a user or a measurement set names."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from flexviz.effects.names import EFFECT_NAMES
from flexviz.errors import InputError, choose_from


@dataclass(frozen=True)
class ChosenEffect:
    """One effect on one joint of the model (index in the set's joint order)."""

    effect: str
    joint: int


def choose_effects(wanted: Iterable[str], joints: tuple[str, ...]) -> tuple[ChosenEffect, ...]:
    """Resolve `name` (every joint) and `name:joint`; repeated ones count once.

    Raises:
        InputError: for an unknown effect or joint, or one that this version cannot identify yet.
    """
    from flexviz.effects import EFFECTS

    chosen: dict[ChosenEffect, None] = {}
    for text in wanted:
        name, _, joint = text.partition(":")
        if name not in EFFECTS:
            if name in EFFECT_NAMES:
                raise InputError(
                    f'effect "{name}" can be simulated but not identified yet; {choose_from(name, EFFECTS)}'
                )
            raise InputError(f'effect "{name}" does not exist; {choose_from(name, EFFECTS)}')
        if joint and joint not in joints:
            raise InputError(
                f'effect "{text}": joint "{joint}" is not in the set; {choose_from(joint, joints)}'
            )
        for index in range(len(joints)):
            if not joint or joints[index] == joint:
                chosen[ChosenEffect(name, index)] = None
    return tuple(chosen)
