"""The shape of a mapping file, and the checks between its keys.

A mapping says what each column of the logs is: which joint and signal, in which unit, on which side of the
gear. Its payloads, start values and controller are written as in a measurement set.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from flexviz.base import toml
from flexviz.base.arrays import Array, Bools
from flexviz.base.errors import InputError, choose_from
from flexviz.base.schemas import NotNegative, Number, Positive, StrictTable, Text, first_repeated, validate
from flexviz.data.logs.column_names import ANGLE, CURRENT, FORCE, LENGTH, TIME, TORQUE, size_of
from flexviz.data.measurements import (
    OPTIONAL_SIGNALS,
    Clamped,
    GroupKind,
    SetHeader,
    Temperatures,
    check_clamped,
)

FORMAT = 1
NEEDED = ("theta", "tau")
SIGNALS = (*NEEDED, *OPTIONAL_SIGNALS)
LARGEST_CONDITION = 1e6  # of a coupling


def _unit(*units: str) -> Any:
    """A known unit, or the size of one unit in SI as a number."""

    def check(value: Any) -> Any:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if (number and value > 0 and value < float("inf")) or (isinstance(value, str) and value in units):
            return value
        meant = choose_from(str(value), units) + "; or a positive number, the size of one unit in SI"
        raise PydanticCustomError("choice", "{meant}", {"meant": meant})

    return BeforeValidator(check)


def _nonzero(value: float) -> float:
    if value == 0.0:
        raise PydanticCustomError("choice", "expected a number other than 0")
    return value


_not_zero = AfterValidator(_nonzero)


class SignalColumn(StrictTable):
    """The column of a signal and its conversion to SI; `"name"` is short for `{ from = "name" }`."""

    column: Text = Field(alias="from")
    side: Literal["joint", "motor"] = "joint"
    sign: Literal[1, -1] = 1
    offset: Number = 0.0  # [rad] or [Nm] at the joint, added last
    time: Text | None = None  # its own time column, where it is not the usual one
    missing: Number | None = None  # a number of the column that stands for a missing value
    sign_bit: Annotated[int, Field(ge=0, le=62)] | None = None  # 1: minus the number of the lower bits
    wrap: Positive | None = None  # period by which the column overflows, in its own unit
    fresh: bool = False  # only values that differ from the one before

    @model_validator(mode="before")
    @classmethod
    def _short(cls, value: Any) -> Any:
        return {"from": value} if isinstance(value, str) else value


class AngleColumn(SignalColumn):
    """A position."""

    unit: Annotated[str | float, _unit(*ANGLE, *LENGTH)] = "rad"


class TorqueColumn(SignalColumn):
    """A torque or a current."""

    unit: Annotated[str | float, _unit(*TORQUE, *FORCE, *CURRENT)] = "Nm"


class JointColumns(StrictTable):
    """The columns of one joint; `side = "motor"` means before a gear of this ratio."""

    gear: Annotated[Number, _not_zero] | None = None  # motor turns per joint turn; negative: opposite turns
    torque_constant: Positive | None = None  # [Nm/A] on the side where the current's torque is
    theta: AngleColumn = Field(description='theta = { from = "column" }: every joint needs θ and τ')
    tau: TorqueColumn | None = None
    q: AngleColumn | None = None
    tau_joint: TorqueColumn | None = None
    theta_ref: AngleColumn | None = None

    @property
    def ratio(self) -> float:
        """The gear, 1 where none is stated."""
        return 1.0 if self.gear is None else self.gear

    def scale(self, signal: SignalColumn) -> float:
        """One unit of a signal's column at the joint side [rad], [Nm]; negative for the opposite sign."""
        gear = self.ratio if signal.side == "motor" else 1.0
        if isinstance(signal, AngleColumn):
            return signal.sign * size_of(signal.unit, ANGLE | LENGTH) / gear
        assert isinstance(signal, TorqueColumn)
        counts = signal is self.tau and not isinstance(
            signal.unit, str
        )  # of a current, if there is a constant
        constant = (self.torque_constant or 1.0) if counts or signal.unit in CURRENT else 1.0
        return signal.sign * size_of(signal.unit, TORQUE | FORCE | CURRENT) * constant * gear


class Coupling(StrictTable):
    """Joints that share motors: joint angles = matrix · motor angles, each behind its own gear.

    Power is conserved: motor torques = matrixᵀ · joint torques.
    """

    joints: Annotated[list[Text], Field(min_length=2)]
    matrix: list[list[Number]]

    def turned(self, name: str) -> Array:
        """(k, k) what makes joint values of motor values (…, k) of the signal `name`, from the right."""
        matrix = np.array(self.matrix, dtype=float)
        return np.linalg.inv(matrix) if name in ("tau", "tau_joint") else matrix.T


