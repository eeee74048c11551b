"""Faults that leave the torques mostly explained: another zero of a joint, coupled wrist motors.

Friction, motor inertia and an offset explain most of a wrist's torque whatever its angle, so the explained
share alone does not tell. Every alternative is fitted to the same torques as the mapping's reading, and
counts where it leaves clearly less of them unexplained.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise, product

import numpy as np

from flexviz.importing.mapping import Issue, Mapping
from flexviz.importing.thresholds import LIMITS
from flexviz.importing.torque_checks import Hypothesis, improvement, other_zeros, percent
from flexviz.importing.torque_model import Reading, TorqueModel

WRIST = 3  # last joints, of which neighbours may be coupled


def look_closer(mapping: Mapping, model: TorqueModel) -> list[Issue]:
    """The alternative that explains the torques clearly better than the mapping's reading, if any does."""
    start = Reading.unchanged(model.robot.n)
    shares = model.shares(start, any_scale=False)
    zeros = [zero for j in range(model.robot.n) for zero in other_zeros(mapping, start, j)]
    others = [*(zero for zero in zeros if possible(model, zero.reading)), *couplings(mapping, start)]
    tried = [model.shares(other.reading, any_scale=False) for other in others]
    gains = [improvement(shares, after) for after in tried]
    k = int(np.argmax(gains))
    best, after = others[k], tried[k]
    if gains[k] < LIMITS.clear:
        return []
    doubt = ""
    if best.reading.drive is not None:  # the motors are coupled: were the torques converted already?
        converted = model.shares(replace(best.reading, converted=True), any_scale=False)
        if improvement(after, converted) > LIMITS.clear:
            return []
        if improvement(after, converted) > -LIMITS.clear:
            doubt = ", unless tau was converted already and only the friction is coupled"
    worst = int(np.argmax([improvement(shares[j : j + 1], after[j : j + 1]) for j in range(len(shares))]))
    message = (
        f"with {best.reason} the robot's model explains {percent(after[worst])} of the torque of "
        f"{mapping.names[worst]}, without {percent(shares[worst])}"
    )
    if best.reading.drive is not None:
        rows = np.flatnonzero(
            np.any(best.reading.drive + best.reading.drive.T != 2 * np.eye(len(shares)), axis=0)
        )
        return [Issue("coupling", "odd", tuple(mapping.names[j] for j in rows), "tau", message + doubt)]
    alike = (
        o for o, gain in zip(others, gains, strict=True) if o is not best and gain > gains[k] - LIMITS.clear
    )
    message += "".join(f"; or {o.reason} of {o.fixes[0].joint}" for o in alike if o.fixes)
    return [Issue("zero", "odd", (best.fixes[0].joint,), "theta", message, best.fixes)]


def possible(model: TorqueModel, reading: Reading) -> bool:
    """Whether θ stays within the joints' limits, apart from joints that leave them as recorded."""
    q = np.concatenate([motion.q for _, motion in model.samples])
    low, high = np.min(q, axis=0) - model.robot.lower_limit, model.robot.upper_limit - np.max(q, axis=0)
    recorded = np.minimum(low, high) > -LIMITS.zero
    read = np.minimum(low + reading.zero, high - reading.zero) > -LIMITS.zero
    return bool(np.all(read | ~recorded))


def couplings(mapping: Mapping, now: Reading) -> Iterator[Hypothesis]:
    """Neighbouring wrist joints of which one is turned by both motors: τ, or θ and τ, are the motors'."""
    wrist = range(len(mapping.names))[-WRIST:]
    for pair, turned, ratio, theta_too in product(pairwise(wrist), (0, 1), (1.0, -1.0), (False, True)):
        drive = np.eye(len(mapping.names))
        drive[pair[turned], pair[1 - turned]] = ratio
        joints = ", ".join(f'"{mapping.names[j]}"' for j in pair)
        matrix = drive[np.ix_(pair, pair)].astype(int).tolist()
        signals = "theta and tau" if theta_too else "tau"
        reason = f'coupling = {{ joints = [{joints}], matrix = {matrix} }} and side = "motor" of {signals}'
        yield Hypothesis(replace(now, drive=drive, theta_too=theta_too), (), reason)
