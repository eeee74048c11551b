"""Measured torque and that of a model before and after, one small chart per joint."""

from __future__ import annotations

from collections.abc import Sequence

from flexviz.analysis.diagnosis import TorqueOverTime
from flexviz.content.charts import COLOURS, DASHED, TIME, Chart, ChartAxis, ChartSeries, thin
from flexviz.content.wording import TORQUE_SIGNAL, DrivingSignal


def torque_fit_charts(
    found: TorqueOverTime,
    joints: Sequence[str],
    names: Sequence[str],
    notes: Sequence[str],
    height: int,
    units: Sequence[str] = (),
    signal: DrivingSignal = TORQUE_SIGNAL,
) -> list[Chart]:
    """One chart per joint.

    Args:
        found: of one model, or of the first and the present one.
        joints: their names.
        names: of the models, in the legend.
        notes: one per joint.
        height: [px].
        signal: what drives the joints.
        units: of the joints' torque; empty if all are in Nm.
    """
    charts = []
    colours = (COLOURS.reference, COLOURS.model)[-len(found.residuals) :]
    for j, joint in enumerate(joints):
        torque = ChartAxis(signal.title.lower(), units[j] if units else "Nm")
        torques = [found.torque[:, j], *(found.torque[:, j] - left[:, j] for left in found.residuals)]
        time, lines = thin(found.time, torques)
        drawn = [ChartSeries("measured", COLOURS.measured, time, lines[0], 3.0)]
        for name, colour, line in zip(names, colours, lines[1:], strict=True):
            last = colour == COLOURS.model
            drawn.append(ChartSeries(name, colour, time, line, 1.2, () if last else DASHED))
        charts.append(
            Chart(
                f"torque:{joint}", joint, TIME, torque, tuple(drawn),
                description=f"{signal.title} of {joint} over time: measured, {', '.join(names)}. {notes[j]}",
                note=notes[j], height=height,
            )
        )  # fmt: skip
    return charts
