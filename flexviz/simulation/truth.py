"""`truth.json`: the values a simulation used, in the names of the JSON contract."""

from __future__ import annotations

from typing import Any

from flexviz.effects import EFFECTS
from flexviz.model import INERTIAL_UNITS, FlexibleModel
from flexviz.simulation.plan import Plan

FILE_NAME = "truth.json"


def truth(plan: Plan, seed: int) -> dict[str, Any]:
    """The content of `truth.json`."""
    return {
        "format": 1,
        "simulated": True,
        "preset": plan.name,
        "seed": seed,
        "start": plan.start,
        "note": plan.note,
        "joints": list(plan.robot.joints),
        "parameters": parameters(plan.model),
        "effects": effects(plan.model),
    }


def parameters(model: FlexibleModel) -> list[dict[str, Any]]:
    """All parameters of the model, without payload."""
    columns = {
        "stiffness": (model.stiffness, "Nm/rad"),
        "motor_inertia": (model.motor_inertia, "kg m²"),
        "link_viscous_friction": (model.link_viscous_friction, "Nm s/rad"),
        "motor_viscous_friction": (model.motor_viscous_friction, "Nm s/rad"),
        "viscous_friction_sum": (model.link_viscous_friction + model.motor_viscous_friction, "Nm s/rad"),
    }
    columns |= {name: (model.inertial[:, k], unit) for k, (name, unit) in enumerate(INERTIAL_UNITS.items())}
    return [
        {"name": name, "joint": joint, "value": float(values[i]), "unit": unit}
        for name, (values, unit) in columns.items()
        for i, joint in enumerate(model.joints)
    ]


def effects(model: FlexibleModel) -> list[dict[str, Any]]:
    """All effects with their parameters."""
    return [
        {
            "effect": effect.effect,
            "joint": effect.joint,
            "group": effect.group,
            "payload": effect.payload,
            "parameters": {
                name: {"value": float(value), "unit": EFFECTS[effect.effect].units[name]}
                for name, value in effect.parameters.items()
            },
        }
        for effect in model.effects
    ]
