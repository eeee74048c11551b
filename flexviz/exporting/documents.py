"""Results in files: the JSON of `identify` and `diagnose`, and an export's own parameters in JSON or YAML.

All of them hold a list of parameters; a diagnosis holds it, and its effects, under `model`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from flexviz.effects import EFFECTS
from flexviz.equation import INERTIAL_NAMES
from flexviz.errors import InputError, choose_from
from flexviz.model import EffectValue, FlexibleModel
from flexviz.schemas import input_error

LARGEST = 50_000_000  # bytes
SUFFIXES = (".json", ".yaml", ".yml")
VECTORS = ("stiffness", "motor_inertia", "link_viscous_friction", "motor_viscous_friction")

Number = Annotated[float, Field(allow_inf_nan=False)]


class Part(BaseModel):
    """Part of a result: further keys are allowed."""

    model_config = ConfigDict(extra="ignore", strict=True, frozen=True)


class Parameter(Part):
    """One parameter, as in the contract of `identify --json`."""

    name: str
    joint: str | None
    value: Number
    std: Number | None
    unit: str
    identifiable: Literal["yes", "weak", "no"]
    tied_to: list[str] = []
    at_bound: bool = False
    payload: str | None = None
    group: str | None = None

    @property
    def label(self) -> str:
        """`izz:joint1`, `payload_error.relative_mass_error:p2`"""
        return ":".join(part for part in (self.name, self.joint, self.payload, self.group) if part)


class Value(Part):
    """A value of an effect's parameter."""

    value: Number
    std: Number | None = None
    unit: str = ""


class PlacedEffect(Part):
    """An effect with its place and values."""

    effect: str
    joint: str | None = None
    group: str | None = None
    payload: str | None = None
    parameters: dict[str, Value]


class Model(Part):
    """A model in a diagnosis."""

    effects: list[PlacedEffect]
    parameters: list[Parameter]


class StepVerdict(Part):
    """What a diagnosis says of one of its models."""

    verdict: str


class Document(Part):
    """A result; `model` and `steps` are a diagnosis's, everything else may be missing there."""

    format: Literal[1]
    set: str
    set_sha256: str | None = None
    parameters: list[Parameter] | None = None
    effects: list[PlacedEffect] | None = None
    model: Model | None = None
    converged: bool = True
    stopped: bool = False
    refined: bool = False
    verdict: str | None = None
    steps: list[StepVerdict] = []
    groups: list[str] | None = None
    base_parameters: list[dict[str, Any]] = []
    observer: dict[str, Any] | None = None
    residual: dict[str, Any] | None = None
    notes: list[str] = []

    @property
    def all_parameters(self) -> list[Parameter]:
        """The parameters, wherever they stand."""
        return list(self.model.parameters if self.model is not None else self.parameters or [])

    @property
    def final_verdict(self) -> str | None:
        """Of the model that the parameters belong to; a diagnosis's `verdict` is of its first one."""
        return self.steps[-1].verdict if self.steps else self.verdict

    @property
    def all_effects(self) -> list[PlacedEffect] | None:
        """The effects where they are listed; None where only their parameters are."""
        return self.effects if self.model is None else self.model.effects


def read_result(file: Path) -> Document:
    """A result file.

    Raises:
        InputError: it is no such file, or something in it is not right; one line that says where.
    """
    if file.suffix.lower() not in SUFFIXES:
        raise InputError(f"is no result; {' or '.join(SUFFIXES[:2])} would be right", file=file)
    try:
        if file.stat().st_size > LARGEST:
            raise InputError("is larger than any result", file=file)
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read ({getattr(error, 'strerror', None) or error})", file=file) from None
    try:
        data = json.loads(text) if file.suffix.lower() == ".json" else _yaml(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"is not valid {file.suffix[1:].upper()} ({error})", file=file) from None
    return read_document(data, file)


def read_document(data: Any, file: Path) -> Document:
    """A result as it was read from `file`, checked."""
    if not isinstance(data, dict) or not {"parameters", "model"} & data.keys():
        raise InputError(
            'holds no "parameters"; what "flexviz identify --json", "flexviz diagnose --json" or '
            '"flexviz export" write would be right',
            file=file,
        )
    try:
        return Document.model_validate(data)
    except ValidationError as error:
        raise input_error(error, data, file) from None


def model_of(document: Document, joints: Sequence[str], file: str | Path) -> FlexibleModel:
    """The model that a document's parameters make.

    Raises:
        InputError: a parameter is missing, given twice, or belongs to a joint that the set does not have.
    """
    given: dict[str, float] = {}
    for p in document.all_parameters:
        if p.joint is not None and p.joint not in joints:
            found = f'parameter {p.name} of joint "{p.joint}", which the set does not have'
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


def _effects_of(parameters: Sequence[Parameter]) -> list[PlacedEffect]:
    """The effects that parameters called `<effect>.<parameter>` belong to, in their order."""
    found: dict[tuple[str | None, ...], dict[str, Value]] = {}
    for p in parameters:
        effect, dot, name = p.name.partition(".")
        if dot:
            key = (effect, p.joint, p.group, p.payload)
            found.setdefault(key, {})[name] = Value(value=p.value, std=p.std, unit=p.unit)
    return [
        PlacedEffect(effect=str(effect), joint=joint, group=group, payload=payload, parameters=values)
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
        raise InputError(f"effect {value.text}: parameters {found}; {', '.join(names)} are needed", file=file)


def _yaml(text: str) -> Any:
    from ruamel.yaml import YAML, YAMLError

    try:
        return YAML(typ="safe", pure=True).load(text)
    except YAMLError as error:
        raise ValueError(str(error)) from None


def plain(document: Mapping[str, Any]) -> Document:
    """A document made by this program itself."""
    return Document.model_validate(finite(document))


def finite(value: Any) -> Any:
    """The same with None for what is infinite or no number, which JSON does not have."""
    if isinstance(value, Mapping):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
