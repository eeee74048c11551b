"""HTML tables: measurement set, identified parameters and their identifiability."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from flexviz.analysis.identification import Identification
from flexviz.base.statistics import NORMAL_95
from flexviz.content.records import ParameterEstimate
from flexviz.content.results import LinkSide
from flexviz.content.wording import (
    MARKS,
    SYMBOLS,
    escape,
    estimate_cells,
    mounting_text,
    number,
    plain_name,
    plural,
    si_scale,
)
from flexviz.data.measurements import MeasurementSet
from flexviz.outlets.view.free_curves import physical
from flexviz.robot.model import INERTIAL_NAMES

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


def parameters_html(result: Identification | None, truth: Truth | None = None) -> str:
    """The parameter table: start, value ± 95 %, unit, identifiable, tied to; the truth on request."""
    if result is None:
        return '<div class="fv fv-dim">The parameters appear here after Run.</div>'
    main = [p for p in physical(result.parameters) if p.name not in INERTIAL_NAMES]
    inertial = [p for p in result.parameters if p.name in INERTIAL_NAMES]
    head = "<tr><th></th><th>start</th><th>value</th><th>± 95 %</th>"
    head += ("<th>truth</th>" if truth is not None else "") + "<th>unit</th><th>id.</th></tr>"
    encoders: dict[str | None, LinkSide] = {entry.joint: entry for entry in result.link_side}
    parts = [f'<div class="fv"><table class="fv-table">{head}{_rows(main, truth, encoders)}</table>']
    legend = " ".join(f'<span class="fv-{k}">{MARKS[k]}</span> {k}' for k in MARKS)
    parts.append(f'<div class="fv-dim">id. = identifiable: {legend}. ⚑ at its bound.</div>')
    if not result.refined:
        text = "± 95 % does not cover lag and droop of the filter: Refine removes the observer's bias."
        parts.append(f'<div class="fv-dim">{text}</div>')
    if len(main) + len(inertial) < len(result.parameters):
        parts.append('<div class="fv-dim">Free curves (not physics): see the plots, Where it fails.</div>')
    if inertial:
        parts.append(
            f"<details><summary>Inertial parameters ({len(inertial)})</summary>"
            f'<table class="fv-table">{head}{_rows(inertial, truth)}</table></details>'
        )
    return "".join(parts) + "</div>"


def _rows(
    parameters: Sequence[ParameterEstimate],
    truth: Truth | None,
    encoders: Mapping[str | None, LinkSide] = MappingProxyType({}),
) -> str:
    columns = 6 + (truth is not None)
    rows: list[str] = []
    joint: str | None = ""
    joints = [*dict.fromkeys(p.joint for p in parameters if p.joint is not None), None]
    for p in sorted(parameters, key=lambda p: joints.index(p.joint)):
        if p.joint != joint:
            joint = p.joint
            rows.append(
                f'<tr class="fv-group"><td colspan="{columns}">{escape(joint or "all joints")}</td></tr>'
            )
        half = NORMAL_95 * p.std if math.isfinite(p.std) else 0.0
        factor, unit = si_scale(max(abs(p.value), half), p.unit)
        value, error = estimate_cells(p, factor)
        real = ""
        if truth is not None:
            known = truth.get((p.name, p.payload or p.joint))
            real = f'<td class="fv-truth">{number(None if known is None else factor * known)}</td>'
        label = SYMBOLS.get(p.name, plain_name(p.name)) + (f", {p.payload}" if p.payload else "")
        mark = f'<span class="fv-{escape(p.identifiable)}">{MARKS.get(p.identifiable, "")}</span>'
        flag = " ⚑" if p.at_bound else ""
        rows.append(
            f'<tr title="{escape(plain_name(p.name))}"><td>{escape(label)}{flag}</td>'
            f"<td>{number(None if p.start is None else factor * p.start, 3)}</td>"
            f"<td><b>{value}</b></td><td>{error}</td>{real}<td>{escape(unit)}</td>"
            f"<td>{mark} {escape(p.identifiable)}</td></tr>"
        )
        if p.name == "stiffness" and (seen := encoders.get(p.joint)):
            style = "fv-tied" if seen.agrees else "fv-tied fv-warn"
            text = escape(f"link encoder: {seen.text}")
            rows.append(f'<tr class="{style}"><td colspan="{columns}">↳ {text}</td></tr>')
        if p.tied_to:
            names = escape(", ".join(map(_tied, p.tied_to[:4]))) + (" …" if len(p.tied_to) > 4 else "")
            rows.append(f'<tr class="fv-tied"><td colspan="{columns}">↳ tied to {names}</td></tr>')
    return "".join(rows)


def _tied(name: str) -> str:
    """ "motor_viscous_friction:joint1" as "f_mv of joint1"."""
    parameter, _, place = name.partition(":")
    return SYMBOLS.get(parameter, plain_name(parameter)) + (f" of {place}" if place else "")


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


MAX_NAMED = 8  # parameters in a sentence


def parameter_names(parameters: Sequence[ParameterEstimate]) -> str:
    """The first `MAX_NAMED` names, "K joint1", and the number of others."""
    first = parameters[:MAX_NAMED]
    names = [f"{SYMBOLS.get(p.name, plain_name(p.name))} {p.joint or ''}".strip() for p in first]
    more = len(parameters) - MAX_NAMED
    return ", ".join(names) + (f" and {plural(more, 'other')}" if more > 0 else "")


def check_html(result: Identification | None) -> str:
    """Number of identifiable parameters, and the names of the others.

    Inertial parameters are counted as combinations, because single ones are seldom identifiable.
    """
    if result is None:
        return ""
    main = [p for p in result.parameters if p.name not in INERTIAL_NAMES]
    weak = [p for p in main if p.identifiable == "weak"]
    no = [p for p in main if p.identifiable == "no"]
    good = len(main) - len(weak) - len(no)
    count = f"{good} of {len(main)}" if weak or no else f"All {len(main)}"
    lines = [f"<div>{count} parameters of joints and effects can be identified.</div>"]
    if weak:
        lines.append(f'<div class="fv-warn">Weak: {escape(parameter_names(weak))}.</div>')
    if no:
        lines.append(f'<div class="fv-warn">Not identifiable: {escape(parameter_names(no))}.</div>')
    if result.combinations:
        good = sum(c.identifiable == "yes" for c in result.combinations)
        lines.append(f'<div class="fv-dim">Inertia: {good} of {len(result.combinations)} combinations.</div>')
    return f'<div class="fv"><b>Checked with these groups and effects</b>{"".join(lines)}</div>'
