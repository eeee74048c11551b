"""The shape of `measurements.toml`, and one-line errors for everything in it that is not right."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from flexviz.effects.names import known_names
from flexviz.errors import InputError, choose_from

FILE_NAME = "measurements.toml"
FORMAT = 1
LONGEST_HOLD = 0.1  # [s] a longer hold of the torque can only be a wrong unit

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Text = Annotated[str, Field(min_length=1)]


class Table(BaseModel):
    """A TOML table: unknown keys and values of another type are refused."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class Initial(Table):
    """Rough start values, one a joint."""

    stiffness: list[Positive] | None = None  # [Nm/rad]
    motor_inertia: list[Positive] | None = None  # [kg m²]


class Controller(Table):
    """Gains of the controller that ran during the recording, one a joint."""

    kp: list[NotNegative]  # [Nm/rad]
    kd: list[NotNegative]  # [Nm s/rad]


class Model(Table):
    """What the model starts with."""

    effects: list[Text] = []


class Body(Table):
    """A rigid body on a link; com and inertia are in the link's frame."""

    link: Text
    mass: NotNegative  # [kg]
    com: Annotated[list[Number], Field(min_length=3, max_length=3)]  # [m]
    inertia: Annotated[list[Number], Field(min_length=6, max_length=6)]  # Ixx Iyy Izz Ixy Ixz Iyz [kg m²]


class Payload(Table):
    """A known payload."""

    bodies: list[Body]


class GroupEntry(Table):
    """One trajectory run with one payload, in one file."""

    name: Text
    trajectory: Text
    payload: Text
    file: Text
    validation: bool = False


class MeasurementFile(Table):
    """All of `measurements.toml`."""

    format: int
    robot: Text
    joints: Annotated[list[Text], Field(min_length=1)]
    torque_hold: Annotated[float, Field(ge=0.0, le=LONGEST_HOLD)] = 0.0  # [s]
    initial: Initial = Initial()
    controller: Controller | None = None
    model: Model = Model()
    payloads: dict[str, Payload] = {}
    groups: Annotated[list[GroupEntry], Field(min_length=1)]


def locate(path: str | Path) -> Path:
    """The `measurements.toml` that `path` (a set's folder, or the file itself) stands for."""
    file = Path(path)
    try:
        file = file / FILE_NAME if file.is_dir() else file
        found = file.is_file()
    except (OSError, ValueError) as error:
        raise InputError(
            f"cannot be opened ({getattr(error, 'strerror', None) or error})", file=file
        ) from None
    if not found:
        raise InputError(f"file not found; a measurement set is a folder with {FILE_NAME}", file=file)
    if file.suffix != ".toml":
        raise InputError(f"not a measurement set; a folder with {FILE_NAME} would be right", file=file)
    return file


def read_file(file: Path) -> MeasurementFile:
    """Read and check a `measurements.toml` by itself (neither the robot nor the tables are opened)."""
    try:
        data = tomllib.loads(file.read_bytes().decode("utf-8-sig").replace("\r\n", "\n"))
    except UnicodeDecodeError as error:
        found = f"byte {error.start} is {error.object[error.start]:#04x}"
        raise InputError(f"not a text in UTF-8 ({found})", file=file) from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"not valid TOML: {error}", file=file) from None
    except RecursionError:
        raise InputError("not a usable TOML: its tables are nested too deeply", file=file) from None
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=file) from None
    return parse(data, file)


def parse(data: dict[str, Any], file: Path) -> MeasurementFile:
    """Check the content of a `measurements.toml`; `file` is what errors call it."""
    version = data.get("format", FORMAT)
    if version != FORMAT or isinstance(version, bool):
        message = f"found {shown(version)}, this program reads format {FORMAT}"
        raise InputError(message, file=file, place="format")
    try:
        content = MeasurementFile.model_validate(data)
    except ValidationError as error:
        raise translated(error, data, file) from None
    check_consistency(content, file)
    return content


def check_consistency(content: MeasurementFile, file: Path) -> None:
    """Checks between keys: list lengths, names used twice, names that do not exist."""

    def refuse(place: str, message: str) -> None:
        raise InputError(message, file=file, place=place)

    n = len(content.joints)
    if twice := repeated(content.joints):
        refuse("joints", f'"{twice}" is listed twice, each joint once would be right')
    lists: dict[str, Sequence[float] | None] = {
        "initial.stiffness": content.initial.stiffness,
        "initial.motor_inertia": content.initial.motor_inertia,
    }
    if content.controller is not None:
        lists |= {"controller.kp": content.controller.kp, "controller.kd": content.controller.kd}
    for place, values in lists.items():
        if values is not None and len(values) != n:
            refuse(place, f"{len(values)} values for {n} joints, one a joint ({n}) would be right")
    for effect in content.model.effects:
        if effect not in known_names():
            meant = choose_from(effect, known_names(), limit=len(known_names()))
            own = "give the file of one of your own with --effects-from"
            refuse("model.effects", f'effect "{effect}" is not known; {meant}; {own}')
    if twice := repeated(content.model.effects):
        refuse("model.effects", f'"{twice}" is listed twice, each effect once would be right')
    if twice := repeated(group.name for group in content.groups):
        refuse("groups", f'two groups are called "{twice}", a name of its own for each would be right')
    for index, group in enumerate(content.groups):
        if group.payload not in content.payloads:
            meant = choose_from(group.payload, content.payloads)
            refuse(
                f'group {index + 1} "{group.name}", payload',
                f'payload "{group.payload}" is not defined; {meant}',
            )


