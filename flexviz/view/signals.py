"""Torque of one joint over time: measured, as the model explains it, and what is left."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flexviz.charts import COLOURS, Plot, aligned, no_plot, time_plot
from flexviz.measurements import Group
from flexviz.scene import RobotMotion
from flexviz.view.where import left_out

if TYPE_CHECKING:
    from flexviz.identification import Identification

Array = NDArray[np.float64]


def torque(group: Group, joint: int) -> tuple[Array, Array]:
    """Time (N,) [s] and measured torque (N,) [Nm] of one joint over all segments."""
    time = np.concatenate([segment.time for segment in group.segments])
    return time, np.concatenate([segment.tau[:, joint] for segment in group.segments])


def model_torque(
    group: Group, joint: int, result: Identification | None
) -> tuple[Array, Array, Array] | None:
    """Time, model torque and residual (M,) [Nm] of one joint; None where the result has none for the group.

    The model torque is what the model says the motor must give: measured (filtered) torque minus residual.
    """
    series = None if result is None else result.residuals.get(group.name)
    if series is None or not len(series.time):
        return None
    time, residual = series.time, series.residual[:, joint]
    measured_time, measured = torque(group, joint)
    return time, np.interp(time, measured_time, measured) - residual, residual


def signals_plots(
    group: Group, joint: int, name: str, result: Identification | None, motion: RobotMotion | None
) -> tuple[Plot, ...]:
    """Torque, residual and motor-angle error of one joint."""
    time, measured = torque(group, joint)
    model = model_torque(group, joint, result)
    if model is None:
        first = time_plot(
            "torque", f"Torque, {name}", "Nm", time, [("measured", COLOURS.measured, measured)], height=200
        )
        why = "Model torque and residual appear here after Run (step 3, Identify)."
        waiting = no_plot("residual", why if result is None else left_out(group.name))
        return aligned((first, waiting, _error_plot(joint, name, motion)), time[0], time[-1])
    model_time, explained, residual = model
    inside = (time >= model_time[0]) & (time <= model_time[-1])
    lines = [
        ("measured", COLOURS.measured, measured[inside]),
        ("model", COLOURS.model, np.interp(time[inside], model_time, explained)),
    ]
    plots = (
        time_plot("torque", f"Torque, {name}", "Nm", time[inside], lines, height=200),
        time_plot(
            "residual",
            f"Residual, {name}",
            "Nm",
            model_time,
            [("residual", COLOURS.residual, residual)],
            height=200,
        ),
        _error_plot(joint, name, motion),
    )
    return aligned(plots, time[0], time[-1])


def _error_plot(joint: int, name: str, motion: RobotMotion | None) -> Plot:
    if motion is None or motion.model_theta is None:
        return no_plot("error", "")
    error = motion.model_theta[:, joint] - motion.theta[:, joint]
    return time_plot(
        "error",
        f"Simulated − measured θ, {name}",
        "rad",
        motion.time,
        [("error", COLOURS.model, error)],
        height=200,
    )
