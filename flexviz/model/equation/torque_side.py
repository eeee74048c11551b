"""Which torque τ is: that of the motors, or one measured behind the gears, by joint torque sensors.

Such a sensor sees the transmission torque s itself, so that τ shows neither motor inertia nor motor friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.base.errors import InputError
from flexviz.base.nonnegative import nonnegative_least_squares
from flexviz.data.measurements import MeasurementSet
from flexviz.model.equation.link import LinkDynamics
from flexviz.model.equation.signals import Signals, build_signals
from flexviz.model.observers import ButterworthZeroPhase

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
    link = LinkDynamics(measurements.robot)
    regressor = link.regressor(q, v, a)
    torque = signals.tau[0].copy()
    for block in signals.blocks:
        torque[block.rows] -= regressor[block.rows] @ signals.payload[block.group].ravel()
    still, speed = np.zeros_like(q), np.sqrt(np.mean(v**2, axis=0)) + 1e-12
    # typical inertia that a joint moves, of the CAD model [kg m²]
    cad = [(slice(0, count), measurements.robot.cad_parameters)]
    moved = link.evaluate(cad, q, still, still).mass.mean(axis=0).diagonal()
    least = LEAST_MOTOR * moved
    used = [j for j, joint in enumerate(measurements.joints) if joint not in measurements.no_torque]
    rows = [_rows(j, n, regressor[:, j], v[:, j] / speed[j], a[:, j], torque[:, j]) for j in used]
    found = _decided(rows, count, least, signals.tau[0].std(axis=0))
    return TorqueEvidence(found.gain, float(np.median(found.dry[used])))


def _rows(j: int, n: int, regressor: Array, speed: Array, acceleration: Array, torque: Array) -> Array:
    """Equations of joint j: columns of Γ, of friction and offset, of B, and τ, shape (≤ N, 14 n + 1).

    Of its N samples, R of their QR decomposition: the same sums of squares in a few rows. Dry friction is
    the first of a joint's three columns; `speed` is relative to its root mean square.
    """
    own = 10 * n + 3 * j + np.arange(3)
    places = np.r_[np.arange(10 * n), own, 13 * n + j, 14 * n]
    columns = [np.tanh(speed / 0.02), speed, np.ones_like(speed), acceleration, torque]
    matrix = np.column_stack([regressor, *columns])
    seen: Bools = np.any(matrix, axis=0)  # a joint moves only the bodies behind it
    seen[-1] = True
    r: Any = np.linalg.qr(matrix[:, seen], mode="r")
    out = np.zeros((len(r), 14 * n + 1))
    out[:, places[seen]] = r
    return out


class _Decided(NamedTuple):
    """Log likelihood ratio, and dry friction (n,) in units of the torque's standard deviation."""

    gain: float
    dry: Array


def _decided(rows: list[Array], count: int, least: Array, spread: Array) -> _Decided:
    """The evidence from the `_rows` of m joints, each of `count` samples, and the least B (n,)."""
    n = len(least)
    ends = np.cumsum([len(part) for part in rows])[:-1]
    sigma = [float(np.linalg.norm(part[:, -1])) / np.sqrt(count) + 1e-12 for part in rows]
    unexplained = motors = coefficients = np.zeros(0)
    for _ in range(REWEIGHTINGS):
        whole = np.concatenate([part / size for part, size in zip(rows, sigma, strict=True)])
        columns, motors, target = whole[:, : 13 * n], whole[:, 13 * n : -1], whole[:, -1]
        scale = np.linalg.norm(columns, axis=0)
        left, size, right = np.linalg.svd(columns / np.where(scale > 0, scale, 1.0), full_matrices=False)
        shown = size > DEPENDENT * size[0]
        left = left[:, shown]
        unexplained = target - left @ (left.T @ target)
        motors = motors - left @ (left.T @ motors)
        coefficients = right[shown].T @ ((left.T @ target) / size[shown]) / np.where(scale > 0, scale, 1.0)
        found = np.linalg.lstsq(motors, unexplained, rcond=DEPENDENT)[0]
        parts = np.split(unexplained - motors @ found, ends)
        sigma = [
            one * float(np.linalg.norm(part)) / np.sqrt(count) + 1e-12
            for one, part in zip(sigma, parts, strict=True)
        ]
    with_motors = nonnegative_least_squares(motors, unexplained - motors @ least)[1]
    dry = np.abs(coefficients[10 * n :: 3]) / np.maximum(spread, 1e-12)
    return _Decided(float(0.5 * (with_motors**2 - np.sum(unexplained**2))), dry)
