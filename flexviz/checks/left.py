"""What the rigid model leaves of the torques, at the frequencies at which joints are rigid.

Least squares estimate what one thing more would explain of it: only what is promising is then fitted. With a
joint's remainder r (k,), what explains it D (k,), both without what is fitted already, and s swings, the gain
of δ·D is −½ Σ s ln(|r − δ D|² / |r|²) over the joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array
from flexviz.checks.reading import Reading
from flexviz.checks.rigid import Comparison
from flexviz.checks.thresholds import LIMITS


@dataclass(frozen=True, eq=False)
class Remainder:
    """Of one joint.

    Attributes:
        basis: (k, p) orthonormal, of what is fitted already.
        torque: (k,) what is left [Nm].
        power: of it, with the model's usual error [(Nm)²].
        swings: independent observations.
    """

    basis: Array
    torque: Array
    power: float
    swings: float

    def new(self, columns: Array) -> Array:
        """(k, m) columns without what is fitted already."""
        return columns - self.basis @ (self.basis.T @ columns)


def remainders(comparison: Comparison, reading: Reading) -> list[Remainder | None]:
    """Of all joints; None of one at rest."""
    return [
        None if columns.rests else _of(comparison.slow.T @ columns.matrix, comparison.swings[j][0])
        for j, columns in zip(reading.tau_order, comparison.columns(reading), strict=True)
    ]


def _of(low: Array, swings: float) -> Remainder:
    left, size, _ = np.linalg.svd(low[:, :-1], full_matrices=False)
    basis = left[:, size > 1e-9 * size[0]]
    torque = low[:, -1] - basis @ (basis.T @ low[:, -1])
    usual = LIMITS.model_error * float(low[:, -1] @ low[:, -1])
    return Remainder(basis, torque, float(torque @ torque) + usual, float(swings))


@dataclass(frozen=True)
class Estimated:
    """A number that would explain more: its size, standard deviation, and gain [nats]."""

    size: float
    std: float
    gain: float


def estimated(left: list[Remainder | None], columns: Array) -> Estimated:
    """The most probable δ of `columns` (k, n), δ times which all joints' torques have besides."""
    pairs = [(one, one.new(columns[:, i])) for i, one in enumerate(left) if one is not None]
    along = np.array([column @ one.torque / one.power for one, column in pairs])
    square = np.array([column @ column / one.power for one, column in pairs])
    swings = np.array([one.swings for one, _ in pairs])
    curvature = float(swings @ square)
    if curvature <= 0.0:
        return Estimated(0.0, np.inf, 0.0)
    size = float(swings @ along) / curvature
    rest = np.maximum(1.0 - 2.0 * size * along + size**2 * square, LIMITS.model_error)
    return Estimated(size, curvature**-0.5, -0.5 * float(swings @ np.log(rest)))
