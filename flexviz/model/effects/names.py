"""Names of the library's effects in display order (`effects/<name>.py` defines each) and families."""

from __future__ import annotations

EFFECT_NAMES: tuple[str, ...] = (
    "coulomb_friction",
    "stribeck_friction",
    "quadratic_friction",
    "directional_friction",
    "thinning_friction",
    "load_dependent_friction",
    "driving_friction",
    "presliding_hysteresis",
    "startup_friction",
    "friction_drift",
    "temperature_friction",
    "torque_ripple",
    "torque_offset",
    "torque_gain",
    "torque_delay",
    "torque_limit",
    "stiffness_hardening",
    "backlash",
    "joint_damping",
    "transmission_error",
    "link_coulomb_friction",
    "cable_spring",
    "gravity_compensator",
    "payload_error",
    "base_tilt",
    "external_contact",
    "motor_coupling",
    "coupled_friction",
)

GOAL_EFFECT_NAMES = ("position_control", "goal_delay", "goal_lag", "goal_speed_limit", "dead_band")
"""Parts of the law of servos that follow goals; not listed, because no recorded torque shows them."""


EFFECT_FAMILIES: dict[str, tuple[str, ...]] = {
    "dry_friction": (
        "coulomb_friction",
        "link_coulomb_friction",
        "stribeck_friction",
        "presliding_hysteresis",
        "directional_friction",
        "startup_friction",
    ),
    "constant_torque": ("torque_offset", "base_tilt", "cable_spring", "gravity_compensator"),
    "torque_scale": ("load_dependent_friction", "driving_friction", "torque_gain"),
}
"""Name of a family -> its effects, the simplest first.

Dry friction: the members differ only near rest. Constant torque: they differ only in how the torque varies
over poses and payloads. Torque scale: friction in proportion to the load resembles a scaled torque.
"""

_FAMILY_OF = {effect: name for name, effects in EFFECT_FAMILIES.items() for effect in effects}

USER_NAMES: list[str] = []
"""Names of the loaded user-defined effects, in loading order."""


def is_user_defined(name: str) -> bool:
    """Whether the effect comes from a user's file."""
    return name in USER_NAMES


def known_names() -> tuple[str, ...]:
    """The names of the library's and of the user-defined effects."""
    return (*EFFECT_NAMES, *USER_NAMES)


def family_of(effect: str) -> str | None:
    """The name of the family that an effect belongs to; None if it belongs to none."""
    return _FAMILY_OF.get(effect)


def kin(effect: str) -> int:
    """How many laws an effect is chosen from: its family, or 1 for the simplest of one and for others."""
    family = _FAMILY_OF.get(effect)
    return 1 if family is None or EFFECT_FAMILIES[family][0] == effect else len(EFFECT_FAMILIES[family])
