"""Export coverage: the entry of every effect in every format's registry.

YAML and JSON hold the parameters of any effect and need no registry. What becomes of servos that follow
goals is stated by the effects themselves (`Effect.servo_targets`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from flexviz.model.compensation import ELASTIC, by_speed_and_load
from flexviz.model.effects import EFFECTS, LeftOut, Written, free_curve, is_user_defined
from flexviz.model.simulation import scaled_body, tilted_gravity
from flexviz.robot.robot import PayloadBody

Values = Mapping[str, float]  # an effect's parameters by name


@dataclass(frozen=True)
class DerivedNumber:
    """A second number per joint, computed from an effect's parameters."""

    meaning: str
    table: str
    number: Callable[[Values], float]


@dataclass(frozen=True)
class PerJoint(Written):
    """An effect with one number per joint in generated code; repeated effects add up."""

    table: str  # name in `Laws`, of the array and of the template section
    parameter: str  # the effect's parameter
    also: DerivedNumber | None = None  # a second array of the same section
    always: bool = False  # part of every robot's code, zero or not; has no template section
    signed: bool = False  # its torque has the sign of the motor's velocity

    def number(self, values: Values) -> float:
        """The joint's number."""
        return values[self.parameter]

    @property
    def arrays(self) -> tuple[PerJoint | DerivedNumber, ...]:
        """All arrays of the effect."""
        return (self,) if self.also is None else (self, self.also)


@dataclass(frozen=True)
class PerRow(Written):
    """An effect with one row of numbers in generated code."""

    table: str  # name in `Laws`, of the array and of the template section
    # effect parameter -> column name in the code, in the row's order after the joints
    columns: Mapping[str, str]
    joints: tuple[str, ...] = ("joint",)  # leading columns, which hold joint indices
    signed: bool = False  # its torque has the sign of the motor's velocity


@dataclass(frozen=True)
class OnPayload(Written):
    """An effect that changes the payload's bodies."""

    body: Callable[[PayloadBody, Values], PayloadBody]


@dataclass(frozen=True)
class OnGravity(Written):
    """An effect that changes gravity [m/s²] in the base's frame."""

    gravity: Callable[[Values, tuple[float, float, float]], tuple[float, float, float]]  # from the stated one


Entry = Written | LeftOut


RIGID = LeftOut("a URDF has rigid joints only")
USER_DEFINED = LeftOut("a user-defined effect: its law exists only in its own file")
STOPGAP = LeftOut("a free curve is not physics; as a table it is next to parameters.json")
EVENT = LeftOut("an event of one recording, not a property of the robot")
UNREGISTERED = LeftOut("no export is registered for it")
PAYLOAD = OnPayload(
    "mass and inertia of the payload",
    lambda body, values: scaled_body(body, 1.0 + values["relative_mass_error"]),
)
GRAVITY = OnGravity(
    "gravity", lambda values, stated: tilted_gravity(values["tilt_x"], values["tilt_y"], stated)
)
SPRING_TORQUE = DerivedNumber(
    "minus its torque at q = 0 [Nm]",
    "spring_torque",
    lambda values: values["stiffness"] * values["rest_angle"],
)
SINE = {"amplitude": "amplitude", "order": "order", "phase": "phase"}
BALANCE = {"sine": "sine", "cosine": "cosine"}
COUPLED = {"coulomb": "coulomb", "viscous": "viscous"}
STRIBECK = {"stribeck": "stribeck", "velocity": "width"}
THINNING = {"thinning": "thinning", "velocity": "width"}
DRIFT = {"relative_rise": "rise", "time_constant": "constant"}
DAHL = {"presliding_stiffness": "stiffness", "coulomb": "coulomb"}
SYMMETRIC = LeftOut("friction in MJCF is the same in both directions")
FRICTION = Written("part of the joint's friction")


class Coverage(NamedTuple):
    """An effect in generated code, in MJCF and in URDF."""

    code: PerJoint | PerRow | OnPayload | OnGravity | LeftOut
    mjcf: Entry
    urdf: Entry = RIGID


