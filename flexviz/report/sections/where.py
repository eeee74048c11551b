"""Where the model fails: the map of all joints, and the residual where most of it lives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.charts import COLOURS
from flexviz.diagnosis import FreeCurve, ResidualMap
from flexviz.report.blocks import Block, Cell, Figure, Section, Table, table, text
from flexviz.report.chart import Band, Chart, Curve
from flexviz.report.gathering import Subject
from flexviz.wording import number

NORMAL = 1.96  # standard errors in half a 95 % interval
COLUMNS = (
    "position", "velocity", "position × direction", "acceleration", "load", "time", "group", "frequency",
)  # fmt: skip
AGAINST = ("position", "velocity", "position × direction", "acceleration", "load", "time")
FLOOR_COLOUR = "#595959"
GREY = "#999999"
CURVE_COLOURS = (COLOURS.residual, COLOURS.model, "#0072B2", "#CC79A7")
DASHES = ("", "7 4", "2 3", "8 3 2 3")
MOST_CURVES = 4
LEAST = 1e-9  # of a logarithmic axis
WORTH = 0.05  # share below which nothing is pointed at


def where(subject: Subject) -> Section | None:
    """Map, curve, spectrum; None where they are not kept."""
    diagnosis = subject.diagnosis
    if diagnosis is None or not diagnosis.maps:
        return None
    blocks: list[Block] = [
        text(
            "How much of each joint's residual follows each variable, judged on stretches of time that had "
            "no part in it, so that noise scores about 0. A joint that stands at its noise has nothing left "
            "to explain, whatever the shares.",
            quiet=True,
        ),
        _map(subject, diagnosis.maps),
    ]
    worst = diagnosis.where[0].joint if diagnosis.where else diagnosis.maps[0].joint
    lead = leading(diagnosis.maps, worst)
    if lead is not None:
        blocks.append(Figure(against(lead)))
        spectrum = _find(diagnosis.maps, lead.joint, "frequency")
        if spectrum is not None:
            blocks.append(Figure(spectrum_chart(spectrum)))
    if diagnosis.free_curve is not None:
        blocks.append(Figure(free_curve(diagnosis.free_curve)))
    return Section("Where the model fails", tuple(blocks))


def leading(maps: Sequence[ResidualMap], joint: str) -> ResidualMap | None:
    """The map of a joint that says most: against the variable that explains most."""
    of_joint = [m for m in maps if m.joint == joint and m.variable in AGAINST]
    of_joint = [m for m in of_joint if np.count_nonzero(np.isfinite(m.mean).any(axis=0)) > 1]
    return max(of_joint, key=lambda m: m.explained, default=None)


def clear(found: ResidualMap) -> bool:
    """Whether a variable explains more than chance does, and enough to be worth a look."""
    return found.explained > NORMAL * found.explained_std and found.explained >= WORTH


def _find(maps: Sequence[ResidualMap], joint: str, variable: str) -> ResidualMap | None:
    return next((m for m in maps if (m.joint, m.variable) == (joint, variable)), None)


def _map(subject: Subject, maps: Sequence[ResidualMap]) -> Table:
    rows = []
    steps = subject.steps
    for j, joint in enumerate(subject.joints):
        row: list[str | Cell] = [joint]
        if steps and steps[-1].noise_floor:
            values = steps[-1].rms_validation or steps[-1].rms
            row.append(f"{number(values[j] / max(steps[-1].noise_floor[j], 1e-300), 2)} ×")
        else:
            row.append("–")
        for variable in COLUMNS:
            found = _find(maps, joint, variable)
            if found is None or not np.isfinite(found.explained):
                row.append("–")
                continue
            share = min(max(found.explained, 0.0), 1.0)
            row.append(Cell(f"{100 * share:.0f} %", share, clear(found)))
        rows.append(row)
    head = ("joint", "residual / noise", *COLUMNS)
    return table(
        head, rows, range(1, len(head)),
        "Share of each joint's residual that follows each variable; bold: clearly more than chance",
    )  # fmt: skip


def against(found: ResidualMap) -> Chart:
    """The mean residual against a variable, with what noise alone would fill."""
    shown = min(len(found.curves), MOST_CURVES)
    curves = tuple(
        Curve(
            found.centres[i],
            found.mean[i],
            found.curves[i] or "mean residual",
            CURVE_COLOURS[i],
            DASHES[i],
            2.0,
            marks=found.centres.shape[1] <= 40,
        )
        for i in range(shown)
    )
    with np.errstate(all="ignore"):
        half = NORMAL * np.max(np.where(np.isfinite(found.std[:shown]), found.std[:shown], 0.0), axis=0)
    x = found.centres[0]
    band = Band(x, -half, half, "95 % of what noise would give", GREY)
    share, error = 100 * max(found.explained, 0.0), 100 * NORMAL * found.explained_std
    words = f"{share:.0f} % ± {error:.0f} % of the residual of {found.joint} follows its {found.variable}"
    if clear(found):
        low, high = (number(edge, 3) for edge in found.range)
        words += f", most of it from {low} to {high} {found.unit}."
    else:
        words += ": no more than chance."
    words += f" Largest mean: {number(float(np.nanmax(np.abs(found.mean[:shown]))), 3)} Nm."
    return Chart(
        f"Residual of {found.joint} against {found.variable}",
        words,
        f"{found.variable} of {found.joint} [{found.unit}]",
        "mean residual [Nm]",
        curves,
        (band,),
        span=found.range if clear(found) else None,
    )


def spectrum_chart(found: ResidualMap) -> Chart:
    """The residual's spectrum above the noise floor."""
    names = found.curves
    curves = tuple(
        Curve(
            found.centres[i],
            np.maximum(found.mean[i], LEAST),
            name,
            COLOURS.residual if i == 0 else FLOOR_COLOUR,
            "" if i == 0 else "7 4",
        )
        for i, name in enumerate(names)
    )
    share, middle = 100 * max(found.explained, 0.0), number(sum(found.range) / 2, 3)
    words = f"Of the residual of {found.joint} above the noise floor, beyond the motion's own frequencies, "
    words += f"the strongest band of one hertz, near {middle} Hz, holds {share:.0f} %"
    words += "." if clear(found) else ": no more than chance."
    return Chart(
        f"Spectrum of the residual of {found.joint}",
        words,
        "frequency [Hz]",
        "residual [Nm/√Hz]",
        curves,
        logarithmic=True,
    )


def free_curve(found: FreeCurve) -> Chart:
    """What is missing, as a curve of free shape."""
    curves, bands = [], []
    for i, name in enumerate(found.directions):
        label = name or "free curve"
        curves.append(Curve(found.centres, found.value[i], label, CURVE_COLOURS[i], DASHES[i], 2.0))
        half = NORMAL * found.std[i]
        low, high = found.value[i] - half, found.value[i] + half
        bands.append(Band(found.centres, low, high, "95 %" if i == 0 else "", CURVE_COLOURS[i]))
    words = (
        f"A curve of free shape against the {found.variable} of {found.joint} would take "
        f"{100 * max(found.explained, 0.0):.0f} % of its residual: {found.note}. Largest torque: "
        f"{number(float(np.nanmax(np.abs(found.value))), 3)} Nm."
    )
    return Chart(
        f"What the model of {found.joint} lacks, drawn freely against {found.variable}",
        words,
        f"{found.variable} of {found.joint} [{found.unit}]",
        "missing torque [Nm]",
        tuple(curves),
        tuple(bands),
    )
