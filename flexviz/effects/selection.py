"""Which effects a model has, and where: from what a user or a measurement set names."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from flexviz.effects.base import Place
from flexviz.errors import InputError, choose_from


@dataclass(frozen=True)
class ChosenEffect:
    """One effect of the model.

    Attributes:
        effect: its name.
        joint: index in the set's joint order; None where it belongs to no joint.
        group: the only group it acts in (episodes).
        payload: the payload it concerns.
    """

    effect: str
    joint: int | None = None
    group: str | None = None
    payload: str | None = None

    @property
    def place(self) -> Place:
        return Place(self.joint, self.group, self.payload)


def choose_effects(
    wanted: Iterable[str], joints: Sequence[str], payloads: Sequence[str] = ()
) -> tuple[ChosenEffect, ...]:
    """Resolve `name` (everywhere) and `name:joint` or `name:payload`; repeated ones count once.

    Args:
        wanted: what was asked for.
        joints: names of the set's joints.
        payloads: names of its payloads that are not empty.

    Raises:
        InputError: for an unknown effect, joint or payload, or an effect that has to be searched for.
    """
    from flexviz.effects import EFFECTS

    chosen: dict[ChosenEffect, None] = {}
    for text in wanted:
        name, _, where = text.partition(":")
        if name not in EFFECTS:
            raise InputError(f'effect "{name}" does not exist; {choose_from(name, EFFECTS)}')
        effect = EFFECTS[name]
        if name == "motor_coupling" and len(joints) == 1:
            raise InputError(f'effect "{text}" needs a neighbouring joint, the set has one joint')
        if effect.scope == "episode":
            raise InputError(
                f'effect "{text}" happens at an instant nobody named; "flexviz diagnose" searches for it'
            )
        if effect.scope == "set":
            if where:
                raise InputError(f'effect "{text}" belongs to no joint; write "{name}"')
            chosen[ChosenEffect(name)] = None
        elif effect.scope == "payload":
            if where and where not in payloads:
                raise InputError(
                    f'effect "{text}": payload "{where}" is not in the set; {choose_from(where, payloads)}'
                )
            for payload in payloads:
                if not where or payload == where:
                    chosen[ChosenEffect(name, payload=payload)] = None
        else:
            if where and where not in joints:
                raise InputError(
                    f'effect "{text}": joint "{where}" is not in the set; {choose_from(where, joints)}'
                )
            for index, joint in enumerate(joints):
                if not where or joint == where:
                    chosen[ChosenEffect(name, index)] = None
    replaced = {(EFFECTS[c.effect].replaces, c.joint) for c in chosen}
    return tuple(c for c in chosen if (c.effect, c.joint) not in replaced)
