"""What every export format writes for every effect: a new effect gets one entry in `EXPORTS`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass

from flexviz.effects import EFFECT_NAMES, EFFECTS

FORMAT_NAMES = ("urdf", "mjcf", "yaml", "json", "c", "python")
PARAMETER_FILES = ("yaml", "json")


@dataclass(frozen=True)
class Written:
    """An effect that a format contains.

    Attributes:
        meaning: what it becomes there.
        missing: what that does not reproduce, a clause; empty where it is the whole effect.
    """

    meaning: str
    _: KW_ONLY
    missing: str = ""


@dataclass(frozen=True)
class PerJoint(Written):
    """An effect that is one number per joint in generated code; several of them add up.

    Attributes:
        table: name of the numbers in `Laws`, of the array and of the section in the templates.
        parameter: the effect's parameter.
    """

    table: str
    parameter: str


@dataclass(frozen=True)
class PerRow(Written):
    """An effect that is a row of numbers in generated code.

    Attributes:
        table: name of the rows in `Laws`, of the array and of the section in the templates.
        columns: effect parameter -> name of the number in the code, in the row's order after the joint.
        joints: the columns before these, which hold joint indices.
    """

    table: str
    columns: Mapping[str, str]
    joints: tuple[str, ...] = ("joint",)


@dataclass(frozen=True)
class LeftOut:
    """An effect that a format does not contain.

    Attributes:
        because: the reason, a clause.
    """

    because: str


Entry = Written | LeftOut


@dataclass(frozen=True)
class EffectExport:
    """One effect in the formats that describe a robot.

    Attributes:
        code: in C and in Python.
        urdf, mjcf: in these.
    """

    code: Entry
    urdf: Entry
    mjcf: Entry


RIGID = LeftOut("a URDF's rigid joint has no place for it")
USER_DEFINED = LeftOut("a user-defined effect: its law exists only in its own file")
EVENT = LeftOut("an event of one recording, not a property of the robot")
UNREGISTERED = LeftOut("no export is registered for it")
FRICTION = Written("part of the joint's friction")
SINE = {"amplitude": "amplitude", "order": "order", "phase": "phase"}
EXPORTS: dict[str, EffectExport] = {
    "stiffness_hardening": EffectExport(
        code=PerJoint("cubic stiffness k3 [Nm/rad^3]", "cubic", "cubic_stiffness"),
        urdf=RIGID,
        mjcf=Written("cubic stiffness of the tendon"),
    ),
    "backlash": EffectExport(
        code=PerJoint("half the play b [rad]", "half_width", "half_width"),
        urdf=RIGID,
        mjcf=Written("slack of the tendon"),
    ),
    "joint_damping": EffectExport(
        code=PerJoint("joint damping D [Nm s/rad]", "damping", "damping"),
        urdf=RIGID,
        mjcf=Written("damping of the tendon"),
    ),
    "coulomb_friction": EffectExport(
        code=PerJoint("dry friction of the motor f_c [Nm]", "motor_coulomb", "coulomb"),
        urdf=FRICTION,
        mjcf=Written("frictionloss of the motor"),
    ),
    "link_coulomb_friction": EffectExport(
        code=PerJoint("dry friction of the link f_c [Nm]", "link_coulomb", "coulomb"),
        urdf=FRICTION,
        mjcf=Written("frictionloss of the link"),
    ),
    "stribeck_friction": EffectExport(
        code=PerRow(
            "Stribeck friction: f_s [Nm], v_s [rad/s]",
            "stribeck",
            {"stribeck": "stribeck", "velocity": "width"},
        ),
        urdf=RIGID,
        mjcf=LeftOut("MJCF has no friction that falls with speed"),
    ),
    "quadratic_friction": EffectExport(
        code=PerJoint("quadratic friction f_q [Nm s^2/rad^2]", "quadratic", "quadratic"),
        urdf=RIGID,
        mjcf=Written("quadratic damping of the motor"),
    ),
    "load_dependent_friction": EffectExport(
        code=PerJoint("load-dependent friction mu [-]", "load", "coefficient"),
        urdf=RIGID,
        mjcf=LeftOut("MJCF has no friction that follows the load"),
    ),
    "torque_ripple": EffectExport(
        code=PerRow("torque ripple: amplitude [Nm], order [-], phase [rad]", "ripple", SINE),
        urdf=RIGID,
        mjcf=LeftOut("MJCF has no torque that follows a sine of the angle"),
    ),
    "transmission_error": EffectExport(
        code=PerRow("transmission error: amplitude [rad], order [-], phase [rad]", "error", SINE),
        urdf=RIGID,
        mjcf=LeftOut("MJCF has no gear whose error follows a sine of the angle"),
    ),
    "friction_drift": EffectExport(
        code=PerRow(
            "viscous friction of a cold gear: relative rise [-], time constant [s]",
            "drift",
            {"relative_rise": "rise", "time_constant": "constant"},
        ),
        urdf=RIGID,
        mjcf=LeftOut("MJCF has no friction that fades with time; this is the warm robot"),
    ),
    "presliding_hysteresis": EffectExport(
        code=PerRow(
            "presliding friction: stiffness sigma [Nm/rad], sliding friction f_c [Nm]",
            "presliding",
            {"presliding_stiffness": "stiffness", "coulomb": "coulomb"},
        ),
        urdf=FRICTION,
        mjcf=Written(
            "frictionloss of the motor",
            missing="as frictionloss it slides as found; what it does before it slides is missing",
        ),
    ),
    "torque_offset": EffectExport(
        code=PerJoint("torque offset f_0 [Nm]", "offset", "offset"),
        urdf=RIGID,
        mjcf=Written("bias of the actuator"),
    ),
    "torque_gain": EffectExport(
        code=PerJoint(
            "the applied torque is 1 + g times the commanded one: g [-]", "gain_error", "gain_error"
        ),
        urdf=RIGID,
        mjcf=Written("gain of the actuator"),
    ),
    "torque_delay": EffectExport(
        code=PerJoint("how much later than commanded each torque acts [s]", "delay", "delay"),
        urdf=RIGID,
        mjcf=Written("delay of the actuator"),
    ),
    "cable_spring": EffectExport(
        code=PerJoint("spring on the link [Nm/rad]", "spring", "stiffness"),
        urdf=RIGID,
        mjcf=Written("stiffness of the link's joint"),
    ),
    "motor_coupling": EffectExport(
        code=PerRow(
            "inertia that couples another motor in B_ij [kg m^2]",
            "coupling",
            {"inertia": "inertia"},
            ("joint", "other"),
        ),
        urdf=RIGID,
        mjcf=LeftOut("MuJoCo's inertia matrix is symmetric, this coupling acts one way"),
    ),
    "payload_error": EffectExport(*[Written("mass and inertia of the payload")] * 3),
    "base_tilt": EffectExport(code=Written("gravity"), urdf=RIGID, mjcf=Written("gravity")),
    "external_contact": EffectExport(EVENT, EVENT, EVENT),
}


def entry_of(effect: str, target: str) -> Entry | None:
    """What a format writes for an effect; None where a library effect has no entry in `EXPORTS`."""
    if target in PARAMETER_FILES:
        return Written("parameters with standard errors and units, and the effect's equation")
    if effect in EXPORTS:
        found = EXPORTS[effect]
        return found.urdf if target == "urdf" else found.mjcf if target == "mjcf" else found.code
    return None if effect in EFFECT_NAMES else USER_DEFINED


def coverage() -> dict[tuple[str, str], Entry | None]:
    """(effect, format) -> what is written or why not, for every loaded effect and every format.

    None marks a pair that nobody has decided yet; for the effects of the library a test refuses it.
    """
    return {(effect, target): entry_of(effect, target) for effect in EFFECTS for target in FORMAT_NAMES}
