"""Where the model fails: the diagnosis' maps of the residual, as a table of all joints, as charts of one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexviz.charts import COLOURS, Line, Plot, cividis, css, no_plot
from flexviz.wording import escape, short_names

if TYPE_CHECKING:
    from flexviz.diagnosis import FreeCurve, ResidualMap

Array = NDArray[np.float64]

MAP_COLUMNS = {
    "position": "pos.",
    "velocity": "vel.",
    "acceleration": "acc.",
    "load": "load",
    "position × direction": "pos.±",
    "time": "time",
    "group": "group",
    "frequency": "freq.",
}
"""Variable -> head of its column."""
CHARTS = ("position", "velocity", "acceleration", "load")
FREE = "free"
HEIGHT = 150  # [pixels]
NORMAL = 1.96  # standard deviations of a 95 % interval
LEAST = 1e-9  # of a logarithmic axis


def map_of(maps: Sequence[ResidualMap], joint: str, variable: str) -> ResidualMap | None:
    """One joint's map against one variable, or None."""
    return next((one for one in maps if (one.joint, one.variable) == (joint, variable)), None)


def map_html(maps: Sequence[ResidualMap], joints: Sequence[str], chosen: int = 0) -> str:
    """Share of every joint's residual that each variable explains, in the colours of the scene."""
    if not maps:
        return ""
    head = "".join(f'<th title="{escape(name)}">{short}</th>' for name, short in MAP_COLUMNS.items())
    rows = []
    for index, (joint, short) in enumerate(zip(joints, short_names(tuple(joints)), strict=True)):
        cells = "".join(_cell(map_of(maps, joint, name), joint, name) for name in MAP_COLUMNS)
        label = f"<b>{escape(short)}</b>" if index == chosen else escape(short)
        rows.append(f"<tr><td>{label}</td>{cells}</tr>")
    return (
        '<div class="fv"><b>Share of the residual that each variable explains</b>'
        f'<table class="fv-table fv-heat"><tr><th></th>{head}</tr>{"".join(rows)}</table>'
        '<div class="fv-dim">Of the present model, out of sample: noise scores 0. '
        "pos.±: position and direction.</div></div>"
    )


def _cell(one: ResidualMap | None, joint: str, variable: str) -> str:
    if one is None:
        return "<td>–</td>"
    share = max(one.explained, 0.0)
    colour = cividis(share)
    ink = "#000" if sum(colour) > 330 else "#fff"
    exact = f"{100 * one.explained:.1f} ± {100 * NORMAL * one.explained_std:.1f} %"
    return (
        f'<td style="background:{css(colour)};color:{ink}" '
        f'title="{escape(joint)}, {escape(variable)}: {exact}">{100 * share:.0f} %</td>'
    )


def map_plots(maps: Sequence[ResidualMap], joint: str) -> tuple[Plot, ...]:
    """One joint's residual against every variable, with the band that noise would fill, and its spectrum.

    Against the position one curve a direction of motion where the direction matters.
    """
    plots = []
    for name in CHARTS:
        one = _directed(maps, joint) if name == "position" else None
        plots.append(_against(name, one or map_of(maps, joint, name)))
    plots.append(_spectrum(map_of(maps, joint, "frequency")))
    return tuple(plots)


def _directed(maps: Sequence[ResidualMap], joint: str) -> ResidualMap | None:
    """The map of position and direction, where it explains clearly more than either."""
    from flexviz.diagnosis import CLEARLY, DIRECTED  # heavy, and loaded wherever there are maps

    both = map_of(maps, joint, DIRECTED)
    simpler = [one for name in ("position", "velocity") if (one := map_of(maps, joint, name)) is not None]
    if both is None or not simpler:
        return None
    more = both.explained - max(one.explained for one in simpler)
    return both if more > max(CLEARLY, both.explained_std) else None