def repeated(names: Iterable[str]) -> str | None:
    """The first name that occurs a second time."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    return None


# -- pydantic's errors in the project's words --------------------------------------------------------

_WANTED = {
    "string_type": "a text in quotes",
    "string_too_short": "a text that is not empty",
    "float_type": "a number",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "list_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "finite_number": "a finite number",
}


def translated(
    error: ValidationError,
    data: dict[str, Any],
    file: Path,
    keys: Callable[[Sequence[str | int]], list[str]] | None = None,
) -> InputError:
    """One line for the first of pydantic's errors, saying how many more there are.

    `keys` gives the keys that the table at a location may have; None: those of a `measurements.toml`.
    """
    errors = error.errors(include_url=False)
    # an unknown key is often a misspelt one that is then also missing: name the unknown one first
    first = min(errors, key=lambda item: item["type"] != "extra_forbidden")
    place = place_of(first["loc"], data)
    kind, context, found = first["type"], first.get("ctx", {}), first.get("input")
    if kind == "extra_forbidden":
        parent, key = first["loc"][:-1], str(first["loc"][-1])
        message = f'unknown key "{key}"; {choose_from(key, (keys or keys_of)(parent))}'
    elif kind == "missing":
        message = "this key is missing"
    elif kind in ("too_short", "too_long"):
        wanted = context.get("min_length", context.get("max_length"))
        at_least = "at least " if first["loc"] in (("joints",), ("groups",)) else ""
        message = f"{context.get('actual_length')} values, {at_least}{wanted} would be right"
    elif kind in _WANTED:
        message = f"found {shown(found)}, {_WANTED[kind]} would be right"
    elif kind in ("greater_than", "greater_than_equal", "less_than_equal"):
        limit = context.get("gt", context.get("ge", context.get("le")))
        word = {"greater_than": "above", "greater_than_equal": "at least"}.get(kind, "at most")
        unit = " s (is the unit right?)" if kind == "less_than_equal" else ""
        message = f"found {shown(found)}, a number {word} {limit:g}{unit} would be right"
    else:
        message = f"found {shown(found)}: {first['msg']}"
    more = f" (and {len(errors) - 1} more to correct)" if len(errors) > 1 else ""
    return InputError(message + more, file=file, place=place)


def place_of(location: Sequence[str | int], data: dict[str, Any]) -> str:
    """A key path as a person reads it: `group 4 "g4", payload`, `payloads.p2.bodies, entry 1, com`."""
    parts: list[str] = []
    value: Any = data
    for step in location:
        value = value[step] if isinstance(value, dict) and step in value else at_index(value, step)
        if isinstance(step, int):
            named = value.get("name") if isinstance(value, dict) else None
            if parts == ["groups"]:
                parts = [f"group {step + 1}" + (f' "{named}"' if isinstance(named, str) else "")]
            else:
                parts.append(f"entry {step + 1}")
        elif parts and not parts[-1].startswith(("group ", "entry ")):
            parts[-1] += f".{step}"
        else:
            parts.append(str(step))
    return ", ".join(parts)


def at_index(value: Any, step: str | int) -> Any:
    """`value[step]` where that exists, else None."""
    return value[step] if isinstance(value, list) and isinstance(step, int) and step < len(value) else None


def keys_of(parent: Sequence[str | int]) -> list[str]:
    """The keys that the table at this location may have."""
    tables: dict[tuple[str, ...], type[Table]] = {
        (): MeasurementFile,
        ("initial",): Initial,
        ("controller",): Controller,
        ("model",): Model,
        ("payloads", "*"): Payload,
        ("payloads", "*", "bodies"): Body,
        ("groups",): GroupEntry,
    }
    names = tuple(str(step) for step in parent if not isinstance(step, int))
    if len(names) > 1 and names[0] == "payloads":
        names = ("payloads", "*", *names[2:])
    return list(tables[names].model_fields) if names in tables else []


def shown(value: Any, limit: int = 60) -> str:
    """A value as an error message shows it."""
    text = f'"{value}"' if isinstance(value, str) else "a table" if isinstance(value, dict) else repr(value)
    text = {"True": "true", "False": "false"}.get(text, text)
    return text if len(text) <= limit else text[: limit - 1] + "…"
