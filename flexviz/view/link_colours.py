"""Legend of the scene, and the colours of the links: the error beyond the noise floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.arrays import Array
from flexviz.charts import COLOURS, cividis, css, gradient
from flexviz.diagnosis import PredictionErrors
from flexviz.diagnosis import Step as DiagnosisStep
from flexviz.scene import RobotMotion
from flexviz.wording import escape, number, short_names

Errors = PredictionErrors | DiagnosisStep
LEAST_END = 5.0  # times the noise floor: errors below are never drawn bright


@dataclass(frozen=True, eq=False)
class LinkColours:
    """Errors of the joints in a group, as shares of their torque, and their scale.

    Attributes:
        rms: shape (n,) [Nm].
        share: shape (n,), rms ÷ spread of the torque; NaN where the torque is constant.
        beyond: shape (n,), what the share has more than the noise floor.
        end: of the scale, which starts at the noise floor.
    """

    rms: Array
    share: Array
    beyond: Array
    end: float

    @property
    def colours(self) -> list[tuple[int, int, int]]:
        """cividis: dark at the noise floor, bright at the end; grey if unknown."""
        return [cividis(float(value) / self.end) for value in self.beyond]


def link_colours(
    errors: Errors | None, group: str, spread: Sequence[float], earlier: Sequence[Errors] = ()
) -> LinkColours | None:
    """Colours in a group; None if unknown. The scale ends at the largest error of all models."""
    rms = None if errors is None else _rms(errors, group)
    if errors is None or rms is None:
        return None
    width = np.where(np.asarray(spread, float) > 0, spread, np.nan)
    floor = np.asarray(errors.noise_floor or np.zeros(len(rms)), float)
    ends = [_beyond(one, group) / width for one in (errors, *earlier) if _rms(one, group) is not None]
    ends.append(LEAST_END * floor / width)
    end = float(np.nanmax(np.array(ends), initial=0.0))
    return LinkColours(rms, rms / width, _beyond(errors, group) / width, end or 1.0)


def _rms(errors: Errors, group: str) -> Array | None:
    return next((np.asarray(rms, float) for name, rms, _ in errors.groups if name == group), None)


def _beyond(errors: Errors, group: str) -> Array:
    """What the error has more than the noise floor, (n,) [Nm]."""
    rms = np.asarray(_rms(errors, group), float)
    return np.sqrt(np.maximum(rms**2 - np.asarray(errors.noise_floor or 0.0) ** 2, 0.0))


def legend_html(
    found: LinkColours | None,
    group: str,
    names: Sequence[str] = ("identified",),
    arcs: bool = True,
) -> str:
    """Legend of the scene; `names` are those of the models."""
    parts = [f"{_box(COLOURS.measured)}measured"]
    colours = zip(names, (COLOURS.model, COLOURS.beside), strict=False)
    parts += [f"{_box(colour, 'fv-ghost')}{escape(name)}" for name, colour in colours]
    rows = [" ".join(f'<span class="fv-name">{part}</span>' for part in parts)]
    if found is None:
        rows.append('<span class="fv-dim">Links are coloured by their error after Run.</span>')
    else:
        meant = (
            f"""<span title="in per cent of each joint's torque">Link: error in {escape(group)} [%]</span>"""
        )
        rows.append(
            f"{meant}, noise "
            f'<span class="fv-map" style="background:{gradient()}"></span> {number(100 * found.end, 2)}'
        )
    if arcs:
        ends = '<span class="fv-dim">(half a turn: value after /)</span>'
        rows.append(f"{_arc(COLOURS.torque)} τ {_arc(COLOURS.deflection)} deflection {ends}")
    return f'<div class="fv">{"".join(f"<div>{row}</div>" for row in rows)}</div>'


def _box(colour: str, kind: str = "") -> str:
    return f'<span class="fv-box {kind}" style="background:{colour}"></span>'


def _arc(colour: str) -> str:
    return f'<span class="fv-arc" style="border-color:{colour}"></span>'


def joints_html(
    joints: tuple[str, ...], found: LinkColours | None, motion: RobotMotion, time: float, chosen: int = -1
) -> str:
    """Error, torque and deflection of every joint at one instant [s], and the ends of its arcs."""
    torque, deflection = motion.loads(time)
    torque_end, deflection_end = motion.half_turns
    colours = [COLOURS.body] * len(joints) if found is None else found.colours
    rows = []
    for index, (name, full) in enumerate(zip(short_names(joints), joints, strict=True)):
        error = "–" if found is None else _percent(found, index)
        tip = "" if found is None else f' title="{number(float(found.rms[index]), 3)} Nm"'
        cells = [
            f'<td><span class="fv-box" data-fv-fade="{escape(full)} colour" '
            f'style="background:{css(colours[index])}"></span>{escape(name)}</td>',
            f'<td{tip} data-fv-count="{escape(full)} error">{error}</td>',
            _load(torque, torque_end, index, 1.0),
            _load(deflection, deflection_end, index, 1e3),
        ]
        look = "fv-joint fv-chosen" if index == chosen else "fv-joint"
        node, texts = full.replace("/", "_"), [escape(full)]
        if torque is not None:
            texts.append(f"torque {number(float(torque[index]), 3)} Nm")
        if deflection is not None:
            texts.append(f"deflection {number(1e3 * float(deflection[index]), 3)} mrad")
        if found is not None:
            texts.append(f"error {error}" if error.endswith("Nm") else f"error {error} %")
        data = f'data-node="{escape(node)}" data-hover="{", ".join(texts)}"'
        rows.append(f'<tr class="{look}" {data}>{"".join(cells)}</tr>')
    head = "<th>joint</th><th>error [%]</th><th>τ [Nm]</th><th>θ − q [mrad]</th>"
    table = f'<table class="fv-table fv-joints"><tr>{head}</tr>{"".join(rows)}</table>'
    return f'<div class="fv">{table}</div>'


def _load(values: Array | None, ends: Array | None, joint: int, factor: float) -> str:
    """A value with as many decimals as the end of its arc needs, and that end."""
    if values is None or ends is None:
        return "<td>–</td>"
    end = factor * float(ends[joint])
    decimals = min(max(1 - int(np.floor(np.log10(end))), 0), 4)
    value = f"{factor * float(values[joint]):z.{decimals}f}".replace("-", "−")
    return f'<td>{value} <span class="fv-dim">/ {number(end, 1)}</span></td>'


def _percent(found: LinkColours, index: int) -> str:
    share = float(found.share[index])
    return f"{number(100 * share, 2)}" if np.isfinite(share) else f"{number(float(found.rms[index]), 2)} Nm"
