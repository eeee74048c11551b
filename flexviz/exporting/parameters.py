"""Everything that was found, as JSON and as YAML: values with uncertainty, units and identifiability.

The documents have the keys of `identify --json`, and can be read again as a result (`documents.read_result`).
"""

from __future__ import annotations

import io
import json
from typing import Any

from flexviz import __version__
from flexviz.effects import EFFECTS
from flexviz.exporting.documents import finite
from flexviz.exporting.subject import Subject, left_out

AMBIGUOUS = ("yes", "no", "y", "n", "on", "off", "true", "false", "null", "~")
CONVENTIONS = {
    "motor": "all quantities of the motor are expressed at the joint: angle / N, torque × N, inertia × N²",
    "inertial": "of all that a joint moves, about the joint's frame; the payload is not contained",
    "std": "standard error; null where nothing is known; a 95 % interval is value ± 1.96 std",
    "identifiable": "yes: the data determine it; weak: hardly; no: it is near the value before the data",
    "tied_to": "parameters that the data cannot move independently of this one",
}


def json_parameters(subject: Subject) -> tuple[dict[str, bytes], list[str]]:
    """`parameters.json`"""
    text = json.dumps(parameters_document(subject), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    return {"parameters.json": text.encode()}, []


def yaml_parameters(subject: Subject) -> tuple[dict[str, bytes], list[str]]:
    """`parameters.yaml`"""
    from ruamel.yaml import YAML

    yaml = YAML()
    yaml.width = 10_000
    # many programs read YAML 1.1, where 1e-05 is a text and yes is no text: written so that both agree
    yaml.representer.add_representer(float, _represent_float)
    yaml.representer.add_representer(str, _represent_text)
    out = io.StringIO()
    yaml.dump(parameters_document(subject), out)
    comment = "".join(f"# {line}\n" for line in subject.heading)
    return {"parameters.yaml": (comment + out.getvalue()).encode()}, []


def parameters_document(subject: Subject) -> dict[str, Any]:
    """What both files hold."""
    ms, document, robot = subject.measurements, subject.document, subject.robot
    controller = None if ms.kp is None or ms.kd is None else {"kp": ms.kp.tolist(), "kd": ms.kd.tolist()}
    found = {
        "format": 1,
        "kind": "flexviz parameters",
        "flexviz": __version__,
        "set": ms.name,
        "set_sha256": subject.sha256,
        "simulated": ms.simulated,
        "robot": robot.source,
        "joints": list(robot.joints),
        "conventions": CONVENTIONS,
        "gravity": list(subject.laws.gravity),
        "payload": subject.payload,
        "torque_hold": ms.torque_hold,
        "controller": controller,
        "observer": document.observer,
        "refined": document.refined,
        "groups": document.groups,
        "converged": document.converged,
        "stopped": document.stopped,
        "verdict": subject.verdict,
        "remarks": list(subject.remarks),
        "parameters": [p.model_dump() for p in document.all_parameters],
        "base_parameters": document.base_parameters,
        "effects": effect_entries(subject),
        "residual": document.residual,
        "not_contained_in_code": left_out(subject, "c"),
    }
    return finite(found)


def effect_entries(subject: Subject) -> list[dict[str, Any]]:
    """The model's effects with their laws, values, standard errors and units."""
    entries = []
    for effect in subject.model.effects:
        law = EFFECTS[effect.effect]
        values = {}
        for spec in law.parameters:
            known = subject.estimate(effect, spec.name)
            std = subject.std(effect, spec.name) if known is None else known.std
            values[spec.name] = {
                "value": effect.parameters[spec.name],
                "std": std,
                "unit": spec.unit,
                "identifiable": None if known is None else known.identifiable,
            }
        entries.append(
            {
                "effect": effect.effect,
                "joint": effect.joint,
                "group": effect.group,
                "payload": effect.payload,
                "title": law.title,
                "equation": law.equation,
                "parameters": values,
            }
        )
    return entries


def _represent_text(representer: Any, text: str) -> Any:
    quoted = text.lower() in AMBIGUOUS
    return representer.represent_scalar("tag:yaml.org,2002:str", text, style='"' if quoted else None)


def _represent_float(representer: Any, value: float) -> Any:
    text = repr(value)
    if "e" in text and "." not in text:
        text = text.replace("e", ".0e", 1)
    return representer.represent_scalar("tag:yaml.org,2002:float", text)
