"""Export coverage: the entry of every effect in every format's registry.

YAML and JSON hold the parameters of any effect and need no registry.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass

from flexviz.effects import EFFECTS, is_user_defined
from flexviz.robot import PayloadBody
from flexviz.simulation import scaled_body, tilted_gravity

Values = Mapping[str, float]  # an effect's parameters by name


@dataclass(frozen=True)
class Written:
    """An effect that a format contains: its representation, and the part that is not reproduced, a clause."""

    meaning: str
    _: KW_ONLY
    missing: str = ""


@dataclass(frozen=True)
class DerivedNumber:
    """A second number per joint, computed from an effect's parameters."""

    meaning: str
    table: str
    number: Callable[[Values], float]


@dataclass(frozen=True)
class PerJoint(Written):
    """An effect with one number per joint in generated code; repeated effects add up.

    Attributes:
        table: name in `Laws`, of the array and of the template section.
        parameter: the effect's parameter.
        also: a second array of the same section.
        always: part of every robot's code, zero or not; has no template section.
        signed: its torque has the sign of the motor's velocity.
    """

    table: str
    parameter: str
    also: DerivedNumber | None = None
    always: bool = False
    signed: bool = False

    def number(self, values: Values) -> float:
        """The joint's number."""
        return values[self.parameter]

    @property
    def arrays(self) -> tuple[PerJoint | DerivedNumber, ...]:
        """All arrays of the effect."""
        return (self,) if self.also is None else (self, self.also)


@dataclass(frozen=True)
class PerRow(Written):
    """An effect with one row of numbers in generated code.

    Attributes:
        table: name in `Laws`, of the array and of the template section.
        columns: effect parameter -> column name in the code, in the row's order after the joints.
        joints: leading columns, which hold joint indices.
        signed: its torque has the sign of the motor's velocity.
    """

    table: str
    columns: Mapping[str, str]
    joints: tuple[str, ...] = ("joint",)
    signed: bool = False


@dataclass(frozen=True)
class OnPayload(Written):
    """An effect that changes the payload's bodies."""

    body: Callable[[PayloadBody, Values], PayloadBody]


@dataclass(frozen=True)
class OnGravity(Written):
    """An effect that changes gravity [m/s²] in the base's frame."""

    gravity: Callable[[Values], tuple[float, float, float]]


@dataclass(frozen=True)
class LeftOut:
    """An effect that a format does not contain, with the reason as a clause."""

    because: str


Entry = Written | LeftOut


RIGID = LeftOut("a URDF has rigid joints only")
USER_DEFINED = LeftOut("a user-defined effect: its law exists only in its own file")
EVENT = LeftOut("an event of one recording, not a property of the robot")
UNREGISTERED = LeftOut("no export is registered for it")
PAYLOAD = OnPayload(
    "mass and inertia of the payload",
    lambda body, values: scaled_body(body, 1.0 + values["relative_mass_error"]),
)
GRAVITY = OnGravity("gravity", lambda values: tilted_gravity(values["tilt_x"], values["tilt_y"]))
SPRING_TORQUE = DerivedNumber(
    "minus its torque at q = 0 [Nm]",
    "spring_torque",
    lambda values: values["stiffness"] * values["rest_angle"],
)
SINE = {"amplitude": "amplitude", "order": "order", "phase": "phase"}

