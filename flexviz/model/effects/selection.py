"""The effects of a model and their text form.

In text an effect is its name and its place: `coulomb_friction:joint1`, `payload_error:p2` (a payload),
`base_tilt` (the whole set), `external_contact:joint1@g2` (a joint, during part of one group).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from flexviz.base.errors import InputError, choose_from
from flexviz.model.effects.effect import Effect
from flexviz.model.effects.registry import EFFECTS
from flexviz.model.effects.terms import EffectTarget
from flexviz.robot.model import EffectValue


@dataclass(frozen=True)
class ChosenEffect:
    """One effect of the model.

    Attributes:
        effect: its name.
        joint, group, payload: as in `EffectTarget`.
    """

    effect: str
    joint: int | None = None
    group: str | None = None
    payload: str | None = None

    @property
    def place(self) -> EffectTarget:
        return EffectTarget(self.joint, self.group, self.payload)

    def value(self, joints: Sequence[str], parameters: dict[str, float] | None = None) -> EffectValue:
        """The effect with its joint's name, for a model."""
        joint = None if self.joint is None else joints[self.joint]
        return EffectValue(self.effect, joint, dict(parameters or {}), self.group, self.payload)

    def text(self, joints: Sequence[str]) -> str:
        """The text that `choose_effects` reads as this effect."""
        return self.value(joints).text

    @staticmethod
    def of(value: EffectValue, joints: Sequence[str]) -> ChosenEffect:
        """The chosen effect of a model's `EffectValue`; InputError for a joint that does not exist."""
        if value.joint is not None and value.joint not in joints:
            valid = choose_from(value.joint, joints)
            raise InputError(f'effect "{value.text}": joint "{value.joint}" is not in the set; {valid}')
        joint = None if value.joint is None else list(joints).index(value.joint)
        return ChosenEffect(value.effect, joint, value.group, value.payload)


def choose_effects(
    wanted: Iterable[str], joints: Sequence[str], payloads: Sequence[str] = (), groups: Sequence[str] = ()
) -> tuple[ChosenEffect, ...]:
    """Resolve `name` (everywhere), `name:joint`, `name:payload` and `name:joint@group`.

    Duplicates count once; an effect that another one replaces on its joint, or that acts on all joints as
    well, is left out.

    Args:
        wanted: texts of effects.
        joints, groups: names of the set's joints and groups.
        payloads: names of its payloads that are not empty.

    Raises:
        InputError: for an unknown effect, joint, payload or group, or an episode without a place.
    """
    chosen: dict[ChosenEffect, None] = {}
    for text in wanted:
        where = text.partition(":")[2]
        chosen |= dict.fromkeys(_places(text, named_effect(text), where, joints, payloads, groups))
    replaced = {(EFFECTS[c.effect].replaces, c.joint) for c in chosen}
    return tuple(c for c in chosen if (c.effect, c.joint) not in replaced and not everywhere(c, chosen))


def everywhere(one: ChosenEffect, others: Iterable[ChosenEffect]) -> bool:
    """Whether an effect of one joint is also among others on all joints at once, and so has no place."""
    same = (other for other in others if other.effect == one.effect)
    return any(EFFECTS[one.effect].replaced_by(one.place, other.place) for other in same)


def named_effect(text: str, file: str | Path | None = None) -> Effect:
    """The effect that a text (of `file`) refers to, wherever it acts; InputError if there is none."""
    name = text.partition(":")[0]
    if name not in EFFECTS:
        raise InputError(
            f'effect "{name}" does not exist; {choose_from(name, EFFECTS, len(EFFECTS))}; '
            "load a user-defined effect with --effects-from",
            file=file,
        )
    return EFFECTS[name]


def _places(
    text: str,
    effect: Effect,
    where: str,
    joints: Sequence[str],
    payloads: Sequence[str],
    groups: Sequence[str],
) -> list[ChosenEffect]:
    """All effects that one text refers to."""
    name = effect.name
    if len(joints) < effect.fewest_joints:
        raise InputError(f'effect "{text}" needs a neighbouring joint, the set has one joint')
    if effect.scope == "episode":
        return [_episode(text, name, where, joints, groups)]
    if effect.scope == "set" and not (where and effect.joint_optional):
        if where:
            raise InputError(f'effect "{text}" belongs to no joint; write "{name}"')
        return [ChosenEffect(name)]
    if effect.scope == "payload":
        if where and where not in payloads:
            meant = choose_from(where, payloads)
            raise InputError(f'effect "{text}": payload "{where}" is not carried in the set; {meant}')
        return [ChosenEffect(name, payload=p) for p in payloads if where in ("", p)]
    joint = where.partition("@")[0]
    if where not in joints and joint in joints:
        raise InputError(f'effect "{text}" acts in every group of the set; write "{name}:{joint}"')
    if where and where not in joints:
        raise InputError(f'effect "{text}": joint "{where}" is not in the set; {choose_from(where, joints)}')
    if where:
        return [ChosenEffect(name, list(joints).index(where))]
    return [ChosenEffect(name, target.joint) for target in effect.targets(len(joints), payloads)]


def _episode(text: str, name: str, where: str, joints: Sequence[str], groups: Sequence[str]) -> ChosenEffect:
    """`joint@group`; names may contain an @ themselves, so every split is tried."""
    parts = where.split("@")
    for k in range(1, len(parts)):
        joint, group = "@".join(parts[:k]), "@".join(parts[k:])
        if joint in joints and group in groups:
            return ChosenEffect(name, list(joints).index(joint), group)
    example = f'"{name}:{joints[0] if joints else "joint"}@{groups[0] if groups else "group"}"'
    joint, _, group = where.partition("@")
    if joint and joint not in joints:
        raise InputError(f'effect "{text}": joint "{joint}" is not in the set; {choose_from(joint, joints)}')
    if group:
        raise InputError(f'effect "{text}": group "{group}" is not in the set; {choose_from(group, groups)}')
    missing = "group" if joint else "joint and group"
    raise InputError(
        f'effect "{text}" acts in one group: name the {missing}, as in {example}; "flexviz diagnose" finds it'
    )
