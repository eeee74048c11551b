"""θ that no sensor has measured: a reference, or a computed signal, beside a measured τ."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.checks.issues import Issue
from flexviz.data.logs import Mapping
from flexviz.data.measurements import GroupTable, Segment
from flexviz.data.noise import resolution, white_noise


def check_references(mapping: Mapping, tables: Sequence[GroupTable]) -> list[Issue]:
    """Angles that no sensor has measured, as an issue."""
    whole = [Segment(table.time, table.theta, table.tau, table.time[1] - table.time[0]) for table in tables]
    noise = {mapping.names[j]: value for j, value in unmeasured(whole).items()}
    return [Issue("reference", "odd", tuple(noise), "theta", {"noise": noise})] if noise else []


def unmeasured(segments: Sequence[Segment]) -> dict[int, float]:
    """Joint -> noise [rad] of its angle, where that is less than the finest encoder's counts leave.

    Its torque has a sensor's noise: a log that was filtered, or computed altogether, has neither.
    """
    if not segments:
        return {}
    theta = np.max([white_noise(one.theta) for one in segments], axis=0)
    tau = np.min([white_noise(one.tau) for one in segments], axis=0)
    finest, finest_torque = resolution(segments)
    moves = np.max([np.ptp(one.theta, axis=0) for one in segments], axis=0) > 0.0
    found = np.flatnonzero((theta < finest) & (tau > finest_torque) & moves)
    return {int(j): float(theta[j]) for j in found}
