"""The names of the library's effects in display order; `flexviz/effects/<name>.py` defines each."""

from __future__ import annotations

EFFECT_NAMES: tuple[str, ...] = (
    "coulomb_friction",
    "stribeck_friction",
    "quadratic_friction",
    "directional_friction",
    "thinning_friction",
    "load_dependent_friction",
    "presliding_hysteresis",
    "startup_friction",
    "friction_drift",
    "temperature_friction",
    "torque_ripple",
    "torque_offset",
    "torque_gain",
    "torque_delay",
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

USER_NAMES: list[str] = []
"""Names of the loaded user-defined effects, in loading order."""


def is_user_defined(name: str) -> bool:
    """Whether the effect comes from a user's file."""
    return name in USER_NAMES


def known_names() -> tuple[str, ...]:
    """The names of the library's and of the user-defined effects."""
    return (*EFFECT_NAMES, *USER_NAMES)
