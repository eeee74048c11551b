"""The file of limits that a result has to keep: `flexviz verify SET --require limits.toml`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pydantic import Field

from flexviz.base import toml
from flexviz.base.errors import InputError, choose_from
from flexviz.base.schemas import Positive, StrictTable, validate
from flexviz.content.records import Verdict
from flexviz.model.effects import EFFECTS
from flexviz.robot.model import INERTIAL_NAMES

FORMAT = 1
OF_JOINTS = (
    "stiffness",
    "motor_inertia",
    "viscous_friction_sum",
    "motor_viscous_friction",
    "link_viscous_friction",
)


class JointLimits(StrictTable):
    """Limits of one joint; what is absent is not required.

    Attributes:
        held_out_percent: rms error on the held-out groups in per cent of the joint's torque (its standard
            deviation over all groups), or of how far its goals are ahead.
        held_out_torque: the same error [Nm].
        held_out_angle: of joints that follow goals, rms error of their free motion [rad].
        interval_percent: parameter → half of its 95 % interval in per cent of its value.
    """

    held_out_percent: Positive | None = None
    held_out_torque: Positive | None = None
    held_out_angle: Positive | None = None
    interval_percent: dict[str, Positive] = Field(default_factory=dict)

    def over(self, default: JointLimits) -> JointLimits:
        """These limits, and the default ones where a limit is absent."""
        own = {key: value for key, value in self if value is not None}
        own["interval_percent"] = default.interval_percent | self.interval_percent
        return default.model_copy(update=own)


class AcceptanceLimits(StrictTable):
    """A file of limits: `[default]` is for every joint, `[joints.NAME]` takes precedence.

    Attributes:
        verdict: verdicts on the final model that are accepted; empty: any.
    """

    format: int = FORMAT
    verdict: list[Verdict] = Field(default_factory=list)
    default: JointLimits = Field(default_factory=JointLimits)
    joints: dict[str, JointLimits] = Field(default_factory=dict)

    def of(self, joint: str) -> JointLimits:
        """The limits of a joint."""
        return self.joints.get(joint, JointLimits()).over(self.default)


def read_limits(file: Path, joints: Sequence[str]) -> AcceptanceLimits:
    """The limits in `file`, for a robot with these joints.

    Raises:
        InputError: naming the key and what is expected there.
    """
    limits = validate(AcceptanceLimits, toml.read(file), file, FORMAT)
    for joint in limits.joints:
        if joint not in joints:
            message = f"no such joint in the set; {choose_from(joint, joints)}"
            raise InputError(message, file=file, place=f"joints.{joint}")
    tables = {"default": limits.default} | {f"joints.{name}": one for name, one in limits.joints.items()}
    names = parameter_names()
    for place, table in tables.items():
        for name in table.interval_percent:
            if name not in names:
                message = f'no parameter "{name}"; {choose_from(name, names)}'
                raise InputError(message, file=file, place=f"{place}.interval_percent")
    if not limits.verdict and all(table == JointLimits() for table in tables.values()):
        keys = ", ".join(JointLimits.model_fields)
        raise InputError(f"has no limit, expected verdict, or one of {keys} in [default]", file=file)
    return limits


def parameter_names() -> list[str]:
    """Names of all parameters that a joint can have."""
    effects = [f"{name}.{p.name}" for name, effect in EFFECTS.items() for p in effect.parameters]
    return [*OF_JOINTS, *INERTIAL_NAMES, *effects]
