"""Pydantic models of the files people write, and one-line errors for what does not fit them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo

from flexviz.base.errors import InputError, choose_from

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Text = Annotated[str, Field(min_length=1)]

# pydantic's type of error -> what was expected, with the names in its context
_EXPECTED = {
    "string_type": "a text in quotes",
    "string_too_short": "a text that is not empty",
    "float_type": "a number",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "dataclass_type": "a table",
    "finite_number": "a finite number",
    "greater_than": "a number above {gt:g}",
    "greater_than_equal": "a number of at least {ge:g}",
    "less_than_equal": "a number of at most {le:g} (is the unit right?)",
    "literal_error": "{expected}",
}


class StrictTable(BaseModel):
    """A TOML table: unknown keys and values of another type are refused."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, defer_build=True)


Model = TypeVar("Model", bound=BaseModel)


def validate(model: type[Model], data: dict[str, Any], file: Path, version: int) -> Model:
    """Check the content of a file of format `version`; `file` is what errors call it."""
    found = data.get("format", version)
    if found != version or isinstance(found, bool):
        message = f"found {shown(found)}, this program reads format {version}"
        raise InputError(message, file=file, place="format")
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise input_error(error, data, file, model) from None


def input_error(
    error: ValidationError, data: dict[str, Any], file: Path | None = None, model: Any = None
) -> InputError:
    """One line for the first of pydantic's errors, saying how many more there are.

    `model` tells which keys a table may have where one is unknown; a field's description is the hint where it
    is missing.
    """
    errors = error.errors(include_url=False)
    # an unknown key is often a misspelt one that is then also missing: name the unknown one first
    first = min(errors, key=lambda item: item["type"] != "extra_forbidden")
    location, kind, context = first["loc"], first["type"], first.get("ctx", {})
    found = shown(first.get("input"))
    if kind == "extra_forbidden":
        keys = [field.alias or name for name, field in fields_at(model, location[:-1]).items()]
        message = f'unknown key "{location[-1]}"; {choose_from(str(location[-1]), keys)}'
    elif kind == "missing":
        field = fields_at(model, location[:-1]).get(str(location[-1]))
        hint = f", expected {field.description}" if field is not None and field.description else ""
        message = f"this key is missing{hint}"
    elif kind in ("too_short", "too_long"):
        expected = context.get("min_length", context.get("max_length"))
        at_least = "at least " if len(location) == 1 else ""
        message = f"{context.get('actual_length')} values, expected {at_least}{expected}"
    elif kind in _EXPECTED:
        expected = _EXPECTED[kind].format(**context).replace("'", '"')
        message = f"found {found}, expected {expected}"
    else:
        message = f"found {found}: {first['msg']}"
    more = f" (and {len(errors) - 1} more to correct)" if len(errors) > 1 else ""
    return InputError(message + more, file=file, place=place_of(location, data))


def place_of(location: Sequence[str | int], data: dict[str, Any]) -> str:
    """A key path as a person reads it: `group 4 "g4", payload`, `payloads.p2.bodies, entry 1, com`."""
    parts: list[str] = []
    value: Any = data
    for step in location:
        try:
            value = value[step]
        except (KeyError, IndexError, TypeError):
            value = None
        if isinstance(step, str):
            if parts and not parts[-1].startswith(("group ", "log ", "entry ")):
                parts[-1] += f".{step}"
            else:
                parts.append(step)
        elif parts in (["groups"], ["logs"]):
            table = value if isinstance(value, dict) else {}
            name = table.get("name", table.get("group"))
            parts = [f"{parts[0][:-1]} {step + 1}" + (f' "{name}"' if isinstance(name, str) else "")]
        else:
            parts.append(f"entry {step + 1}")
    return ", ".join(parts)


def fields_at(model: Any, location: Sequence[str | int]) -> dict[str, FieldInfo]:
    """The fields of the table at this location of `model`."""
    kind = model
    for step in location:
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            kind = next((f.annotation for n, f in kind.model_fields.items() if step in (n, f.alias)), None)
        else:  # list[X] or dict[str, X]
            kind = next(reversed(get_args(kind)), None)
        if get_origin(kind) in (Union, UnionType):
            kind = get_args(kind)[0]
    return getattr(kind, "model_fields", {})


def first_repeated(names: Iterable[str]) -> str | None:
    """The first name that occurs more than once."""
    return next((name for name, count in Counter(names).items() if count > 1), None)


def shown(value: Any, limit: int = 60) -> str:
    """A value as an error message shows it."""
    text = f'"{value}"' if isinstance(value, str) else "a table" if isinstance(value, dict) else repr(value)
    text = {"True": "true", "False": "false"}.get(text, text)
    return text if len(text) <= limit else text[: limit - 1] + "…"
