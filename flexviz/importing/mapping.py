"""The shape of a mapping file, and one-line errors for everything in it that is not right.

A mapping says what each column of the logs is: which joint and signal, in which unit, on which side of the
gear. Its payloads, start values and controller are written as in a measurement set.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from flexviz import toml
from flexviz.errors import InputError, choose_from
from flexviz.importing.units import ANGLE, CURRENT, TIME, TORQUE
from flexviz.measurements import SetHeader
from flexviz.schemas import NotNegative, Number, Positive, StrictTable, Text, first_repeated, validate

FORMAT = 1
SIGNALS = ("theta", "tau", "q", "tau_joint", "theta_ref")  # θ and τ are needed, the others are for comparison
SIDES = ("joint", "motor")
CLOCKS = ("header", "log")


def _one_of(*valid: str | int) -> Any:
    """One of a few words or numbers."""

    def check(value: Any) -> Any:
        if value not in valid or type(value) is not type(valid[0]):
            raise PydanticCustomError(
                "choice", "{meant}", {"meant": choose_from(str(value), map(str, valid))}
            )
        return value

    return BeforeValidator(check)


def _unit(*units: str) -> Any:
    """A known unit, or the size of one unit in SI as a number."""

    def check(value: Any) -> Any:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if (number and value > 0 and value < float("inf")) or (isinstance(value, str) and value in units):
            return value
        meant = choose_from(str(value), units) + "; or a positive number, the size of one unit in SI"
        raise PydanticCustomError("choice", "{meant}", {"meant": meant})

    return BeforeValidator(check)


class Signal(StrictTable):
    """Where a signal comes from and what must be undone; `"name"` alone stands for `{ from = "name" }`."""

    column: Text = Field(alias="from")
    side: Annotated[str, _one_of(*SIDES)] = "joint"
    sign: Annotated[int, _one_of(1, -1)] = 1
    offset: Number = 0.0  # [rad] or [Nm] at the joint side, added last
    time: Text | None = None  # the column that says when, where it is not the usual one

    @model_validator(mode="before")
    @classmethod
    def _short(cls, value: Any) -> Any:
        return {"from": value} if isinstance(value, str) else value


class Angle(Signal):
    """A position."""

    unit: Annotated[str | float, _unit(*ANGLE)] = "rad"


class Torque(Signal):
    """A torque or a current."""

    unit: Annotated[str | float, _unit(*TORQUE, *CURRENT)] = "Nm"


class Joint(StrictTable):
    """The columns of one joint; `side = "motor"` means before a gear of this ratio."""

    gear: Positive = 1.0  # motor turns per joint turn
    torque_constant: Positive | None = None  # [Nm/A] on the side where the current's torque is
    theta: Angle = Field(description='theta = { from = "column" }: every joint needs θ and τ')
    tau: Torque = Field(description='tau = { from = "column" }: every joint needs θ and τ')
    q: Angle | None = None
    tau_joint: Torque | None = None
    theta_ref: Angle | None = None


class TimeColumn(StrictTable):
    """Which column says when."""

    column: Text | None = None
    unit: Annotated[str | float, _unit(*TIME)] = "s"
    step: Positive | None = None  # [s] for tables without such a column
    clock: Annotated[str, _one_of(*CLOCKS)] = "header"  # bags: the messages' own time, or that of recording
    shift: dict[str, Number] = Field(default_factory=dict)  # topic or time column -> [s] added to its times


class LogEntry(StrictTable):
    """One log, which becomes one group."""

    file: Text
    episode: Annotated[int, Field(ge=0)] | None = None
    group: Text
    trajectory: Text | None = None  # the group's own where it is not said
    payload: Text = "none"
    validation: bool = False
    start: NotNegative = Field(default=0.0, alias="from")  # [s] after the log's first sample
    stop: Positive | None = Field(default=None, alias="to")  # [s]


class Mapping(SetHeader):
    """All of a mapping file."""

    format: int = FORMAT
    time: TimeColumn = TimeColumn()
    logs: Annotated[list[LogEntry], Field(min_length=1)]
    joints: Annotated[dict[str, Joint], Field(min_length=1)]

    @property
    def names(self) -> tuple[str, ...]:
        """The joints, in the order of the set to be."""
        return tuple(self.joints)

    def signals(self) -> list[tuple[str, str, Signal]]:
        """(joint, signal's name, signal) of all that there are."""
        found = (
            (joint, name, getattr(entry, name)) for joint, entry in self.joints.items() for name in SIGNALS
        )
        return [item for item in found if item[2] is not None]


def read_mapping(file: Path) -> Mapping:
    """Read and check a mapping file by itself (neither the robot nor the logs are opened)."""
    return parse(toml.read(file), file)


def parse(data: dict[str, Any], file: Path) -> Mapping:
    """Check the content of a mapping file; `file` is what errors call it."""
    if "groups" in data and "logs" not in data:
        raise InputError("this is a measurement set, expected a mapping with [[logs]]", file=file)
    mapping = validate(Mapping, data, file, FORMAT)
    mapping.check_lengths(len(mapping.joints), file)
    check(mapping, file)
    return mapping


def check(mapping: Mapping, file: Path) -> None:
    """Checks between keys."""

    def refuse(place: str, message: str) -> None:
        raise InputError(message, file=file, place=place)

    if twice := first_repeated(log.group for log in mapping.logs):
        refuse("logs", f'two logs have group = "{twice}", a name of its own for each would be right')
    for i, log in enumerate(mapping.logs):
        place = f'log {i + 1} "{log.group}"'
        known = [*mapping.payloads, *({"none"} - set(mapping.payloads))]
        if log.payload not in known:
            refuse(
                f"{place}, payload",
                f'payload "{log.payload}" is not defined; {choose_from(log.payload, known)}',
            )
        if log.stop is not None and log.stop <= log.start:
            refuse(f"{place}, to", f"found {log.stop:g}, more than from = {log.start:g} would be right")
    for joint, name, signal in mapping.signals():
        if (
            isinstance(signal, Torque)
            and signal.unit in CURRENT
            and mapping.joints[joint].torque_constant is None
        ):
            refuse(
                f"joints.{joint}",
                f"{name} is a current, torque_constant [Nm/A] is needed to make a torque of it",
            )
    used: dict[str, str] = {}
    for joint, name, signal in mapping.signals():
        place = f"joints.{joint}.{name}"
        if name in ("theta", "tau") and signal.column in used:
            refuse(
                place, f'"{signal.column}" is {used[signal.column]} already, each column once would be right'
            )
        used[signal.column] = place