CODE: dict[str, PerJoint | PerRow | OnPayload | OnGravity | LeftOut] = {
    "stiffness_hardening": PerJoint("cubic stiffness k3 [Nm/rad^3]", "cubic", "cubic_stiffness"),
    "backlash": PerJoint("backlash half width b [rad]", "half_width", "half_width"),
    "joint_damping": PerJoint("joint damping D [Nm s/rad]", "damping", "damping"),
    "coulomb_friction": PerJoint(
        "dry friction of the motor f_c [Nm]", "motor_coulomb", "coulomb", signed=True
    ),
    "link_coulomb_friction": PerJoint("dry friction of the link f_c [Nm]", "link_coulomb", "coulomb"),
    "quadratic_friction": PerJoint("quadratic friction f_q [Nm s^2/rad^2]", "quadratic", "quadratic"),
    "load_dependent_friction": PerJoint("load-dependent friction mu [-]", "load", "coefficient", signed=True),
    "torque_offset": PerJoint("torque offset f_0 [Nm]", "offset", "offset"),
    "torque_gain": PerJoint(
        "torque gain error g [-]: applied = (1 + g) commanded", "gain_error", "gain_error"
    ),
    "torque_delay": PerJoint(
        "delay from commanded to applied torque [s]", "torque_delay", "delay", always=True
    ),
    "cable_spring": PerJoint("spring on the link [Nm/rad]", "spring", "stiffness", SPRING_TORQUE),
    "stribeck_friction": PerRow(
        "Stribeck friction: f_s [Nm], v_s [rad/s]",
        "stribeck",
        {"stribeck": "stribeck", "velocity": "width"},
        signed=True,
    ),
    "torque_ripple": PerRow("torque ripple: amplitude [Nm], order [-], phase [rad]", "ripple", SINE),
    "transmission_error": PerRow(
        "transmission error: amplitude [rad], order [-], phase [rad]", "error", SINE
    ),
    "friction_drift": PerRow(
        "cold-gear viscous friction: relative rise [-], time constant [s]",
        "drift",
        {"relative_rise": "rise", "time_constant": "constant"},
    ),
    "presliding_hysteresis": PerRow(
        "presliding friction: stiffness sigma [Nm/rad], sliding friction f_c [Nm]",
        "presliding",
        {"presliding_stiffness": "stiffness", "coulomb": "coulomb"},
        signed=True,
    ),
    "motor_coupling": PerRow(
        "inertia that couples another motor in B_ij [kg m^2]",
        "coupling",
        {"inertia": "inertia"},
        ("joint", "other"),
    ),
    "payload_error": PAYLOAD,
    "base_tilt": GRAVITY,
    "external_contact": EVENT,
}
FRICTION_IN_URDF = ("coulomb_friction", "link_coulomb_friction", "presliding_hysteresis")
URDF: dict[str, Entry] = {
    **dict.fromkeys(FRICTION_IN_URDF, Written("part of the joint's friction")),
    "payload_error": PAYLOAD,
    "external_contact": EVENT,
    "stiffness_hardening": RIGID,
    "backlash": RIGID,
    "joint_damping": RIGID,
    "quadratic_friction": RIGID,
    "load_dependent_friction": RIGID,
    "torque_offset": RIGID,
    "torque_gain": RIGID,
    "torque_delay": RIGID,
    "cable_spring": RIGID,
    "stribeck_friction": RIGID,
    "torque_ripple": RIGID,
    "transmission_error": RIGID,
    "friction_drift": RIGID,
    "motor_coupling": RIGID,
    "base_tilt": RIGID,
}
MJCF: dict[str, Entry] = {
    "stiffness_hardening": Written("cubic stiffness of the tendon"),
    "backlash": Written("slack of the tendon"),
    "joint_damping": Written("damping of the tendon"),
    "coulomb_friction": Written("frictionloss of the motor"),
    "link_coulomb_friction": Written("frictionloss of the link"),
    "quadratic_friction": Written("quadratic damping of the motor"),
    "load_dependent_friction": LeftOut("MJCF has no load-dependent friction"),
    "torque_offset": Written("bias of the actuator"),
    "torque_gain": Written("gain of the actuator"),
    "torque_delay": Written("delay of the actuator"),
    "cable_spring": Written("stiffness of the link's joint"),
    "stribeck_friction": LeftOut("MJCF has no friction that decreases with speed"),
    "torque_ripple": LeftOut("MJCF has no torque that is a sine of the angle"),
    "transmission_error": LeftOut("MJCF has no gear error that is a sine of the angle"),
    "friction_drift": LeftOut("MJCF has no friction that decays with time; this is the warm robot"),
    "presliding_hysteresis": Written(
        "frictionloss of the motor",
        missing="frictionloss reproduces sliding only, not presliding",
    ),
    "motor_coupling": LeftOut(
        "MuJoCo's inertia matrix is symmetric, this coupling acts in one direction only"
    ),
    "payload_error": PAYLOAD,
    "base_tilt": GRAVITY,
    "external_contact": EVENT,
}
REGISTRIES: Mapping[str, Mapping[str, Entry]] = {"urdf": URDF, "mjcf": MJCF, "c": CODE, "python": CODE}
FORMAT_NAMES = ("urdf", "mjcf", "yaml", "json", "c", "python")


def entry_of(effect: str, target: str) -> Entry | None:
    """A format's entry for an effect; None if a library effect is not registered."""
    if target in REGISTRIES:
        library = effect in EFFECTS and not is_user_defined(effect)
        return REGISTRIES[target].get(effect, None if library else USER_DEFINED)
    return Written("parameters with standard errors and units, and the effect's equation")


def coverage() -> dict[tuple[str, str], Entry | None]:
    """(effect, format) -> entry, of every loaded effect and format; None if not registered."""
    return {(effect, target): entry_of(effect, target) for effect in EFFECTS for target in FORMAT_NAMES}
