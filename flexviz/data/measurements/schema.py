"""The shape of `measurements.toml`, and the checks between its keys."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field
from pydantic_core import PydanticCustomError

from flexviz.base.errors import InputError, choose_from
from flexviz.base.resources import sessions_dir
from flexviz.base.schemas import Number, StrictTable, Text, first_repeated, validate
from flexviz.robot.mounting import GRAVITY, check_gravity

FILE_NAME = "measurements.toml"
FORMAT = 1
DEMO, DEMO_SET = "demo", "planar-2r-demo"  # what the bundled example is called, and its folder
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


def stated_gravity(value: Any) -> Any:
    """Gravity as a set states it."""
    try:
        check_gravity(value)
    except ValueError as error:
        raise PydanticCustomError("gravity", "{problem}", {"problem": str(error)}) from None
    return value


Gravity = Annotated[list[float], BeforeValidator(stated_gravity)]
"""(3,) [m/s²] in the base's frame."""
TorqueSide = Literal["motor", "joint"]
"""What τ is: the motors' torque, or one measured behind the gears by joint torque sensors."""

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


class DriveTable(StrictTable):
    """What drives the joints, where it is no recorded torque: the goals that their servos follow."""

    origin: Annotated[Literal["goal"], Field(alias="from")]
    kp: Annotated[list[Gain], BeforeValidator(lambda x: x if isinstance(x, list) else [x])] | None = None
    same: list[Annotated[list[Text], Field(min_length=2)]] = Field(default_factory=list)

    def check_joints(self, joints: Sequence[str], file: Path) -> None:
        """InputError for a gain that is not above zero, or a joint that does not exist or is listed twice."""
        if self.kp is not None:
            if len(self.kp) not in (1, len(joints)):
                found = f"{len(self.kp)} values for {len(joints)} joints"
                message = f"{found}, expected one per joint ({len(joints)}) or one for all"
                raise InputError(message, file=file, place="drive.kp")
            if min(self.kp) <= 0.0:
                message = (
                    f"found {min(self.kp):g}, expected a gain above zero [Nm/rad]; leave it out if unknown"
                )
                raise InputError(message, file=file, place="drive.kp")
        named = [name for names in self.same for name in names]
        for name in named:
            if name not in joints:
                message = f'joint "{name}" is not in the set; {choose_from(name, joints)}'
                raise InputError(message, file=file, place="drive.same")
        if twice := first_repeated(named):
            message = f'"{twice}" is listed twice, expected each joint with one servo'
            raise InputError(message, file=file, place="drive.same")


class StartingModel(StrictTable):
    """What the model of the robot starts with."""

    effects: list[Text] = Field(default_factory=list)  # on every joint
    rigid: list[Text] = Field(default_factory=list)  # joints without elasticity: q = θ
    no_torque: list[Text] = Field(default_factory=list)  # joints whose τ is no signal: it is not fitted

    def check_joints(self, joints: Sequence[str], file: Path) -> None:
        """InputError for a joint that does not exist, and unless one joint has a torque."""
        for key in ("rigid", "no_torque"):
            names: list[str] = getattr(self, key)
            for name in names:
                if name not in joints:
                    message = f'joint "{name}" is not in the set; {choose_from(name, joints)}'
                    raise InputError(message, file=file, place=f"model.{key}")
            if twice := first_repeated(names):
                message = f'"{twice}" is listed twice, expected each joint once'
                raise InputError(message, file=file, place=f"model.{key}")
        if set(self.no_torque) >= set(joints):
            message = "no joint has a torque, expected at least one whose torque is fitted"
            raise InputError(message, file=file, place="model.no_torque")


class Body(StrictTable):
    """A rigid body on a link; com and inertia are in the link's frame."""

    link: Text
    mass: Annotated[float, Field(ge=0.0, le=1e6)]  # [kg]
    com: Annotated[list[Number], Field(min_length=3, max_length=3)]  # [m]
    inertia: Annotated[list[Inertia], Field(min_length=6, max_length=6)]  # Ixx Iyy Izz Ixy Ixz Iyz [kg m²]


class Payload(StrictTable):
    """A known payload."""

    bodies: list[Body]


GroupKind = Literal["motion", "holds"]
"""What a group's table holds: a motion, or a static test."""
Clamped = bool | list[Text]
"""Whether the flange is clamped in a static test, or the joints before the link that is."""
MOST_CLAMPED = 6  # joints that a clamp holds


def clamped_joints(clamped: Clamped, joints: Sequence[str]) -> list[str]:
    """The joints whose link cannot move."""
    return clamped if isinstance(clamped, list) else list(joints) if clamped else []


def check_clamped(kind: GroupKind, clamped: Clamped, joints: Sequence[str], file: Path, place: str) -> None:
    """InputError for a clamp of a motion, of joints that do not exist, or of more than it holds."""
    names = clamped_joints(clamped, joints)
    problem = ""
    if names and kind == "motion":
        problem = 'a clamped arm does not move, expected kind = "holds"'
    elif unknown := next((name for name in names if name not in joints), None):
        problem = f'joint "{unknown}" is not in the set; {choose_from(unknown, joints)}'
    elif len(names) > MOST_CLAMPED:
        problem = (
            f"a clamp holds {MOST_CLAMPED} joints at most, found {len(names)}: clamp a link nearer the base "
            "and list the joints before it"
        )
    if problem:
        raise InputError(problem, file=file, place=f"{place}, clamped")


class GroupEntry(StrictTable):
    """One trajectory run with one payload, in one file."""

    name: Text
    trajectory: Text
    payload: Text
    file: Text
    validation: bool = False
    temperature: Temperatures | None = None
    kp_scale: Annotated[float, Field(gt=0.0, le=1e6)] = 1.0  # of the servos' gain, relative to other groups
    kind: GroupKind = "motion"
    clamped: Clamped = False


class SetHeader(StrictTable):
    """The keys that measurement sets and mappings of logs share."""

    format: int
    robot: Text
    gravity: Gravity = Field(default_factory=lambda: list(GRAVITY))
    torque_hold: Annotated[float, Field(ge=0.0, le=LONGEST_HOLD)] = 0.0  # [s]
    torque: TorqueSide | None = None  # None: the data decide
    date: Recorded = None
    initial: Initial = Initial()
    controller: Controller | None = None
    drive: DriveTable | None = None
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
    """The `measurements.toml` that `path` (a set's folder, the file itself, or "demo") stands for."""
    file = Path(path)
    if str(path) == DEMO and not file.exists():
        file = sessions_dir() / DEMO_SET
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
    content.model.check_joints(content.joints, file)
    if content.drive is not None:
        content.drive.check_joints(content.joints, file)
    check_names(content, file)
    for index, group in enumerate(content.groups):
        place = f'group {index + 1} "{group.name}"'
        content.check_temperature(group.temperature, len(content.joints), file, place)
        check_clamped(group.kind, group.clamped, content.joints, file, place)
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
        from flexviz.model.effects import GOAL_EFFECT_NAMES, known_names

        if effect not in (*known_names(), *(GOAL_EFFECT_NAMES if content.drive else ())):
            meant = choose_from(effect, known_names(), limit=len(known_names()))
            own = "load a user-defined effect with --effects-from FILE"
            refuse("model.effects", f'effect "{effect}" is not known; {meant}; {own}')
    for index, group in enumerate(content.groups):
        if group.payload not in content.payloads:
            place = f'group {index + 1} "{group.name}", payload'
            meant = choose_from(group.payload, content.payloads)
            refuse(place, f'payload "{group.payload}" is not defined; {meant}')
