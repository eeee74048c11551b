"""θ that no sensor has measured: a reference, or a computed signal, beside a measured τ."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flexviz.checks.issues import Issue
from flexviz.checks.samples import AllSamples, mask
from flexviz.data.noise import resolution, white_noise


@mask
def references(samples: AllSamples) -> Iterator[Issue]:
    """Angles with less noise than the finest encoder's counts leave, where the torque has a sensor's noise.

    A log that was filtered, or computed altogether, has neither.
    """
    groups = samples.groups
    if not groups:
        return
    theta = np.max([white_noise(group.theta) for group in groups], axis=0)
    tau = np.min([white_noise(group.tau) for group in groups], axis=0)
    finest, finest_torque = resolution(samples.segments)
    moves = np.max([np.ptp(group.theta, axis=0) for group in groups], axis=0) > 0.0
    if len(found := np.flatnonzero((theta < finest) & (tau > finest_torque) & moves)):
        noise = {samples.robot.joints[j]: float(theta[j]) for j in found}
        yield Issue("reference", "odd", tuple(noise), "theta", {"noise": noise})
