"""The residual away from reversals, where a model's friction torque is known."""

from __future__ import annotations

import numpy as np

from flexviz.arrays import Array
from flexviz.equation import Equation, Evaluation, OperatingPoint, pulses
from flexviz.identification.thresholds import IDENTIFICATION


def rms_between_reversals(
    equation: Equation, evaluation: Evaluation, point: OperatingPoint, x: Array, floor: Array
) -> tuple[float, ...]:
    """Rms residual per joint [Nm] of the samples that no reversal and no crossing of a gap disturbs.

    Around a reversal the torque of friction or backlash is unknown. A sample counts if the standard deviation
    of that torque, after the observer, is below the joint's noise floor.

    Args:
        equation: on the signals of the fitted groups.
        evaluation: at x.
        point: operating point of the effects at x.
        x: shape (P,).
        floor: shape (n,), rms due to measurement noise alone [Nm].

    Returns:
        one value per joint; of all samples where too few are undisturbed. Empty if nothing is unknown.
    """
    found = pulses(point, x, evaluation.link)
    if not found:
        return ()
    residual = evaluation.residual
    unknown = np.zeros_like(residual)  # variance [Nm²]
    for part in found:
        begin = equation.signals.blocks[part.block].rows.start
        for group in part.groups:
            first = max(group.first, part.rows.start)
            variance = np.sum(group.columns[first - group.first :] ** 2, axis=2)
            unknown[begin + first : begin + first + len(variance)] += variance
    known = unknown < floor**2
    known |= np.mean(known, axis=0) < IDENTIFICATION.undisturbed_share
    return tuple(np.sqrt(np.sum(known * residual**2, axis=0) / known.sum(axis=0)).tolist())
