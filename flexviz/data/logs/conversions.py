"""Other conversions of a column than the stated one: units, sides of the gear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from flexviz.data.logs.mapping import Fix, Mapping

GEARS = 5.0, 500.0  # smallest and largest ratio taken for a gear
# in which signals are recorded in practice
USUAL_UNITS = (("rad", "deg", "rev"), ("m", "mm"), ("Nm", "mNm", "Ncm"), ("N", "kN"))


@dataclass(frozen=True)
class ColumnChange:
    """Fixes of one joint's signal, and the factor by which they change its values."""

    fixes: tuple[Fix, ...] = ()
    factor: float = 1.0

    def __str__(self) -> str:
        values = ((f.key, f'"{f.value}"' if isinstance(f.value, str) else f.value) for f in self.fixes)
        return ", ".join(f"{key} = {value}" for key, value in values)


def change_of(mapping: Mapping, joint: str, name: str, keys: dict[str, Any]) -> ColumnChange:
    """Other values for keys of a signal."""
    entry = mapping.joints[joint]
    now = getattr(entry, name)
    factor = entry.scale(now.model_copy(update=keys)) / entry.scale(now)
    return ColumnChange(tuple(Fix(joint, name, key, value) for key, value in keys.items()), factor)


def conversions(mapping: Mapping, joint: str, name: str, further: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Another usual or further unit, or the other side of the gear, where that changes a signal's values."""
    signal = getattr(mapping.joints[joint], name)
    default = USUAL_UNITS[2 if name in ("tau", "tau_joint") else 0]
    units = next((units for units in USUAL_UNITS if signal.unit in units), default)
    other_side = "joint" if signal.side == "motor" else "motor"
    keys = [*({"unit": unit} for unit in (*units, *further)), {"side": other_side}]
    factors = (change_of(mapping, joint, name, one).factor for one in keys)
    return [one for one, factor in zip(keys, factors, strict=True) if abs(factor - 1.0) > 1e-5]


def theta_changes(mapping: Mapping, joint: str) -> list[ColumnChange]:
    """θ in other units or on the other side of the gear."""
    return [change_of(mapping, joint, "theta", one) for one in conversions(mapping, joint, "theta")]
