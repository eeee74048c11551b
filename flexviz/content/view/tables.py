"""HTML tables: measurement set, identified parameters and their identifiability."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flexviz.content.wording import (
    escape,
    mounting_text,
    number,
    plain_name,
    plural,
)
from flexviz.data.measurements import MeasurementSet

Truth = dict[tuple[str, str | None], float]  # (parameter, joint or payload) -> value


def set_html(measurements: MeasurementSet, missing: Sequence[str] = ()) -> str:
    """Summary of a measurement set; `missing` are the reasons for meshes that are not drawn."""
    kind = '<span class="fv-tag">simulated data</span>' if measurements.simulated else ""
    rates = sorted({round(1.0 / segment.step) for g in measurements.groups for segment in g.segments})
    rate = "–" if not rates else f"{rates[0]:g}" if len(rates) == 1 else f"{rates[0]:g}–{rates[-1]:g}"
    rows = [
        ("Robot", f"{escape(measurements.robot.name)}, {plural(measurements.n, 'joint')}"),
        *([("Mounting", mounted)] if (mounted := mounting_text(measurements.robot.gravity)) else []),
        ("Recorded", f"{plural(len(measurements.groups), 'group')}, {_minutes(measurements)}, {rate} Hz"),
        (
            "Controller gains",
            "given: replayed in closed loop" if measurements.kp is not None else "not given",
        ),
        ("Effects in the set", ", ".join(plain_name(name) for name in measurements.effects) or "none"),
    ]
    body = "".join(f"<tr><th>{name}</th><td>{value}</td></tr>" for name, value in rows)
    warnings = [*map(str, measurements.warnings[:3])]
    if missing:
        more = f" (and {plural(len(missing) - 1, 'other')})" if len(missing) > 1 else ""
        warnings.append(f"Drawn as sticks where meshes are missing: {missing[0]}{more}")
    notes = "".join(f'<div class="fv-warn">{escape(text)}</div>' for text in warnings)
    table = f'<table class="fv-table fv-left">{body}</table>'
    return f'<div class="fv"><b>{escape(measurements.name)}</b> {kind}{table}{notes}</div>'


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


def truth_html(truth: Truth | None) -> str:
    """The effects hidden in a simulated set."""
    if truth is None:
        return ""
    hidden = [(name, place, value) for (name, place), value in truth.items() if "." in name]
    if not hidden:
        return '<div class="fv fv-truth">Truth: no effect was hidden.</div>'
    listed = "; ".join(
        f"{plain_name(name)}{f' of {place}' if place else ''} {number(value)}"
        for name, place, value in hidden
    )
    return f'<div class="fv fv-truth">Truth: the hidden effects were {escape(listed)}.</div>'


def _minutes(measurements: MeasurementSet) -> str:
    seconds = sum(group.duration for group in measurements.groups)
    return f"{number(seconds, 3)} s" if seconds < 600 else f"{number(seconds / 60, 3)} min"