def _against(key: str, one: ResidualMap | None) -> Plot:
    if one is None:
        return no_plot(key, "")
    usable = np.isfinite(one.mean).all(axis=0) & np.isfinite(one.std).all(axis=0)
    if np.count_nonzero(usable) < 2:
        return no_plot(key, f"The {key} of {one.joint} hardly changes.")
    x = one.centres.mean(axis=0)[usable]
    colours = (COLOURS.residual, COLOURS.model)
    lines = [
        Line(name or "mean", colours[place % 2], mean[usable], 2.2, points=True)
        for place, (name, mean) in enumerate(zip(one.curves, one.mean, strict=True))
    ]
    half = NORMAL * one.std.max(axis=0)[usable]
    lines += [
        Line("noise +95 %", COLOURS.reference, half, 1.0),
        Line("noise −95 %", COLOURS.reference, -half, 1.0),
    ]
    band = (len(lines) - 2, len(lines) - 1)
    title = f"Residual of {one.joint} [Nm] against {key}, {100 * max(one.explained, 0.0):.0f} %"
    return Plot(key, title, x, tuple(lines), f"{key} [{one.unit}]", height=HEIGHT, bands=(band,))


def _spectrum(one: ResidualMap | None) -> Plot:
    if one is None or one.mean.shape[1] < 2:
        return no_plot("spectrum", "")
    lines = tuple(
        Line(name, colour, np.maximum(np.nan_to_num(values), LEAST))
        for name, colour, values in zip(
            one.curves, (COLOURS.residual, COLOURS.reference), one.mean, strict=False
        )
    )
    title = f"Spectrum of the residual of {one.joint} [Nm/√Hz]"
    x = one.centres[0]
    return Plot("spectrum", title, x, lines, "frequency [Hz]", logarithmic=True, height=HEIGHT)


# -- where nothing explains it ---------------------------------------------------------------------------


def free_plot(curve: FreeCurve | None, height: int = 190) -> Plot:
    """The curve for what no effect explains, with its 95 % interval."""
    if curve is None:
        return no_plot(FREE, "")
    values, spreads, names = curve.value, NORMAL * curve.std, curve.directions
    seen = np.isfinite(values) & np.isfinite(spreads)
    if not (seen.sum(axis=0) > 1).any():  # each direction where the other never is: one curve
        first = np.argmax(seen, axis=0)
        columns = np.arange(values.shape[1])
        values, spreads = values[first, columns][None], spreads[first, columns][None]
        seen, names = np.any(seen, axis=0, keepdims=True), ("",)
    usable: NDArray[np.bool_] = np.all(seen, axis=0)
    if np.count_nonzero(usable) < 2:
        return no_plot(FREE, "")
    colours = (COLOURS.residual, COLOURS.model)
    lines: list[Line] = []
    bands = []
    for place, (name, value, spread) in enumerate(zip(names, values, spreads, strict=True)):
        colour = colours[place % 2]
        lines.append(Line(name or "free curve", colour, value[usable], 2.2))
        for sign, label in ((1.0, "+"), (-1.0, "−")):
            lines.append(Line(f"{label}95 %", colour, value[usable] + sign * spread[usable], 0.7))
        bands.append((len(lines) - 2, len(lines) - 1))
    title = f"Stopgap: free torque of {curve.joint} [Nm] against {curve.variable}"
    label = f"{curve.variable} [{curve.unit}]"
    return Plot(FREE, title, curve.centres[usable], tuple(lines), label, height=height, bands=tuple(bands))


def free_html(curve: FreeCurve | None) -> str:
    """What the curve is, and what it is not."""
    if curve is None:
        return ""
    share = f"{100 * max(curve.explained, 0.0):.0f} ± {100 * NORMAL * curve.explained_std:.0f} %"
    sides = " and the direction of motion" if len(curve.directions) > 1 else ""
    return (
        f'<div class="fv fv-warn"><b>Stopgap.</b> A free curve against the {escape(curve.variable)}{sides} '
        f"of {escape(curve.joint)} would take {share} of its residual: {escape(curve.note)}.</div>"
    )
