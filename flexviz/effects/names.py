"""The canonical names of the physical effects: the one list that files, commands and the registry share."""

from __future__ import annotations

EFFECT_NAMES: tuple[str, ...] = (
    "coulomb_friction",
    "stribeck_friction",
    "quadratic_friction",
    "load_dependent_friction",
    "presliding_hysteresis",
    "friction_drift",
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
    "payload_error",
    "base_tilt",
    "external_contact",
    "motor_coupling",
)

OWN: list[str] = []
"""Names of the effects that users have loaded from their own files, in that order."""


def known_names() -> tuple[str, ...]:
    """The library's names and those of the user's own effects."""
    return (*EFFECT_NAMES, *OWN)
