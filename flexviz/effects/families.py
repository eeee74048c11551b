"""Families of effects that data often cannot separate."""

from __future__ import annotations

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
    "torque_scale": ("load_dependent_friction", "torque_gain"),
}
"""Name of a family -> its effects, the simplest first.

Dry friction: the members differ only near rest. Constant torque: they differ only in how the torque varies
over poses and payloads. Torque scale: friction in proportion to the load resembles a scaled torque.
"""

_FAMILY_OF = {effect: name for name, effects in EFFECT_FAMILIES.items() for effect in effects}


def family_of(effect: str) -> str | None:
    """The name of the family that an effect belongs to; None if it belongs to none."""
    return _FAMILY_OF.get(effect)
