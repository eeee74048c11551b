"""θ that no sensor has measured: a reference, or a computed signal, beside a measured τ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from flexviz.checks.issues import Issue
from flexviz.checks.samples import AllSamples, mask
from flexviz.data.measurements import Segment
from flexviz.data.noise import resolution, white_noise


@mask
def references(samples: AllSamples) -> Iterator[Issue]:
    """Angles that no sensor has measured."""
    noise = {samples.robot.joints[j]: value for j, value in unmeasured(samples.segments).items()}
    if noise:
        yield Issue("reference", "odd", tuple(noise), "theta", {"noise": noise})


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
