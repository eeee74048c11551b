"""Which torque τ is: that of the motors, or one measured behind the gears, by joint torque sensors.

Such a sensor sees the transmission torque s itself, so that τ shows neither motor inertia nor motor friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from flexviz.arrays import Array
from flexviz.equation.link import LinkDynamics
from flexviz.equation.signals import Signals, build_signals
from flexviz.errors import InputError
from flexviz.measurements import MeasurementSet
from flexviz.nonnegative import nonnegative_least_squares
from flexviz.observers import ButterworthZeroPhase

BAND = 5.0  # [Hz] of the comparison: below the resonances of nearly all arms
MOST_SAMPLES = 1500  # of the comparison
LEAST_MOTOR = 0.1  # least inertia of a geared motor, in units of what its joint moves
MOST_DRY = 0.15  # dry friction behind a gear, in units of the torque's standard deviation
CERTAIN = 60.0  # log likelihood ratio; as the first effect of a diagnosis has to gain
REWEIGHTINGS = 4  # of the joints by their residuals
DEPENDENT = 1e-6  # relative singular value of combinations that the data do not show

_FOUND: WeakKeyDictionary[MeasurementSet, TorqueEvidence] = WeakKeyDictionary()


@dataclass(frozen=True)
class TorqueEvidence:
    """What the data say of τ.

    Attributes:
        gain: log likelihood ratio of "no joint has a motor inertia" over "every joint has at least that of
            the smallest geared motor"; 0 where the data do not tell.
        dry: dry friction of the typical joint, in units of the standard deviation of its torque.
    """

    gain: float
    dry: float

    @property
    def behind_gear(self) -> bool:
        """Whether τ was measured behind the gears."""
        return self.gain > CERTAIN and self.dry < MOST_DRY


def behind_gear(measurements: MeasurementSet) -> bool:
    """Whether τ is the torque behind the gears: as the set states, or else as its data show."""
    if measurements.torque is not None:
        return measurements.torque == "joint"
    if measurements not in _FOUND:
        _FOUND[measurements] = torque_evidence(measurements)
    return _FOUND[measurements].behind_gear


def torque_evidence(measurements: MeasurementSet) -> TorqueEvidence:
    """Compare τ with and without motor inertias.

    In the band of the motion τ = Y(θ, θ̇, θ̈) Γ + B θ̈ + viscous and dry friction + offset, where all but B is
    free. Two hypotheses: B = 0 on all joints, or B ≥ `LEAST_MOTOR` · M_jj on all joints. Their misfits are
    compared, so that a joint whose B the data do not separate from the links' inertia (the first one of most
    arms) says nothing, and neither do data with little acceleration, or with large errors of the model.
    """
    try:
        duration = sum(group.duration for group in measurements.groups)
        step = max(duration / MOST_SAMPLES, 1 / (2 * BAND))
        observer = ButterworthZeroPhase(2 * np.pi * BAND)
        signals = build_signals(
            measurements, measurements.groups, observer, sample_step=step, exact_step=True
        )
    except InputError:
        return TorqueEvidence(0.0, np.inf)
    return _compared(measurements, signals)


def _compared(measurements: MeasurementSet, signals: Signals) -> TorqueEvidence:
    q, v, a = signals.theta[:3]
    count, n = q.shape
    link, cad = LinkDynamics(measurements.robot), measurements.robot.cad_parameters.ravel()
    regressor = link.regressor(q, v, a)
    torque = signals.tau[0].copy()
    for block in signals.blocks:
        torque[block.rows] -= regressor[block.rows] @ signals.payload[block.group].ravel()
    still, speed = np.zeros_like(q), np.sqrt(np.mean(v**2, axis=0)) + 1e-12
    at_rest = link.regressor(q, still, still)
    # typical inertia that a joint moves, of the CAD model [kg m²]
    moved = [np.mean(((link.regressor(q, still, still + one) - at_rest) @ cad)[:, j])
             for j, one in enumerate(np.eye(n))]  # fmt: skip
    free = np.zeros((count, n, 13 * n))
    free[:, :, : 10 * n] = regressor
    inertia = np.zeros((count, n, n))
    for j in range(n):
        own = np.stack([np.tanh(v[:, j] / (0.02 * speed[j])), v[:, j], np.ones(count)], axis=1)
        free[:, j, 10 * n + 3 * j : 10 * n + 3 * j + 3] = own
        inertia[:, j, j] = a[:, j]
    least = LEAST_MOTOR * np.array(moved, float)
    used = [j for j, joint in enumerate(measurements.joints) if joint not in measurements.no_torque]
    found = _decided(torque[:, used], free[:, used], inertia[:, used], least, signals.tau[0].std(axis=0))
    return TorqueEvidence(found.gain, float(np.median(found.dry[used])))


class _Decided(NamedTuple):
    """Log likelihood ratio, and dry friction (n,) in units of the torque's standard deviation."""

    gain: float
    dry: Array


def _decided(torque: Array, free: Array, inertia: Array, least: Array, spread: Array) -> _Decided:
    """The evidence from τ (N, m), free columns (N, m, P), columns of B (N, m, n) and the least B (n,).

    Of the n joints, m have a torque.
    """
    n = len(least)
    sigma = np.sqrt(np.mean(torque**2, axis=0)) + 1e-12
    unexplained = motors = coefficients = np.zeros(0)
    for _ in range(REWEIGHTINGS):
        columns, motors = ((x / sigma[:, None]).reshape(torque.size, -1) for x in (free, inertia))
        target = (torque / sigma).ravel()
        scale = np.linalg.norm(columns, axis=0)
        left, size, right = np.linalg.svd(columns / np.where(scale > 0, scale, 1.0), full_matrices=False)
        shown = size > DEPENDENT * size[0]
        left = left[:, shown]
        unexplained = target - left @ (left.T @ target)
        motors = motors - left @ (left.T @ motors)
        coefficients = right[shown].T @ ((left.T @ target) / size[shown]) / np.where(scale > 0, scale, 1.0)
        found = np.linalg.lstsq(motors, unexplained, rcond=DEPENDENT)[0]
        residual = (unexplained - motors @ found).reshape(torque.shape)
        sigma = sigma * np.sqrt(np.mean(residual**2, axis=0)) + 1e-12
    with_motors = nonnegative_least_squares(motors, unexplained - motors @ least)[1]
    dry = np.abs(coefficients[-3 * n :: 3]) / np.maximum(spread, 1e-12)
    return _Decided(float(0.5 * (with_motors**2 - np.sum(unexplained**2))), dry)
