"""Held-out groups in which the robot stands still: they say nothing about what a motion needs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.measurements import Group, MeasurementSet
from flexviz.results import Note
from flexviz.wording import listed, plural

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.standstill


def without_still_groups(measurements: MeasurementSet) -> tuple[MeasurementSet, list[Note]]:
    """The set without held-out groups that stand still, and a note about them.

    At rest friction takes any value up to its limit: there, a model with the right friction predicts no
    better than one without.
    """
    ranges = np.max([_range(group) for group in measurements.fit_groups], axis=0)
    still = [
        group.name
        for group in measurements.validation_groups
        if np.all(_range(group) < LIMITS.still_range * ranges)
    ]
    if not still:
        return measurements, []
    kept = tuple(group for group in measurements.groups if group.name not in still)
    text = (
        f"held-out {plural(len(still), 'group')} {listed(still)}: the robot stands still, where static "
        "friction can take any value up to its limit; what is measured there judges no effect and counts in "
        "no error stated here"
    )
    return replace(measurements, groups=kept), [Note("other", text)]


def _range(group: Group) -> Array:
    """Of each motor's position, shape (n,) [rad]."""
    theta = np.concatenate([s.theta for s in group.segments])
    return np.ptp(theta, axis=0)