class TimeColumn(StrictTable):
    """The time column, and how it is read."""

    column: Text | None = None
    unit: Annotated[str | float, _unit(*TIME)] = "s"
    step: Positive | None = None  # [s] for tables without such a column
    clock: Literal["header", "log"] = "header"  # bags: the messages' own time, or that of recording
    shift: dict[str, Number] = Field(default_factory=dict)  # topic or time column -> [s] added to its times


class LogEntry(StrictTable):
    """One log, which becomes one group of the set."""

    file: Text | Annotated[list[Text], Field(min_length=1, max_length=3)]  # several: all of one run
    episode: Annotated[int, Field(ge=0)] | None = None
    group: Text
    trajectory: Text | None = None  # None: the group's name
    payload: Text = "none"
    validation: bool = False
    temperature: Temperatures | None = None
    kp_scale: Annotated[float, Field(gt=0.0, le=1e6)] = 1.0  # of the servos' gain, relative to other logs
    start: NotNegative = Field(default=0.0, alias="from")  # [s] after the log's first sample
    stop: Positive | None = Field(default=None, alias="to")  # [s]
    leave_out: list[Annotated[list[NotNegative], Field(min_length=2, max_length=2)]] = Field(
        default_factory=list
    )  # [s] stretches [begin, end], counted as `from` is
    kind: GroupKind = "motion"
    clamped: Clamped = False
    drop_jumps: bool = False  # leave out rows in which a position has jumped away and comes back

    def uses(self, since: Array) -> Bools:
        """Which instants (N,) [s] after the log's first sample are used."""
        used = (since >= self.start) & (since <= (np.inf if self.stop is None else self.stop))
        for first, last in self.leave_out:
            used &= (since < first) | (since > last)
        return used

    @property
    def files(self) -> list[str]:
        """The files of the run."""
        return [self.file] if isinstance(self.file, str) else self.file

    @property
    def label(self) -> str:
        """The files as messages call them."""
        return ", ".join(self.files)


class Mapping(SetHeader):
    """All of a mapping file."""

    format: int = FORMAT
    time: TimeColumn = TimeColumn()
    logs: Annotated[list[LogEntry], Field(min_length=1)]
    joints: Annotated[dict[str, JointColumns], Field(min_length=1)]
    coupling: Coupling | None = None  # of signals with side = "motor"
    complete_rows: bool = False  # leave out rows that lack a signal which is taken from their table

    @property
    def needed(self) -> tuple[str, str]:
        """The signals of which every joint needs a column: θ, and τ or the goal that it follows."""
        return NEEDED if self.drive is None else ("theta", "theta_ref")

    @property
    def names(self) -> tuple[str, ...]:
        """The joints, in the set's order."""
        return tuple(self.joints)

    def signals(self) -> list[tuple[str, str, AngleColumn | TorqueColumn]]:
        """(joint, signal's name, signal) of all signals."""
        joints = self.joints.items()
        found = [(joint, name, getattr(entry, name)) for joint, entry in joints for name in SIGNALS]
        return [item for item in found if item[2] is not None]

    def for_joints(self, prismatic: Array, file: Path) -> Mapping:
        """The mapping with units of m and N where none is stated for a prismatic joint.

        InputError where a unit is that of the other kind of joint. Before a gear [rad/m] it is rad and Nm.
        """
        slides, joints = dict(zip(self.names, prismatic, strict=True)), dict(self.joints)
        for joint, name, signal in self.signals():
            linear = slides[joint] and signal.side == "joint"
            known = (LENGTH, ANGLE) if isinstance(signal, AngleColumn) else (FORCE, TORQUE)
            wanted, other = known if linear else known[::-1]
            if "unit" not in signal.model_fields_set and linear:
                changed = signal.model_copy(update={"unit": next(iter(wanted))})
                joints[joint] = joints[joint].model_copy(update={name: changed})
            elif signal.unit in other:
                kind = "prismatic" if slides[joint] else "revolute"
                message = f'found "{signal.unit}", but the joint is {kind}: {choose_from("", tuple(wanted))}'
                raise InputError(message, file=file, place=f"joints.{joint}.{name}.unit")
        return self.model_copy(update={"joints": joints})

    def coupled(self, name: str) -> Coupling | None:
        """The coupling where the signal `name` is before it."""
        if self.coupling is None:
            return None
        signals = [getattr(self.joints[joint], name) for joint in self.coupling.joints]
        return self.coupling if all(s is not None and s.side == "motor" for s in signals) else None


@dataclass(frozen=True)
class Fix:
    """A change of the mapping: `joints.<joint>.<signal>.<key> = value`."""

    joint: str
    signal: str
    key: str
    value: str | float | int


