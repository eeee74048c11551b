"""Settings of a design, from Python or from a TOML file, and the limits of the robot that they mean."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationError

from flexviz.base import toml
from flexviz.base.arrays import Array
from flexviz.base.errors import InputError, choose_from
from flexviz.base.schemas import Number, Positive, StrictTable, Text, input_error, validate
from flexviz.robot.robot import Robot

PerJoint = Annotated[list[Positive], Field(min_length=1)]

FORMAT = 1
URDF_SHARE = 0.8  # of the URDF's velocity and torque limits that a motion may use
URDF_MARGIN = 0.05  # [rad] or [m] kept from the URDF's position limits
UNLIMITED_REACH = 1.5  # [rad] or [m] to either side of zero of a joint without position limits
FASTEST = 4.0  # [Hz] of a harmonic: the identification sees motions below about 6 Hz
WIDEST_RANGE = 20.0  # [rad] wider position limits count as none
UNLIMITED_SPEED = 2.0  # [rad/s] or [m/s] of a joint whose URDF states no velocity


class LimitTable(StrictTable):
    """Limits of the motion; lists have one value per joint. What is not given comes from the URDF."""

    lower: Annotated[list[Number], Field(min_length=1)] | None = None  # [rad]
    upper: Annotated[list[Number], Field(min_length=1)] | None = None  # [rad]
    velocity: PerJoint | None = None  # [rad/s]
    acceleration: PerJoint | None = None  # [rad/s²]; no limit by default
    torque: PerJoint | None = None  # [Nm] of the motor, at the joint side
    tool: Text | None = None  # link that `floor` and `box` hold for; default: the last one
    floor: Number | None = None  # [m] least height of the tool
    box_lower: Annotated[list[Number], Field(min_length=3, max_length=3)] | None = None  # [m]
    box_upper: Annotated[list[Number], Field(min_length=3, max_length=3)] | None = None  # [m]


class DesignSettings(StrictTable):
    """Settings of `flexviz design`, also the content of its `--settings` file."""

    format: int = FORMAT
    groups: Annotated[int, Field(ge=1, le=20)] = 3
    duration: Annotated[float, Field(ge=4.0, le=120.0)] = 10.0  # [s] of each group
    harmonics: Annotated[int, Field(ge=1, le=12)] = 5
    frequency: Annotated[float, Field(ge=0.02, le=2.0)] = 0.2  # [Hz] base; whole periods in `duration`
    payloads: Annotated[list[Text], Field(min_length=1)] | None = None  # names; default: all
    criterion: Literal["trace", "log-det"] = "trace"
    evaluations: Annotated[int, Field(ge=20, le=100_000)] = 600  # per group and pass
    passes: Annotated[int, Field(ge=1, le=10)] = 2
    limits: LimitTable = LimitTable()

    @property
    def base(self) -> float:
        """Base frequency with whole periods in the duration [rad/s]."""
        return 2 * np.pi * max(1, round(self.frequency * self.duration)) / self.duration

    @staticmethod
    def of(**values: Any) -> DesignSettings:
        """Checked settings; InputError names the key, what was found and what is expected."""
        try:
            return DesignSettings.model_validate(values)
        except ValidationError as error:
            raise input_error(error, values, Path("design settings"), DesignSettings) from None


def settings_from(
    file: str | Path | None, given: Mapping[str, Any], floor: float | None = None
) -> DesignSettings:
    """Settings from a file, if there is one, with the values in `given` that are not None."""
    values = {}
    if file is not None:
        read = validate(DesignSettings, toml.read(Path(file)), Path(file), FORMAT)
        values = read.model_dump(exclude_unset=True)
    values |= {name: value for name, value in given.items() if value is not None}
    if floor is not None:
        values["limits"] = {**values.get("limits", {}), "floor": floor}
    return DesignSettings.of(**values)


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of a robot's motion; infinite where there is none."""

    # lower, upper: (n,), position of motor and link [rad]
    lower: Array
    upper: Array
    # velocity, acceleration: (n,), of the motor [rad/s], [rad/s²]
    velocity: Array
    acceleration: Array
    torque: Array  # (n,), of the motor [Nm]
    tool: str  # link that the box holds for
    box: Array  # (2, 3), least and largest position of the tool [m]


def limits_of(robot: Robot, table: LimitTable, file: str | Path | None = None) -> Limits:
    """The limits of `table`, completed from the URDF; `file` is what errors call the settings."""

    def given(name: str, default: Array | float) -> Array:
        values = getattr(table, name)
        if values is not None and len(values) != robot.n:
            expected = f"expected {robot.n}, one per joint: {', '.join(robot.joints)}"
            raise InputError(f"{len(values)} values, {expected}", file=file, place=f"limits.{name}")
        return np.broadcast_to(np.asarray(default if values is None else values, float), robot.n)

    low, high = np.array(robot.lower_limit), np.array(robot.upper_limit)
    free = ~np.isfinite(high - low) | (high - low > WIDEST_RANGE) | (high <= low)
    margin = np.minimum(URDF_MARGIN, 0.1 * np.where(free, 1.0, high - low))
    low = np.where(free, -UNLIMITED_REACH, low + margin)
    high = np.where(free, UNLIMITED_REACH, high - margin)
    lower, upper = given("lower", low), given("upper", high)
    for joint, a, b in zip(robot.joints, lower, upper, strict=True):
        if not a < b:
            message = f'joint "{joint}" has {a:g} to {b:g} rad, expected lower < upper'
            raise InputError(message, file=file, place="limits.lower")
    speed, effort = np.array(robot.velocity_limit), np.array(robot.effort_limit)
    speed = np.where((speed > 0) & np.isfinite(speed), URDF_SHARE * speed, UNLIMITED_SPEED)
    effort = np.where((effort > 0) & np.isfinite(effort), URDF_SHARE * effort, np.inf)
    tool = table.tool or robot.links[-1]
    if tool not in robot.links:
        message = f'link "{tool}" does not exist; {choose_from(tool, robot.links)}'
        raise InputError(message, file=file, place="limits.tool")
    box = np.array([[-np.inf] * 3, [np.inf] * 3])
    for row, corner in enumerate((table.box_lower, table.box_upper)):
        if corner is not None:
            box[row] = corner
    if table.floor is not None:
        box[0, 2] = max(box[0, 2], table.floor)
    if not np.all(box[0] < box[1]):
        message = f"found {box[0].tolist()} to {box[1].tolist()}, expected lower < upper"
        raise InputError(message, file=file, place="limits.box_upper")
    velocity, acceleration = given("velocity", speed), given("acceleration", np.inf)
    return Limits(lower, upper, velocity, acceleration, given("torque", effort), tool, box)


def check_band(settings: DesignSettings, file: str | Path | None = None) -> None:
    """Refuse motions faster than the band in which parameters are identified."""
    fastest = settings.harmonics * settings.base / (2 * np.pi)
    if fastest > FASTEST:
        message = f"the fastest harmonic has {fastest:.3g} Hz, expected at most {FASTEST:g} Hz"
        raise InputError(message, file=file, place="harmonics")


def choose_payloads(
    settings: DesignSettings, known: Iterable[str], file: str | Path | None = None
) -> tuple[str, ...]:
    """Names of the payloads to choose from."""
    names = tuple(known)
    for name in settings.payloads or ():
        if name not in names:
            message = f'payload "{name}" is not defined; {choose_from(name, names)}'
            raise InputError(message, file=file, place="payloads")
    return tuple(settings.payloads or names)
