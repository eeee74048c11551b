"""τ in per cent or per mille of each drive's rated torque, as drives send it: another factor per joint."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from flexviz.checks.faults import Case, Fault, hypothesis
from flexviz.checks.hypotheses.torque_units import resized
from flexviz.checks.joint_fit import SMALLEST_SCALE
from flexviz.checks.thresholds import LIMITS

# of the rated torque: drives bear several times as much for a while, and a motion takes some of it
FRACTION, OVERLOAD = 0.1, 5.0
RATED_SPREAD = 1.5  # standard deviation of ln(rated torque [Nm]) of robots' drives, about 30 Nm


@hypothesis
def rated_torques(case: Case) -> Iterator[Fault]:
    """Of numbers that can be such shares and are not stated to be others; one common factor is a unit."""
    names, now = case.mapping.names, case.now
    entries = [case.mapping.joints[name] for name in names]
    stated = any("unit" in getattr(one.tau, "model_fields_set", ()) or one.torque_constant for one in entries)
    if now.free.any() or stated:
        return
    largest = np.max(np.abs(np.concatenate(case.comparison.torque)), axis=0)
    free = replace(now, free=np.ones(len(names), bool))
    slopes = np.array([fit.slope for fit in case.comparison.fits(free)])
    # a torque of which nothing is the masses' has no size; one size for all is a unit
    if np.any(slopes <= SMALLEST_SCALE) or np.std(np.log(slopes)) < LIMITS.mass_spread:
        return
    for share, parts in (("per cent", 100.0), ("per mille", 1000.0)):
        if not np.all(largest < OVERLOAD * parts) or np.all(largest < FRACTION * parts):
            continue
        unknown = len(names) * float(np.log(LIMITS.mass_spread / RATED_SPREAD))
        rated = {j: float(parts / slopes[j]) for j in case.every}
        values = {"share": share, "parts": parts, "rated": rated}
        yield Fault("rated", case.every, "tau", resized(1.0 / slopes), share, values=values, open=unknown)
