"""Legend of the scene, and the colours of the links: the errors that the status line sums up."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from flexviz.analysis.diagnosis import BAND_HERTZ, PredictionErrors
from flexviz.analysis.diagnosis import Step as DiagnosisStep
from flexviz.base.arrays import Array
from flexviz.base.units import joint_unit, unit_of_all
from flexviz.content.charts import COLOURS, cividis, css, gradient
from flexviz.content.records import FOLLOWING, TORQUE, JointErrors, stated_errors
from flexviz.content.scene import RobotMotion
from flexviz.content.wording import (
    TORQUE_SIGNAL,
    DrivingSignal,
    error_hover,
    error_whole,
    escape,
    number,
    short_names,
)

Errors = PredictionErrors | DiagnosisStep
LEAST_END = 5.0  # times the noise: errors below are never drawn bright
NOT_DETERMINED = "hatched: the data do not determine this joint's stiffness, so its deflection is not drawn"


@dataclass(frozen=True)
class LinkColours:
    """Errors of the joints with one model, and the end of the scale of their colours, in their unit."""

    errors: JointErrors
    end: float

    @property
    def colours(self) -> list[tuple[int, int, int]]:
        """cividis: dark at no error, bright at the end; grey if unknown."""
        return [cividis(value / self.end) for value in self.errors.values]


def link_colours(
    errors: Errors | None, spread: Sequence[float], earlier: Sequence[Errors] = ()
) -> LinkColours | None:
    """Colours by the stated errors; None if unknown. The scale ends at the largest error of all models."""
    if errors is None:
        return None
    shown = stated_errors(errors, spread)
    every = [shown, *(stated_errors(one, spread) for one in earlier)]
    ends = [value for one in every if one.unit == shown.unit for value in one.values if math.isfinite(value)]
    noise = [] if shown.mark is None else [LEAST_END * one for one in shown.mark.values if math.isfinite(one)]
    return LinkColours(shown, max([*ends, *noise], default=0.0) or 1.0)


def legend_html(
    found: LinkColours | None,
    names: Sequence[str] = ("identified",),
    arcs: bool = True,
    rigid: bool = False,
    signal: DrivingSignal = TORQUE_SIGNAL,
) -> str:
    """Legend of the scene; `names` are those of the models, `rigid`: no joint has elasticity."""
    parts = [f"{_box(COLOURS.measured)}measured"]
    colours = zip(names, (COLOURS.model, COLOURS.beside), strict=False)
    parts += [f"{_box(colour, 'fv-ghost')}{escape(name)}" for name, colour in colours]
    rows = [" ".join(f'<span class="fv-name">{part}</span>' for part in parts)]
    if found is None:
        rows.append('<span class="fv-dim">Links are coloured by their error after Run.</span>')
    else:
        band = "of the simulated motion" if found.errors.unit == FOLLOWING else f"below {BAND_HERTZ:g} Hz"
        tip = f"rms {band}, of the validation groups if there are any: as in the status line"
        rows.append(
            f'<span class="fv-tip" title="{tip}">Link: error [{found.errors.unit}]</span> 0 '
            f'<span class="fv-map" style="background:{gradient()}"></span> {number(found.end, 3)}'
        )
    if arcs:
        ends = '<span class="fv-dim">(half a turn: value after /)</span>'
        deflection = "" if rigid else f" {_arc(COLOURS.deflection)} deflection"
        symbol = (
            f'<span title="{signal.explanation}">{signal.symbol}</span>'
            if signal.explanation
            else signal.symbol
        )
        rows.append(f"{_arc(COLOURS.torque)} {symbol}{deflection} {ends}")
    return f'<div class="fv">{"".join(f"<div>{row}</div>" for row in rows)}</div>'


def _box(colour: str, kind: str = "") -> str:
    return f'<span class="fv-box {kind}" style="background:{colour}"></span>'


def _arc(colour: str) -> str:
    return f'<span class="fv-arc" style="border-color:{colour}"></span>'


def joints_html(
    joints: tuple[str, ...],
    found: LinkColours | None,
    motion: RobotMotion,
    time: float,
    chosen: int = -1,
    missing: Mapping[str, str] = MappingProxyType({}),
    units: Sequence[str] = (),
    signal: DrivingSignal = TORQUE_SIGNAL,
) -> str:
    """Error, torque and deflection of every joint at one instant [s], and the ends of its arcs.

    `missing`: what the verdict says is missing on a joint; `units`: of the joints' torque, empty: all in Nm.
    """
    units = units or (TORQUE,) * len(joints)
    lengths = [joint_unit("mrad", unit != TORQUE) for unit in units]
    torque, deflection = motion.loads(time)
    torque_end, deflection_end = motion.half_turns
    colours = [COLOURS.body] * len(joints) if found is None else found.colours
    rows = []
    for index, (name, full) in enumerate(zip(short_names(joints), joints, strict=True)):
        error = "–" if found is None else number(found.errors.values[index], 3)
        tip = "" if found is None else f' title="{error_hover(found.errors, index)}"'
        hatched = motion.determined is not None and not motion.determined[index]
        cells = [
            f'<td><span class="fv-box" data-fv-fade="{escape(full)} colour" '
            f'style="background:{css(colours[index])}"></span>{escape(name)}{_mark(missing.get(full))}</td>',
            f'<td{tip} data-fv-count="{escape(full)} error">{error}</td>',
            _load(torque, torque_end, index, 1.0),
            *([] if motion.rigid else [_load(deflection, deflection_end, index, 1e3, hatched)]),
        ]
        look = "fv-joint fv-chosen" if index == chosen else "fv-joint"
        node, texts = full.replace("/", "_"), [escape(full)]
        if torque is not None:
            texts.append(
                f"{signal.within.removeprefix('the ')} {number(float(torque[index]), 3)} {units[index]}"
            )
        if hatched and not motion.rigid:
            texts.append("deflection not determined")
        elif deflection is not None:
            texts.append(f"deflection {number(1e3 * float(deflection[index]), 3)} {lengths[index]}")
        if full in missing:
            texts.append(f"missing: {escape(missing[full])}")
        if found is not None:
            texts.append(f"error {error_whole(found.errors, index)}")
        data = f'data-node="{escape(node)}" data-hover="{", ".join(texts)}"'
        rows.append(f'<tr class="{look}" {data}>{"".join(cells)}</tr>')
    unit = "error" if found is None else f"error [{'%' if found.errors.relative else found.errors.unit}]"
    loads = f"<th>{signal.symbol} [{unit_of_all(units)}]</th>"
    loads += "" if motion.rigid else f"<th>θ − q [{unit_of_all(lengths)}]</th>"
    head = f"<th>joint</th><th>{unit}</th>{loads}"
    table = f'<table class="fv-table fv-joints"><tr>{head}</tr>{"".join(rows)}</table>'
    return f'<div class="fv">{table}</div>'


def _mark(missing: str | None) -> str:
    return f' <span class="fv-rises" title="missing: {escape(missing)}">◂</span>' if missing else ""


def _load(values: Array | None, ends: Array | None, joint: int, factor: float, hatched: bool = False) -> str:
    """A value with as many decimals as the end of its arc needs, and that end."""
    if values is None or ends is None:
        return "<td>–</td>"
    if hatched:
        return f'<td class="fv-hatched" title="{NOT_DETERMINED}">–</td>'
    end = factor * float(ends[joint])
    decimals = min(max(1 - math.floor(math.log10(end)), 0), 4)
    value = f"{factor * float(values[joint]):z.{decimals}f}".replace("-", "−")
    return f'<td>{value} <span class="fv-dim">/ {number(end, 1)}</span></td>'