def read_mapping(file: Path) -> Mapping:
    """Read and check a mapping file by itself (neither the robot nor the logs are opened)."""
    return parse(toml.read(file), file)


def parse(data: dict[str, Any], file: Path) -> Mapping:
    """Check the content of a mapping file; `file` is what errors call it."""
    if "groups" in data and "logs" not in data:
        raise InputError("this is a measurement set, expected a mapping with [[logs]]", file=file)
    mapping = validate(Mapping, data, file, FORMAT)
    mapping.check_lengths(len(mapping.joints), file)
    mapping.model.check_joints(mapping.names, file)
    check(mapping, file)
    return mapping


def check(mapping: Mapping, file: Path) -> None:
    """Checks between keys."""

    def refuse(place: str, message: str) -> None:
        raise InputError(message, file=file, place=place)

    if twice := first_repeated(log.group for log in mapping.logs):
        refuse("logs", f'two logs have group = "{twice}", expected a different name for each')
    known = list(dict.fromkeys([*mapping.payloads, "none"]))
    for i, log in enumerate(mapping.logs):
        place = f'log {i + 1} "{log.group}"'
        if log.payload not in known:
            meant = choose_from(log.payload, known)
            refuse(f"{place}, payload", f'payload "{log.payload}" is not defined; {meant}')
        if log.stop is not None and log.stop <= log.start:
            refuse(f"{place}, to", f"found {log.stop:g}, expected more than from = {log.start:g}")
        for first, last in log.leave_out:
            if last <= first:
                refuse(f"{place}, leave_out", f"found [{first:g}, {last:g}], expected [begin, end] in s")
        mapping.check_temperature(log.temperature, len(mapping.joints), file, place)
        check_clamped(log.kind, log.clamped, mapping.names, file, place)
    if mapping.coupling is not None:
        check_coupling(mapping, mapping.coupling, refuse)
    for joint, entry in mapping.joints.items():
        for name in mapping.needed:
            if getattr(entry, name) is None:
                also = "" if mapping.drive else ', or [drive] from = "goal" for servos without a torque'
                what = "θ and its goal" if mapping.drive else "θ and τ"
                message = f'is missing, expected {name} = {{ from = "column" }}: every joint needs {what}'
                refuse(f"joints.{joint}.{name}", message + also)
    if mapping.drive is not None:
        mapping.drive.check_joints(mapping.names, file)
    used: dict[str, str] = {}
    for joint, name, signal in mapping.signals():
        constant = mapping.joints[joint].torque_constant
        if isinstance(signal, TorqueColumn) and signal.unit in CURRENT and constant is None:
            message = f"{name} is a current, expected torque_constant [Nm/A] to make a torque of it"
            refuse(f"joints.{joint}", message)
        if signal.side == "motor" and mapping.joints[joint].gear is None:
            message = (
                f"{name} is before the gear, expected gear (motor turns per joint turn; 1.0 without one)"
            )
            refuse(f"joints.{joint}", message)
        place = f"joints.{joint}.{name}"
        if name in mapping.needed and signal.column in used:
            refuse(place, f'"{signal.column}" is {used[signal.column]} already, expected each column once')
        used[signal.column] = place


def check_coupling(mapping: Mapping, coupling: Coupling, refuse: Callable[[str, str], None]) -> None:
    """Refuse a coupling of other joints, without an inverse, or of signals that are not all before it."""
    joints, k = coupling.joints, len(coupling.joints)
    for joint in joints:
        if joint not in mapping.joints:
            refuse("coupling.joints", f'"{joint}" is no joint; {choose_from(joint, mapping.names)}')
    if twice := first_repeated(joints):
        refuse("coupling.joints", f'"{twice}" is listed twice, expected each joint once')
    if any(len(row) != k for row in (coupling.matrix, *coupling.matrix)):
        refuse(
            "coupling.matrix", f"expected {k} rows of {k} numbers, one row per joint, one column per motor"
        )
    if np.linalg.cond(np.array(coupling.matrix)) > LARGEST_CONDITION:
        refuse("coupling.matrix", "it has no inverse, expected joint angles = matrix · motor angles")
    for name in SIGNALS:
        sides = {joint: getattr(mapping.joints[joint], name) for joint in joints}
        other = [j for j, signal in sides.items() if signal is None or signal.side != "motor"]
        if other and len(other) < k:
            message = f"{name} of the coupled {', '.join(joints)} is before and behind the coupling, expected"
            refuse(f"joints.{other[0]}", f"{message} the same side on all of them")
    if not any(mapping.coupled(name) for name in SIGNALS):
        refuse(
            "coupling", f'no signal of {", ".join(joints)} has side = "motor", expected theta or tau with it'
        )
