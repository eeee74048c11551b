"""Stiffness from link encoders, to compare with that of a fit, which has not seen them.

With a link encoder the deflection is measured. Its regression on the torque in the joint,

    θ(t) − q(t + d) = τ_j/K + d θ̇ + h sign(θ̇) + an intercept per stretch,

gives K without a motor model: the intercepts are offsets of the encoders, d the lag of one behind the other,
h hysteresis. τ_j is measured where there is a joint torque sensor; else the rigid link with the identified
inertias transmits it. The interval is from leaving out one block of the record after the other (jackknife:
Efron, Stein, Annals of Statistics 9, 1981), so that trajectories that disagree widen it, and from the
inertias' covariance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.base.statistics import NORMAL_95, student_95
from flexviz.content.records import ParameterEstimate
from flexviz.content.results import LinkSide
from flexviz.data.measurements import Group, MeasurementSet, Segment
from flexviz.model.equation import LinkDynamics
from flexviz.model.observers import ButterworthZeroPhase

HERTZ = 5.0  # band in which deflections are compared
SLOW = 0.01  # [rad/s] over which sign(θ̇) turns
BLOCKS = 5  # of each stretch, one of which is left out at a time
PASSES = 2  # the lag of one is the shift of the next


@dataclass(frozen=True, eq=False)
class Stretch:
    """One segment in the band of the comparison; N samples, n joints.

    Attributes:
        deflection: (N, n), θ − q [rad]; NaN for joints without a link encoder.
        torque: (N, n), in the joints [Nm].
        velocity: (N, n), θ̇ [rad/s].
        regressor: (N, n, 10n), ∂ torque/∂ inertial parameters, zero for measured torques.
    """

    deflection: Array
    torque: Array
    velocity: Array
    regressor: Array


def link_side_checks(
    measurements: MeasurementSet, inertial: Array, covariance: Array, stiffness: Sequence[ParameterEstimate]
) -> tuple[LinkSide, ...]:
    """One entry per joint that has a link encoder, in the order of the joints.

    Args:
        measurements: the set; all groups count, none of their q was fitted.
        inertial: shape (n, 10), inertial parameters of the links.
        covariance: shape (10n, 10n), of these.
        stiffness: of the fit, one per joint [Nm/rad].
    """
    encoders = [g for g in measurements.groups if g.q is not None]
    lag = np.zeros(measurements.n)
    out: list[LinkSide] = []
    if not encoders:
        return ()
    link = LinkDynamics(measurements.robot)
    for _ in range(PASSES):
        out = []
        stretches = [
            stretch
            for g in encoders
            for s in g.segments
            if (stretch := _stretch(measurements, link, g, s, inertial, lag)) is not None
        ]
        for j, (joint, fitted) in enumerate(zip(measurements.joints, stiffness, strict=True)):
            own = [s for s in stretches if np.isfinite(s.deflection[:, j]).all()]
            if not own:
                continue
            slopes, error = _regressed(own, j, covariance)
            lag[j] += slopes[1]
            measured = not any(s.regressor[:, j].any() for s in own)
            out.append(_entry(joint, slopes, error, lag[j], measured, fitted))
    return tuple(out)


def _stretch(
    measurements: MeasurementSet,
    link: LinkDynamics,
    group: Group,
    segment: Segment,
    inertial: Array,
    lag: Array,
) -> Stretch | None:
    """A segment with its link positions `lag` (n,) [s] later; None if it is too short."""
    band, step = ButterworthZeroPhase(2 * np.pi * HERTZ), segment.step
    keep = band.valid(segment.time)
    every = max(1, int(1 / (8 * HERTZ * step)))
    assert group.q is not None
    later = [
        np.interp(segment.time + d, group.time, column) for d, column in zip(lag, group.q.T, strict=True)
    ]
    measured = np.stack(later, axis=1)
    known: Bools = ~np.any(np.isnan(measured), axis=0)
    q = band.derivatives(np.where(known, measured, segment.theta), step, 3, position=True)[:, keep][
        :, ::every
    ]
    theta = band.derivatives(segment.theta, step, 2, position=True)[:, keep][:, ::every]
    if q.shape[1] < 4 * BLOCKS:
        return None
    parameters = inertial + measurements.robot.payload_parameters(group.bodies)
    torque, regressor = link.torque(parameters, *q), link.regressor(*q)
    sensor = group.at("tau_joint", segment.time)
    if sensor is not None:
        has: Bools = ~np.any(np.isnan(sensor), axis=0)
        seen = band.derivatives(np.where(has, sensor, 0.0), step, 1)[0, keep][::every]
        torque, regressor = np.where(has, seen, torque), np.where(has[:, None], 0.0, regressor)
    return Stretch(np.where(known, theta[0] - q[0], np.nan), torque, theta[1], regressor)


def _regressed(stretches: Sequence[Stretch], j: int, covariance: Array) -> tuple[Array, float]:
    """Coefficients of torque [rad/Nm], θ̇ [s] and sign(θ̇) [rad]; half the first one's 95 % interval."""
    columns, deflection, regressor, blocks = [], [], [], []
    for k, s in enumerate(stretches):
        v = s.velocity[:, j]
        one = np.stack((s.torque[:, j], v, np.tanh(v / SLOW)), axis=1)
        columns.append(one - one.mean(axis=0))
        deflection.append(s.deflection[:, j] - s.deflection[:, j].mean())
        regressor.append(s.regressor[:, j] - s.regressor[:, j].mean(axis=0))
        blocks.append(k * BLOCKS + np.arange(len(v)) * BLOCKS // len(v))
    x, y, block = np.concatenate(columns), np.concatenate(deflection), np.concatenate(blocks)
    scale = np.maximum(np.linalg.norm(x, axis=0), np.finfo(float).tiny)

    def fitted(rows: Bools) -> Array:
        return np.linalg.lstsq(x[rows] / scale, y[rows], rcond=1e-9)[0] / scale

    slopes = fitted(np.ones(len(y), bool))
    without = np.array([fitted(block != b)[0] for b in np.unique(block)])
    count = len(without)
    variance = (count - 1) / count * float(np.sum((without - without.mean()) ** 2))
    others = x[:, 1:] / scale[1:]
    pure = x[:, 0] - others @ np.linalg.lstsq(others, x[:, 0], rcond=1e-9)[0]
    moved = slopes[0] * np.concatenate(regressor).T @ pure / max(float(pure @ pure), np.finfo(float).tiny)
    variance += max(float(moved @ covariance @ moved), 0.0)
    return slopes, float(student_95(count - 1) * np.sqrt(variance))


def _entry(
    joint: str, slopes: Array, error: float, lag: float, measured: bool, fitted: ParameterEstimate
) -> LinkSide:
    compliance = float(slopes[0])
    low = 1 / (compliance + error) if compliance + error > 0 else None
    high = 1 / (compliance - error) if compliance > error else None
    half = 0.0 if fitted.std is None or not np.isfinite(fitted.std) else NORMAL_95 * fitted.std
    excluded = low is not None and fitted.value + half < low
    excluded |= high is not None and fitted.value - half > high
    return LinkSide(
        joint=joint,
        torque="measured" if measured else "computed",
        stiffness=1 / compliance if high is not None else None,
        low=low,
        high=high,
        hysteresis=abs(float(slopes[2])),
        lag=float(lag),
        agrees=not excluded,
    )
