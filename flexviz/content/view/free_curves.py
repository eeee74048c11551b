"""Free curves as charts: the one that a diagnosis proposes, and those of a model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.analysis.diagnosis import Diagnosis
from flexviz.base.statistics import NORMAL_95
from flexviz.content.charts import Chart, ChartAxis, ChartSeries, Ribbon, no_chart
from flexviz.content.records import FreeCurve, ParameterEstimate, curve_tables
from flexviz.content.view.residuals import CURVES, FREE
from flexviz.content.wording import escape, number
from flexviz.model.effects import EFFECTS, free_curve


def offered_curve(diagnosis: Diagnosis | None) -> FreeCurve | None:
    """The free curve of a diagnosis; None also if it may explain nothing."""
    curve = None if diagnosis is None else diagnosis.free_curve
    return curve if curve is not None and curve.certain else None


def free_chart(curve: FreeCurve | None, height: int = 190) -> Chart:
    """The free curve fitted to a residual that no effect explains, with its 95 % interval.

    None is drawn that may explain nothing.
    """
    if curve is None or not curve.certain:
        return no_chart(FREE)
    values, halves, names = curve.value, NORMAL_95 * curve.std, curve.directions
    seen = np.isfinite(values) & np.isfinite(halves)
    if not (seen.sum(axis=0) > 1).any():  # each direction where the other never is: one curve
        first, columns = np.argmax(seen, axis=0), np.arange(values.shape[1])
        values, halves, names = values[first, columns][None], halves[first, columns][None], ("",)
    if np.count_nonzero(np.isfinite(values).all(axis=0)) < 2:
        return no_chart(FREE)
    x, series, ribbons = curve.centres, [], []
    for name, value, half, (colour, dash) in zip(names, values, halves, CURVES, strict=False):
        series.append(ChartSeries(name or "free curve", colour, x, value, 2.2, dash))
        ribbons.append(Ribbon("95 %", colour, x, value - half, value + half))
    largest = number(float(np.nanmax(np.abs(values))), 3)
    return Chart(
        FREE,
        f"Free torque of {curve.joint} against {curve.variable} (not physics)",
        ChartAxis(f"{curve.variable} of {curve.joint}", curve.unit),
        ChartAxis("missing torque", "Nm"),
        tuple(series),
        tuple(ribbons),
        description=f"A free curve against the {curve.variable} of {curve.joint} would explain "
        f"{100 * max(curve.explained, 0.0):.0f} % of its residual: {curve.note}. "
        f"Largest torque: {largest} Nm.",
        height=height,
    )


def free_html(curve: FreeCurve | None) -> str:
    """The share that the free curve explains, marked as not physics; empty if that may be nothing."""
    if curve is None or not curve.certain:
        return ""
    share = f"{100 * max(curve.explained, 0.0):.0f} ± {100 * NORMAL_95 * curve.explained_std:.0f} %"
    sides = " and the direction of motion" if len(curve.directions) > 1 else ""
    form = f" Its form is that of {escape(curve.form)}." if curve.form else ""
    return (
        f'<div class="fv fv-warn">A free curve against the {escape(curve.variable)}{sides} '
        f"of {escape(curve.joint)} would explain {share} of its residual: {escape(curve.note)}.{form}</div>"
    )


def physical(parameters: Sequence[ParameterEstimate]) -> list[ParameterEstimate]:
    """The parameters without those of free curves, which are shown as charts."""
    return [p for p in parameters if free_curve(p.name) is None]


def model_curve_charts(parameters: Sequence[ParameterEstimate], height: int = 190) -> tuple[Chart, ...]:
    """The free curves of a model, with their 95 % intervals."""
    charts = []
    for table in curve_tables(parameters):
        x, value, std = table.at, table.value, table.std
        series, ribbons = [], []
        for name, row, half, (colour, dash) in zip(
            table.directions, value, NORMAL_95 * std, CURVES, strict=False
        ):
            series.append(ChartSeries(name or "free curve", colour, x, row, 2.2, dash))
            ribbons.append(Ribbon("95 %", colour, x, row - half, row + half))
        variable = "speed" if table.variable == "velocity" else table.variable
        title = f"In the model: {EFFECTS[table.effect].title} on {table.joint}"
        charts.append(
            Chart(
                f"{table.effect}:{table.joint}",
                title,
                ChartAxis(f"{variable} of {table.joint}", table.unit),
                ChartAxis("torque", "Nm"),
                tuple(series),
                tuple(ribbons),
                description=f"{title}: {number(value.min(), 3)} to {number(value.max(), 3)} Nm"
                + (f"; its form is that of {table.form}." if table.form else "."),
                height=height,
            )
        )
    return tuple(charts)
