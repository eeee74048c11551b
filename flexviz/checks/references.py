"""θ that no sensor has measured: a reference, or a computed signal, beside a measured τ."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.checks.issues import Issue
from flexviz.data.logs import Mapping
from flexviz.data.measurements import GroupTable, Segment
from flexviz.data.noise import resolution, white_noise


def check_references(mapping: Mapping, tables: Sequence[GroupTable]) -> list[Issue]:
    """Angles with less noise than the finest encoder's counts leave, where the torque has a sensor's noise.

    A log that was filtered, or computed altogether, has neither.
    """
    if not tables:
        return []
    theta = np.max([white_noise(table.theta) for table in tables], axis=0)
    tau = np.min([white_noise(table.tau) for table in tables], axis=0)
    whole = [Segment(table.time, table.theta, table.tau, table.time[1] - table.time[0]) for table in tables]
    finest, finest_torque = resolution(whole)
    measured = tau > finest_torque
    moves = np.max([np.ptp(table.theta, axis=0) for table in tables], axis=0) > 0.0
    found = np.flatnonzero((theta < finest) & measured & moves)
    if not len(found):
        return []
    noise = {mapping.names[j]: float(theta[j]) for j in found}
    return [Issue("reference", "odd", tuple(noise), "theta", {"noise": noise})]
