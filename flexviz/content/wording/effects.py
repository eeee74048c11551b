"""An effect as text and as JSON, for command line, documents and app."""

from __future__ import annotations

import math
from typing import Any

from flexviz.model.effects import Effect, ParameterSpec, is_user_defined

ENTERS = {
    "torque": "u is subtracted from the transmission torque: s = τ − Bθ̈ − f_mv θ̇ − u",
    "deflection": "u is added to the link position: q = θ − s/K + u",
    "residual": "u is a torque on the link side: r = s − Y Γ − f_lv q̇ − u",
    "gravity": "Gravity is turned inside the regressor: r = s − Y Γ − f_lv q̇ with another g in Y",
}
SIMULATED = {
    "motor": "u opposes the motor: B θ̈ = τ − f_mv θ̇ − u − τ_j.",
    "link": "u opposes the link: M q̈ + C q̇ + g = τ_j − f_lv q̇ − u.",
    "joint": (
        "The joint torque is τ_j = K x + k₃ x³ + D ẋ with x = deadzone(θ + a sin(nθ + φ) − q, b); terms of "
        "absent effects are zero, and so is τ_j inside the gap."
    ),
}
SCOPES = {
    "joint": "a joint",
    "set": "the whole set",
    "payload": "a payload",
    "episode": "a joint, during part of one group",
}


def enters_text(effect: Effect) -> str:
    """How the effect's u enters the identification equation."""
    means = "u = τ_recorded − τ_applied: " if effect.where == "sensing" else ""
    return means + ENTERS[effect.entry]


def simulated_text(effect: Effect) -> str:
    """How the effect is simulated, as a sentence."""
    if is_user_defined(effect.name) and effect.simulation(effect.sizes()) is None:
        return "Not simulated: its class does not define a simulation."
    sign = " sign(v) is smoothed to tanh(v / 0.005 rad/s)." if "sign(" in effect.equation else ""
    return (effect.simulated or SIMULATED.get(effect.where, "")) + sign


def parameter_text(parameter: ParameterSpec) -> str:
    """Name and unit: "coulomb [Nm]"."""
    return f"{parameter.name} [{parameter.unit}]"


def bounds_text(parameter: ParameterSpec) -> str:
    """The bounds as short text: "≥ 0", "0.5 … 400", "any"."""
    low, high = (f"{bound:g}".replace("-", "−") for bound in (parameter.lower, parameter.upper))
    if math.isfinite(parameter.lower) and math.isfinite(parameter.upper):
        return f"{low} … {high}"
    if math.isfinite(parameter.lower):
        return f"≥ {low}"
    return f"≤ {high}" if math.isfinite(parameter.upper) else "any"


def relation_text(effect: Effect) -> str:
    """Which effect this one requires or replaces on its joint; empty if neither."""
    parts = []
    if effect.beside:
        parts.append(f"Only together with {effect.beside}.")
    if effect.replaces:
        parts.append(f"Replaces {effect.replaces} on its joint.")
    return " ".join(parts)


def effect_json(effect: Effect) -> dict[str, Any]:
    """All attributes of an effect; an infinite bound is None."""
    return {
        "name": effect.name,
        "title": effect.title,
        "where": effect.where,
        "belongs_to": effect.scope,
        "explanation": effect.explanation,
        "equation": effect.equation,
        "parameters": [
            {
                "name": p.name,
                "symbol": p.symbol,
                "unit": p.unit,
                "lower": p.lower if math.isfinite(p.lower) else None,
                "upper": p.upper if math.isfinite(p.upper) else None,
                "explanation": p.explanation,
            }
            for p in effect.parameters
        ],
        "signature": effect.signature,
        "simulated": simulated_text(effect),
        "confirm": effect.confirm,
        "beside": effect.beside,
        "replaces": effect.replaces,
        "reference": effect.reference,
    }
