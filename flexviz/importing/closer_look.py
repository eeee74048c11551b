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
from flexviz.importing.torque_checks import Hypothesis, opposite_signs, other_zeros
from flexviz.importing.torque_model import Reading, TorqueModel, improvement
from flexviz.measurements import Array

WRIST = 3  # last joints, of which neighbours may be coupled


def look_closer(mapping: Mapping, model: TorqueModel) -> list[Issue]:
    """The alternative that explains the torques clearly better than the mapping's reading, if any does."""
    start, names = Reading.unchanged(model.robot.n), mapping.names
    turned = [opposite_signs(mapping, start, (joint,))[-1] for joint in names]
    zeros = [zero for j in range(model.robot.n) for zero in other_zeros(mapping, model, start, j)]
    others = [other for other in (*turned, *zeros) if possible(model, other.reading)]
    others += couplings(mapping, start)
    shares = model.shares(start, any_scale=False)
    tried = [model.shares(other.reading, any_scale=False) for other in others]
    gains = [improvement(shares, after) for after in tried]
    k = int(np.argmax(gains))
    best, after = others[k], tried[k]
    if gains[k] < LIMITS.clear:
        return []
    worst = int(np.argmax([improvement(shares[j : j + 1], after[j : j + 1]) for j in range(len(names))]))
    left, without = (f"{100 * (1 - x[worst]):.2g} %" for x in (after, shares))
    message = f"with {best.reason} {left} of the torque of {names[worst]} is unexplained, without {without}"
    if best.reading.drive is not None:
        return coupling_issue(mapping, model, best.reading, after, message)
    alike = [
        o for o, gain in zip(others, gains, strict=True) if o is not best and gain > gains[k] - LIMITS.clear
    ]
    message += "".join(f"; or {o.reason} of {o.fixes[0].joint}" for o in alike if o.fixes)
    signals = " and ".join(fix.signal for fix in best.fixes)
    kind = "zero" if best.fixes[0].key == "offset" else "sign"
    return [Issue(kind, "odd", (best.fixes[0].joint,), signals, message, best.fixes)]


def coupling_issue(
    mapping: Mapping, model: TorqueModel, reading: Reading, shares: Array, message: str
) -> list[Issue]:
    """The issue of coupled motors; none where τ was converted and only its friction tells of them."""
    assert reading.drive is not None
    gain = improvement(shares, model.shares(replace(reading, converted=True), any_scale=False))
    if gain > LIMITS.clear:
        return []
    if gain > -LIMITS.clear:
        message += ", unless tau was converted already and only the friction is coupled"
    coupled = np.any(reading.drive + reading.drive.T != 2 * np.eye(len(shares)), axis=0)
    joints = tuple(joint for joint, is_coupled in zip(mapping.names, coupled, strict=True) if is_coupled)
    return [Issue("coupling", "odd", joints, "tau", message)]


def possible(model: TorqueModel, reading: Reading) -> bool:
    """Whether θ stays within the joints' limits, apart from joints that leave them as recorded."""
    recorded = np.concatenate([motion.q for _, motion in model.samples])

    def inside(q: Array) -> Array:
        lowest, highest = model.robot.lower_limit - LIMITS.zero, model.robot.upper_limit + LIMITS.zero
        return (np.min(q, axis=0) > lowest) & (np.max(q, axis=0) < highest)

    return bool(np.all(inside(recorded * reading.factor + reading.zero) | ~inside(recorded)))


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