COVERAGE = {
    "stiffness_hardening": Coverage(
        PerJoint("cubic stiffness k3 [Nm/rad^3]", "cubic", "cubic_stiffness"),
        Written("cubic stiffness of the tendon"),
    ),
    "backlash": Coverage(
        PerJoint("backlash half width b [rad]", "half_width", "half_width"), Written("slack of the tendon")
    ),
    "joint_damping": Coverage(
        PerJoint("joint damping D [Nm s/rad]", "damping", "damping"), Written("damping of the tendon")
    ),
    "coulomb_friction": Coverage(
        PerJoint("dry friction of the motor f_c [Nm]", "motor_coulomb", "coulomb", signed=True),
        Written("frictionloss of the motor"),
        FRICTION,
    ),
    "link_coulomb_friction": Coverage(
        PerJoint("dry friction of the link f_c [Nm]", "link_coulomb", "coulomb"),
        Written("frictionloss of the link"),
        FRICTION,
    ),
    "quadratic_friction": Coverage(
        PerJoint("quadratic friction f_q [Nm s^2/rad^2]", "quadratic", "quadratic"),
        Written("quadratic damping of the motor"),
    ),
    "directional_friction": Coverage(
        PerJoint("directional friction f_d [Nm s/rad]", "directional", "directional"), SYMMETRIC
    ),
    "thinning_friction": Coverage(
        PerRow("shear-thinning friction: f_t [Nm], v_t [rad/s]", "thinning", THINNING),
        LeftOut("MJCF has no friction that levels off with speed"),
    ),
    "load_dependent_friction": Coverage(
        PerJoint("load-dependent friction mu [-]", "load", "coefficient", signed=True),
        LeftOut("MJCF has no load-dependent friction"),
    ),
    "driving_friction": Coverage(
        PerRow(
            "load-dependent friction while the motor and while the load drives: mu_m, mu_l [-]",
            "driving",
            {"motor_driving": "motor", "load_driving": "load"},
            signed=True,
        ),
        LeftOut("MJCF has no load-dependent friction"),
    ),
    "torque_offset": Coverage(
        PerJoint("torque offset f_0 [Nm]", "offset", "offset"), Written("bias of the actuator")
    ),
    "torque_gain": Coverage(
        PerJoint("torque gain error g [-]: applied = (1 + g) commanded", "gain_error", "gain_error"),
        Written("gain of the actuator"),
    ),
    "torque_delay": Coverage(
        PerJoint("delay from commanded to applied torque [s]", "torque_delay", "delay", always=True),
        Written("delay of the actuator"),
    ),
    "torque_limit": Coverage(
        LeftOut("the code states the torque that a motion takes, whatever the drive can give"),
        Written("force range of the actuator"),
        LeftOut("the effort limits of a URDF are those of its author"),
    ),
    "cable_spring": Coverage(
        PerJoint("spring on the link [Nm/rad]", "spring", "stiffness", SPRING_TORQUE),
        Written("stiffness of the link's joint"),
    ),
    "gravity_compensator": Coverage(
        PerRow("gravity compensator: torque at q = pi/2 and at q = 0 [Nm]", "compensator", BALANCE),
        LeftOut("MJCF has no torque that is a sine of the angle"),
    ),
    "stribeck_friction": Coverage(
        PerRow("Stribeck friction: f_s [Nm], v_s [rad/s]", "stribeck", STRIBECK, signed=True),
        LeftOut("MJCF has no friction that decreases with speed"),
    ),
    "torque_ripple": Coverage(
        PerRow("torque ripple: amplitude [Nm], order [-], phase [rad]", "ripple", SINE),
        LeftOut("MJCF has no torque that is a sine of the angle"),
    ),
    "transmission_error": Coverage(
        PerRow("transmission error: amplitude [rad], order [-], phase [rad]", "error", SINE),
        LeftOut("MJCF has no gear error that is a sine of the angle"),
    ),
    "friction_drift": Coverage(
        PerRow("cold-gear viscous friction: relative rise [-], time constant [s]", "drift", DRIFT),
        LeftOut("MJCF has no friction that decays with time; this is the warm robot"),
    ),
    "temperature_friction": Coverage(
        LeftOut("the code does not know the temperature; this is the robot at 20 °C"),
        LeftOut("MJCF has no friction that depends on temperature; this is the robot at 20 °C"),
    ),
    "presliding_hysteresis": Coverage(
        PerRow(
            "presliding friction: stiffness sigma [Nm/rad], sliding friction f_c [Nm]",
            "presliding",
            DAHL,
            signed=True,
        ),
        Written("frictionloss of the motor", missing="frictionloss reproduces sliding only, not presliding"),
        FRICTION,
    ),
    "startup_friction": Coverage(
        LeftOut("it depends on when the joint last stood still, of which the code keeps no record"),
        LeftOut("MJCF has no friction that fades along the path"),
    ),
    "motor_coupling": Coverage(
        PerRow(
            "inertia that couples another motor in B_ij [kg m^2]",
            "coupling",
            {"inertia": "inertia"},
            ("joint", "other"),
        ),
        LeftOut("MuJoCo's inertia matrix is symmetric, this coupling acts in one direction only"),
    ),
    "coupled_friction": Coverage(
        PerRow(
            "friction of a motor that turns with two joints: f_c [Nm], f_v [Nm s/rad]",
            "coupled",
            COUPLED,
            ("joint", "other"),
        ),
        Written("damping and frictionloss of a tendon over both motors"),
        LeftOut("the friction of a URDF joint depends on its own velocity only"),
    ),
    "payload_error": Coverage(PAYLOAD, PAYLOAD, PAYLOAD),
    "base_tilt": Coverage(GRAVITY, GRAVITY),
    "external_contact": Coverage(EVENT, EVENT, EVENT),
}
CODE = {name: row.code for name, row in COVERAGE.items()}
MJCF = {name: row.mjcf for name, row in COVERAGE.items()}
URDF = {name: row.urdf for name, row in COVERAGE.items()}
TABLE: dict[str, Entry] = {
    effect: Written("friction by speed and load")
    if by_speed_and_load(effect)
    else Written("deflection by torque")
    if effect in ELASTIC
    else LeftOut("the tables hold friction by speed and load, and deflection by torque, only")
    for effect in COVERAGE
}
REGISTRIES: Mapping[str, Mapping[str, Entry]] = {
    "urdf": URDF, "mjcf": MJCF, "c": CODE, "python": CODE, "table": TABLE,
}  # fmt: skip
PARAMETERS = Written("parameters with standard errors and units, and the effect's equation")
SERVO_TARGETS = ("urdf", "mjcf", "isaac", "bam")  # formats of servos but for the parameters
FORMAT_NAMES = ("urdf", "mjcf", "yaml", "json", "c", "python", "table")


def entry_of(effect: str, target: str) -> Entry | None:
    """A format's entry for an effect; None if a library effect is not registered."""
    if target in REGISTRIES and free_curve(effect) is not None:
        return STOPGAP
    if target in REGISTRIES:
        library = effect in EFFECTS and not is_user_defined(effect)
        return REGISTRIES[target].get(effect, None if library else USER_DEFINED)
    return PARAMETERS


def servo_entry_of(effect: str, target: str) -> Entry | None:
    """The same of a robot whose joints follow goals: what the effect itself states."""
    return EFFECTS[effect].servo_targets.get(target) if target in SERVO_TARGETS else PARAMETERS


def coverage() -> dict[tuple[str, str], Entry | None]:
    """(effect, format) -> entry, of every loaded effect and format; None if not registered."""
    return {(effect, target): entry_of(effect, target) for effect in EFFECTS for target in FORMAT_NAMES}
