"""Which torque τ is: that of the motors, or one measured behind the gears, by joint torque sensors.

Such a sensor sees the transmission torque s itself, so that τ shows neither motor inertia nor motor friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from threadpoolctl import threadpool_limits

from flexviz.base.arrays import Array, Bools
from flexviz.base.errors import InputError
from flexviz.base.nonnegative import nonnegative_least_squares
from flexviz.checks.masks.means import TorqueMeans
from flexviz.checks.samples import GroupSamples
from flexviz.checks.set_samples import samples_of
from flexviz.data.measurements import MeasurementSet
from flexviz.robot._pinocchio import pin
from flexviz.robot.robot import Robot

BAND = 5.0  # [Hz] of the comparison: below the resonances of nearly all arms
SMOOTHED = 0.05  # [s] three means over it, one of the other, are 3 dB lower there
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
        with threadpool_limits(1, "blas"):  # the matrices are small: threads would wait for each other
            _FOUND[measurements] = torque_evidence(measurements)
    return _FOUND[measurements].behind_gear


def torque_evidence(measurements: MeasurementSet) -> TorqueEvidence:
    """Compare τ with and without motor inertias.

    In the band of the motion τ = Y(θ, θ̇, θ̈) Γ + B θ̈ + viscous and dry friction + offset, where all but B is
    free. Two hypotheses: B = 0 on all joints, or B ≥ `LEAST_MOTOR` · M_jj on all joints. Their misfits are
    compared, so that a joint whose B the data do not separate from the links' inertia (the first one of most
    arms) says nothing, and neither do data with little acceleration, or with large errors of the model.
    """
    samples = samples_of(measurements)
    step = max(sum(float(np.ptp(g.time)) for g in samples.groups) / MOST_SAMPLES, 1 / (2 * BAND))
    found = [(g, TorqueMeans.of(g, SMOOTHED, step)) for g in samples.groups]
    every = [(group, means) for group, means in found if means is not None]
    if not every:
        return TorqueEvidence(0.0, np.inf)
    try:
        loads = [_load(measurements.robot, group, means) for group, means in every]
    except InputError:  # bodies without mass
        return TorqueEvidence(0.0, np.inf)
    q, v, a, torque = (
        np.concatenate([getattr(means, name) for _, means in every]) for name in ("q", "v", "a", "torque")
    )
    return _compared(measurements, q, v, a, torque, torque - np.concatenate(loads))


def _load(robot: Robot, group: GroupSamples, means: TorqueMeans) -> Array:
    """(M, n) torque of the payload [Nm]."""
    if not group.bodies:
        return np.zeros_like(means.q)
    state = means.q, means.v, means.a
    return robot.cad_torques(group.bodies, *state) - robot.cad_torques((), *state)


def _compared(
    measurements: MeasurementSet, q: Array, v: Array, a: Array, recorded: Array, torque: Array
) -> TorqueEvidence:
    robot, model = measurements.robot, measurements.robot.model.copy()
    (count, n), data = q.shape, model.createData()
    states = list(zip(*map(robot.to_pin, (q, v, a)), strict=True))
    columns = (10 * robot.order[:, None] + np.arange(10)).ravel()
    rows = [pin.computeJointTorqueRegressor(model, data, *state) for state in states]
    regressor = np.array(rows).reshape(count, n, -1)  # of one joint Pinocchio gives a vector
    regressor = regressor[:, robot.order][:, :, columns]
    # typical inertia that a joint moves, of the CAD model [kg m²]
    moved = robot.from_pin(np.mean([np.diag(pin.crba(model, data, pose)) for pose, _, _ in states], axis=0))
    speed = np.sqrt(np.mean(v**2, axis=0)) + 1e-12
    used = [j for j, joint in enumerate(measurements.joints) if joint not in measurements.no_torque]
    parts = [_rows(j, n, regressor[:, j], v[:, j] / speed[j], a[:, j], torque[:, j]) for j in used]
    found = _decided(parts, count, LEAST_MOTOR * moved, recorded.std(axis=0))
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
