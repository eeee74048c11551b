"""All identified values as JSON and YAML, with standard errors, units and identifiability.

The documents have the keys of `identify --json` and can be read back as a result (`flexviz.read_result`).
"""

from __future__ import annotations

import io
import json
from typing import Any
from urllib.parse import quote

import numpy as np

from flexviz import __version__
from flexviz.base.statistics import NORMAL_95
from flexviz.content.records import EffectEntry, EffectParameter
from flexviz.content.results import ResultDocument, curve_entries
from flexviz.model.effects import EFFECTS, FREE_CURVE_DIRECTIONS, free_curve
from flexviz.outlets.exporting.identified import FormatFiles, IdentifiedRobot

AMBIGUOUS = ("yes", "no", "y", "n", "on", "off", "true", "false", "null", "~")
OF_THE_FIT = (
    "observer",
    "refined",
    "groups",
    "converged",
    "stopped",
    "base_parameters",
    "residual",
    "torque_side",
)
CONVENTIONS = {
    "motor": "all quantities of the motor are expressed at the joint: angle / N, torque × N, inertia × N²",
    "inertial": "of all bodies that a joint moves, about the joint frame, without the payload",
    "std": f"standard error; null if unknown, as for identifiable no; 95 % interval: value ± {NORMAL_95} std",
    "identifiable": "yes: determined by the data; weak: weakly determined; no: near its prior value",
    "tied_to": "parameters that the data cannot separate from this one",
}


def json_parameters(identified: IdentifiedRobot) -> FormatFiles:
    """`parameters.json`, and a table of every free curve."""
    text = json.dumps(parameters_document(identified), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    return FormatFiles({"parameters.json": text.encode(), **curve_files(identified)}, [])


def curve_files(identified: IdentifiedRobot) -> dict[str, bytes]:
    """Every free curve as a table to interpolate linearly: `free_curve_position_joint1.csv`, in SI units."""
    out = {}
    for effect in identified.model.effects:
        curve = free_curve(effect.effect)
        if curve is None:
            continue
        at, torque = curve.fine(np.array([effect.parameters[p.name] for p in curve.parameters]))
        names = [f"{way}_torque" for way in FREE_CURVE_DIRECTIONS] if curve.sides == 2 else ["torque"]
        first = "speed" if curve.variable == "velocity" else curve.variable
        lines = [",".join((first, *names))]
        lines += [",".join(f"{v:.9g}" for v in row) for row in zip(at, *torque, strict=True)]
        joint = quote(effect.joint or "", safe="")  # names that differ keep files that differ
        out[f"{effect.effect}_{joint}.csv"] = ("\n".join(lines) + "\n").encode()
    return out


def yaml_parameters(identified: IdentifiedRobot) -> FormatFiles:
    """`parameters.yaml`"""
    from ruamel.yaml import YAML

    yaml = YAML()
    yaml.width = 10_000
    # YAML 1.1 readers take 1e-05 for a string and yes for a boolean: write what 1.1 and 1.2 read alike
    yaml.representer.add_representer(float, _represent_float)
    yaml.representer.add_representer(str, _represent_text)
    out = io.StringIO()
    yaml.dump(parameters_document(identified), out)
    comment = "".join(f"# {line}\n" for line in identified.heading)
    return FormatFiles({"parameters.yaml": (comment + out.getvalue()).encode()}, [])


def parameters_document(identified: IdentifiedRobot) -> dict[str, Any]:
    """Content of both files."""
    ms, document, robot = identified.measurements, identified.document, identified.robot
    controller = None if ms.kp is None or ms.kd is None else {"kp": ms.kp.tolist(), "kd": ms.kd.tolist()}
    about = {
        "format": 1,
        "kind": "flexviz parameters",
        "flexviz": __version__,
        "set": ms.name,
        "set_sha256": identified.sha256,
        "simulated": ms.simulated,
        "robot": robot.source,
        "joints": list(robot.joints),
        "conventions": CONVENTIONS,
        "gravity": list(identified.gravity),
        "payload": identified.payload,
        "torque_hold": ms.torque_hold,
        "controller": controller,
        "remarks": list(identified.remarks),
    }
    result = ResultDocument(
        format=1,
        set=ms.name,
        set_sha256=identified.sha256,
        verdict=identified.verdict,
        parameters=document.all_parameters,
        effects=effect_entries(document),
        **curve_entries(document.all_parameters),
        **{name: getattr(document, name) for name in OF_THE_FIT},
    )
    code = {} if identified.follows_goals else {"not_contained_in_code": identified.left_out("c")}
    return about | result.to_dict() | code


def effect_entries(document: ResultDocument) -> tuple[EffectEntry, ...]:
    """The model's effects with their laws, values, standard errors and units."""
    known = {p.label: p for p in document.all_parameters}
    entries = []
    for effect in document.all_effects:
        law = EFFECTS[effect.effect]
        place = {"joint": effect.joint, "payload": effect.payload, "group": effect.group}
        values = {}
        for spec in law.parameters:
            label = ":".join([f"{effect.effect}.{spec.name}", *filter(None, place.values())])
            value, p = effect.parameters[spec.name], known.get(label)
            values[spec.name] = EffectParameter(
                value=value.value,
                std=value.std if p is None else p.std,
                unit=value.unit if p is None else p.unit,
                identifiable=None if p is None else p.identifiable,
            )
        entries.append(EffectEntry(effect.effect, values, **place, title=law.title, equation=law.equation))
    return tuple(entries)


def _represent_text(representer: Any, text: str) -> Any:
    quoted = text.lower() in AMBIGUOUS
    return representer.represent_scalar("tag:yaml.org,2002:str", text, style='"' if quoted else None)


def _represent_float(representer: Any, value: float) -> Any:
    text = repr(value)
    if "e" in text and "." not in text:
        text = text.replace("e", ".0e", 1)
    return representer.represent_scalar("tag:yaml.org,2002:float", text)
