"""The shape of `measurements.toml`, and the checks between its keys."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field
from pydantic_core import PydanticCustomError

from flexviz.errors import InputError, choose_from
from flexviz.schemas import Number, StrictTable, Text, first_repeated, validate

FILE_NAME = "measurements.toml"
FORMAT = 1
LONGEST_HOLD = 0.1  # [s] a longer hold of the torque can only be a wrong unit
COLDEST, HOTTEST = -60.0, 250.0  # [°C] of a joint; anything beyond can only be a wrong unit

Temperatures = Annotated[list[Number], BeforeValidator(lambda x: x if isinstance(x, list) else [x])]
"""[°C] one per joint; a single number holds for all joints."""


def recorded(value: Any) -> dt.datetime | dt.date | None:
    """A date as TOML writes it."""
    if value is not None and not isinstance(value, dt.date):  # a datetime is one, too
        raise PydanticCustomError("date", "expected a date without quotes: 2026-03-01 or 2026-03-01T14:30:00")
    return value


Recorded = Annotated[Any, AfterValidator(recorded)]
"""When the data were recorded: a `datetime`, a `date` or None."""

Gain = Annotated[float, Field(ge=0.0, le=1e12)]
Inertia = Annotated[float, Field(ge=-1e9, le=1e9)]  # [kg m²]


class Initial(StrictTable):
    """Rough start values, one per joint."""

    stiffness: list[Annotated[float, Field(ge=1e-3, le=1e12)]] | None = None  # [Nm/rad]
    motor_inertia: list[Annotated[float, Field(ge=1e-12, le=1e6)]] | None = None  # [kg m²]


class Controller(StrictTable):
    """Gains of the controller that ran during the recording, one per joint."""

    kp: list[Gain]  # [Nm/rad]
    kd: list[Gain]  # [Nm s/rad]


class StartingModel(StrictTable):
    """Effects the model starts with."""

    effects: list[Text] = Field(default_factory=list)


class Body(StrictTable):
    """A rigid body on a link; com and inertia are in the link's frame."""

    link: Text
    mass: Annotated[float, Field(ge=0.0, le=1e6)]  # [kg]
    com: Annotated[list[Number], Field(min_length=3, max_length=3)]  # [m]
    inertia: Annotated[list[Inertia], Field(min_length=6, max_length=6)]  # Ixx Iyy Izz Ixy Ixz Iyz [kg m²]


class Payload(StrictTable):
    """A known payload."""

    bodies: list[Body]


class GroupEntry(StrictTable):
    """One trajectory run with one payload, in one file."""

    name: Text
    trajectory: Text
    payload: Text
    file: Text
    validation: bool = False
    temperature: Temperatures | None = None


class SetHeader(StrictTable):
    """The keys that measurement sets and mappings of logs share."""

    format: int
    robot: Text
    torque_hold: Annotated[float, Field(ge=0.0, le=LONGEST_HOLD)] = 0.0  # [s]
    date: Recorded = None
    initial: Initial = Initial()
    controller: Controller | None = None
    model: StartingModel = StartingModel()
    payloads: dict[str, Payload] = Field(default_factory=dict)

    def check_lengths(self, n: int, file: Path) -> None:
        """InputError unless every list that has one value per joint has n of them."""
        for name in ("initial", "controller"):
            for key, values in dict(getattr(self, name) or {}).items():
                if values is not None and len(values) != n:
                    message = f"{len(values)} values for {n} joints, expected one per joint ({n})"
                    raise InputError(message, file=file, place=f"{name}.{key}")

    @staticmethod
    def check_temperature(values: list[float] | None, n: int, file: Path | None, place: str) -> None:
        """InputError for temperatures [°C] that are not one per joint, or that no joint has."""
        if values is None:
            return
        place = f"{place}, temperature"
        if len(values) not in (1, n):
            message = f"{len(values)} values for {n} joints, expected one per joint ({n}) or one for all"
            raise InputError(message, file=file, place=place)
        for value in values:
            if not COLDEST <= value <= HOTTEST:
                message = f"found {value:g}, expected {COLDEST:g} to {HOTTEST:g} °C"
                raise InputError(message, file=file, place=place)


class MeasurementFile(SetHeader):
    """All of `measurements.toml`."""

    joints: Annotated[list[Text], Field(min_length=1)]
    groups: Annotated[list[GroupEntry], Field(min_length=1)]


def locate(path: str | Path) -> Path:
    """The `measurements.toml` that `path` (a set's folder, or the file itself) stands for."""
    file = Path(path)
    try:
        file = file / FILE_NAME if file.is_dir() else file
        found = file.is_file()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be opened ({reason})", file=file) from None
    if not found and (file.parent / "session.json").is_file():
        raise InputError(
            "is a saved session, expected the measurement set it was made from; flexviz serve opens sessions",
            file=file.parent,
        )
    if not found:
        raise InputError(f"file not found; a measurement set is a folder with {FILE_NAME}", file=file)
    if file.suffix != ".toml":
        raise InputError(f"not a measurement set, expected a folder with {FILE_NAME}", file=file)
    return file


def parse(data: dict[str, Any], file: Path) -> MeasurementFile:
    """Check the content of a `measurements.toml`; `file` is what errors call it."""
    content = validate(MeasurementFile, data, file, FORMAT)
    content.check_lengths(len(content.joints), file)
    check_names(content, file)
    for index, group in enumerate(content.groups):
        place = f'group {index + 1} "{group.name}"'
        content.check_temperature(group.temperature, len(content.joints), file, place)
    return content


def check_names(content: MeasurementFile, file: Path) -> None:
    """InputError for a name that is used twice or does not exist."""

    def refuse(place: str, message: str) -> None:
        raise InputError(message, file=file, place=place)

    if twice := first_repeated(content.joints):
        refuse("joints", f'"{twice}" is listed twice, expected each joint once')
    if twice := first_repeated(content.model.effects):
        refuse("model.effects", f'"{twice}" is listed twice, expected each effect once')
    if twice := first_repeated(group.name for group in content.groups):
        refuse("groups", f'two groups are called "{twice}", expected a different name for each')
    for effect in content.model.effects:
        from flexviz.effects import known_names

        if effect not in known_names():
            meant = choose_from(effect, known_names(), limit=len(known_names()))
            own = "load a user-defined effect with --effects-from FILE"
            refuse("model.effects", f'effect "{effect}" is not known; {meant}; {own}')
    for index, group in enumerate(content.groups):
        if group.payload not in content.payloads:
            place = f'group {index + 1} "{group.name}", payload'
            meant = choose_from(group.payload, content.payloads)
            refuse(place, f'payload "{group.payload}" is not defined; {meant}')
