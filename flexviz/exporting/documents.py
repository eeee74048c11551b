"""The model that a results document describes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flexviz.effects import EFFECTS
from flexviz.equation import INERTIAL_NAMES
from flexviz.errors import InputError, choose_from
from flexviz.model import EffectValue, FlexibleModel
from flexviz.results import EffectEntry, ParameterEntry, ResultDocument, ValueEntry

VECTORS = ("stiffness", "motor_inertia", "link_viscous_friction", "motor_viscous_friction")


def model_of(document: ResultDocument, joints: Sequence[str], file: str | Path) -> FlexibleModel:
    """The model with a document's parameters.

    Raises:
        InputError: a parameter is missing, given twice, or belongs to a joint that the set does not have.
    """
    given: dict[str, float] = {}
    for p in document.all_parameters:
        if p.joint is not None and p.joint not in joints:
            found = f'parameter {p.name}: joint "{p.joint}" is not in the set'
            raise InputError(f"{found}; {choose_from(p.joint, joints)}", file=file)
        if p.label in given and "." not in p.name:
            raise InputError(f"parameter {p.label} is given twice", file=file)
        given[p.label] = p.value

    def value(name: str, joint: str) -> float:
        try:
            return given[f"{name}:{joint}"]
        except KeyError:
            raise InputError(f"parameter {name} of {joint} is missing", file=file) from None

    vectors = {name: np.array([value(name, j) for j in joints]) for name in VECTORS}
    inertial = np.array([[value(name, j) for name in INERTIAL_NAMES] for j in joints])
    effects = _effects_of(document.all_parameters) if document.all_effects is None else document.all_effects
    values = []
    for effect in effects:
        parameters = {name: float(v.value) for name, v in effect.parameters.items()}
        values.append(EffectValue(effect.effect, effect.joint, parameters, effect.group, effect.payload))
        _check_effect(values[-1], file)
    return FlexibleModel(tuple(joints), **vectors, inertial=inertial, effects=tuple(values))


def _effects_of(parameters: Sequence[ParameterEntry]) -> list[EffectEntry]:
    """The effects of parameters named `<effect>.<parameter>`, in their order."""
    found: dict[tuple[str | None, ...], dict[str, ValueEntry]] = {}
    for p in parameters:
        effect, dot, name = p.name.partition(".")
        if dot:
            key = (effect, p.joint, p.group, p.payload)
            found.setdefault(key, {})[name] = ValueEntry(value=p.value, std=p.std, unit=p.unit)
    return [
        EffectEntry(effect=str(effect), joint=joint, group=group, payload=payload, parameters=values)
        for (effect, joint, group, payload), values in found.items()
    ]


def _check_effect(value: EffectValue, file: str | Path) -> None:
    known = EFFECTS.get(value.effect)
    if known is None:
        raise InputError(
            f'effect "{value.effect}" does not exist; {choose_from(value.effect, EFFECTS, len(EFFECTS))}; '
            "load a user-defined effect with --effects-from",
            file=file,
        )
    names = [p.name for p in known.parameters]
    if set(value.parameters) != set(names):
        found = ", ".join(value.parameters) or "none"
        raise InputError(f"effect {value.text}: parameters {found}, expected {', '.join(names)}", file=file)
