"""A torque of unknown law that follows one variable of its joint, as it shows in the residual.

The law is piecewise linear between knots, one coefficient a knot. A torque u on the motor of a flexible joint
moves the residual by about u + κ ü, κ = M/K: slow parts of it show as they are, above the frequency 1/√κ they
show with the opposite sign, and larger. Which κ it is, the data say: a model that lacks something may have
any stiffness. Then both pass the low-pass of the residual, so that what is passed quickly is not smeared.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from flexviz.diagnosis.cross_validation import ExplainedShare, Folds, explained_by_prediction
from flexviz.diagnosis.records import DIRECTED
from flexviz.diagnosis.residuals import SLOW, SlowResidual

Array = NDArray[np.float64]

KNOTS = 24
SAMPLES_PER_KNOT = 40  # at least, on average
FINER = 3  # the law is evaluated this many times as often as the equation
TURNING = 0.005  # [rad/s] within which a direction passes into the other
# 1/(2π√κ) [Hz]; the first is a rigid joint
RESONANCES = (np.inf, 14.0, 9.0, 6.5, 5.0, 4.0, 3.2, 2.5, 2.0)
STIFFNESSES = tuple(1 / (2 * np.pi * f) ** 2 for f in RESONANCES)  # κ [s²]
SMOOTH, SMALL = 0.03, 0.5  # what the law is held by, in samples: neighbouring knots alike, no knot large


class CurveBasis(Protocol):
    """Functions of one variable, which may jump with the direction of motion."""

    @property
    def size(self) -> int:
        """How many."""
        ...

    def design(self, value: Array, velocity: Array) -> Array:
        """All of them at M instants, shape (M, size)."""
        ...


@dataclass(frozen=True)
class PiecewiseLinear:
    """Hat functions of one variable, once for each direction of motion where there are two.

    Attributes:
        knots: shape (B,).
        sides: 2 where the law may jump as the motion turns, else 1.
    """

    knots: Array
    sides: int

    @property
    def size(self) -> int:
        """Number of coefficients: those of the first direction at all knots, then those of the second."""
        return self.sides * len(self.knots)

    def design(self, value: Array, velocity: Array) -> Array:
        """All hat functions at M instants, shape (M, size)."""
        count = len(self.knots)
        place = np.interp(value, self.knots, np.arange(count, dtype=float))
        low = np.minimum(place.astype(int), count - 2)
        rows = np.arange(len(value))
        one = np.zeros((len(value), count))
        one[rows, low] = 1 - (place - low)
        one[rows, low + 1] = place - low
        return in_directions(one, velocity, self.sides)

    def penalty(self) -> Array:
        """Squared differences of neighbours, shape (size, size)."""
        step: Array = np.diff(np.eye(len(self.knots)), axis=0)
        return np.kron(np.eye(self.sides), step.T @ step).astype(np.float64)


def in_directions(one: Array, velocity: Array, sides: int) -> Array:
    """Columns (M, B) once for each direction of motion, shape (M, sides · B)."""
    if sides == 1:
        return one
    forward = 0.5 * (1 + np.tanh(velocity / TURNING))[:, None]
    out = np.empty((len(one), 2 * one.shape[1]))
    out[:, : one.shape[1]] = one * forward
    out[:, one.shape[1] :] = one * (1 - forward)
    return out


def piecewise_linear(values: Array, name: str) -> PiecewiseLinear:
    """Knots half way between equally spaced and equally filled, for values of shape (N,)."""
    sides = 2 if name in (DIRECTED, "velocity") else 1
    count = int(np.clip(len(values) // (SAMPLES_PER_KNOT * sides), 4, KNOTS))
    share = np.linspace(0, 1, count)
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    knots = 0.5 * (np.quantile(values, share) + low + share * (high - low)) if len(values) else share
    return PiecewiseLinear(knots + np.linspace(0, 1e-9 + 1e-6 * (high - low), count), sides)


def columns(data: SlowResidual, joint: int, values: Array, law: CurveBasis) -> tuple[Array, Array]:
    """The law's columns u and ü, low-passed like the residual; shape (N, size) each, zero where not shown.

    The variable's values have shape (N,).
    """
    velocity = data.theta[1, :, joint]
    out = np.zeros((2, len(values), law.size))
    for rows in data.stretches:
        count = rows.stop - rows.start
        if not data.shown[rows].any():
            continue
        fine = np.arange((count - 1) * FINER + 1) / FINER
        both = CubicSpline(np.arange(count), np.stack((values[rows], velocity[rows]), axis=1))(fine)
        design = law.design(both[:, 0], both[:, 1])
        u = SLOW.derivatives(design, float(data.step[rows.start]) / FINER, 3, stride=FINER)
        out[:, rows] = u[::2]
    out[:, ~data.shown] = 0.0
    return out[0], out[1]


def explained_by_law(data: SlowResidual, folds: Folds, joint: int, name: str) -> ExplainedShare:
    """Share of a joint's residual that a torque following one of its variables explains, out of sample."""
    residual = data.residual[:, joint]
    values = data.variable("position" if name == DIRECTED else name, joint)
    law = piecewise_linear(values[data.shown], name)
    u, curved = columns(data, joint, values, law)
    held = SMOOTH * folds.gap * law.penalty() + SMALL * np.eye(law.size)
    prediction = np.zeros(len(residual))
    for k, train in enumerate(folds.train):
        a, b, r = u[train], curved[train], residual[train]
        aa, ab, bb = a.T @ a, a.T @ b, b.T @ b
        ar, br = a.T @ r, b.T @ r
        best, found = -np.inf, None
        for kappa in STIFFNESSES:
            right = ar + kappa * br
            law_here = np.linalg.solve(aa + kappa * (ab + ab.T) + kappa**2 * bb + held, right)
            if (gain := float(right @ law_here)) > best:
                best, found = gain, (kappa, law_here)
        assert found is not None
        test = folds.fold == k
        prediction[test] = (u[test] + found[0] * curved[test]) @ found[1]
    return explained_by_prediction(prediction, residual, folds)
