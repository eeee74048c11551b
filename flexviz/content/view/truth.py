"""What was true of a simulated set."""

from __future__ import annotations

from typing import Any

Truth = dict[tuple[str, str | None], float]  # (parameter, joint or payload) -> value


def truth_values(document: dict[str, Any]) -> Truth:
    """The values in a truth.json; effect parameters as "effect.parameter"."""
    values: Truth = {}
    for entry in document.get("parameters", []):
        values[str(entry["name"]), entry.get("joint")] = float(entry["value"])
    for effect in document.get("effects", []):
        for name, value in (effect.get("parameters") or {}).items():
            raw = value.get("value") if isinstance(value, dict) else value
            if isinstance(raw, int | float):
                place = effect.get("payload") or effect.get("joint")
                values[f"{effect['effect']}.{name}", place] = float(raw)
    for joint in {joint for name, joint in values if name == "link_viscous_friction"}:
        motor = values.get(("motor_viscous_friction", joint))
        if motor is not None:
            values["viscous_friction_sum", joint] = values["link_viscous_friction", joint] + motor
    return values
