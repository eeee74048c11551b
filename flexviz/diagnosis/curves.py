"""Free curves: a torque as a spline of one joint variable, and its response in the residual.

A torque u on the motor of a flexible joint changes the residual by about u + κ ü with κ = M/K: slow
components keep their sign, those above the frequency 1/√κ are inverted and amplified. κ is chosen by the
data, because the stiffness of an incomplete model may be far off. The response is low-passed like the
residual.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.cross_validation import ExplainedShare, Folds, explained_by_prediction
from flexviz.diagnosis.records import DIRECTED
from flexviz.diagnosis.residuals import SLOW, SlowResidual
from flexviz.interpolation import CubicInterpolation

Array = NDArray[np.float64]

MAX_PIECES = 24  # of a curve
MIN_SAMPLES_PER_PIECE = 40  # on average
TEST_PIECES = 14  # of a curve that effects are compared with
OVERSAMPLING = 3  # of the curve relative to the equation's samples
REVERSAL_VELOCITY = 0.005  # [rad/s] width of the transition between directions
RESONANCES = (np.inf, 14.0, 9.0, 6.5, 5.0, 4.0, 3.2, 2.5, 2.0)  # 1/(2π√κ) [Hz]; the first is a rigid joint
KAPPAS = tuple(1 / (2 * np.pi * f) ** 2 for f in RESONANCES)  # κ [s²]
SMOOTHNESS, RIDGE = 0.03, 0.5  # penalties [samples] on differences of neighbouring hats and on their values


@dataclass(frozen=True)
class Splines:
    """B-splines of one variable, once per direction of motion.

    Attributes:
        knots: shape (B + degree + 1,), for B splines.
        degree: 1 for hat functions, 3 for cubic splines.
        sides: 2 if the curve may jump at a reversal of motion, else 1.
    """

    knots: Array
    degree: int
    sides: int = 1

    @property
    def size(self) -> int:
        """Number of coefficients, ordered by direction."""
        return self.sides * (len(self.knots) - self.degree - 1)

    @property
    def range(self) -> tuple[float, float]:
        """Range of the variable; the curve is constant beyond."""
        return float(self.knots[self.degree]), float(self.knots[-self.degree - 1])

    def design(self, value: Array, velocity: Array) -> Array:
        """Design matrix at M instants, shape (M, size)."""
        low, high = self.range
        inside = np.clip(value, low, np.nextafter(high, low))  # knots may coincide at the end
        one = _design(inside, self.knots, self.degree)
        if self.sides == 1:
            return one
        forward = 0.5 * (1 + np.tanh(velocity / REVERSAL_VELOCITY))[:, None]
        return np.hstack((one * forward, one * (1 - forward)))

    def penalty(self, order: int) -> Array:
        """Squared differences of neighbouring coefficients, shape (size, size)."""
        difference: Array = np.diff(np.eye(self.size // self.sides), order, axis=0)
        return np.kron(np.eye(self.sides), difference.T @ difference).astype(np.float64)


def _design(value: Array, knots: Array, degree: int) -> Array:
    """B-splines at values within their range, shape (M, B) (Piegl, Tiller: The NURBS Book, algorithm A2.2).

    SciPy's takes half a second to load.
    """
    count = len(knots) - degree - 1
    at = np.clip(np.searchsorted(knots, value, side="right") - 1, degree, count - 1)
    own = np.zeros((len(value), degree + 1))  # those that are not zero, the last begins at knot `at`
    own[:, 0] = 1.0
    for order in range(1, degree + 1):
        carried = np.zeros(len(value))
        for i in range(order):
            before, after = knots[at + 1 - order + i], knots[at + 1 + i]
            part = own[:, i] / (after - before)
            own[:, i] = carried + (after - value) * part
            carried = (value - before) * part
        own[:, order] = carried
    out = np.zeros((len(value), count))
    np.put_along_axis(out, at[:, None] + np.arange(-degree, 1), own, axis=1)
    return out


def piece_count(samples: int, sides: int) -> int:
    """Number of pieces that the samples can determine."""
    return int(np.clip(samples // (MIN_SAMPLES_PER_PIECE * sides), 4, MAX_PIECES))


def hat_functions(values: Array, name: str) -> Splines:
    """Piecewise linear; knots midway between equally spaced and equally filled; values of shape (N,)."""
    sides = 2 if name in (DIRECTED, "velocity") else 1
    share = np.linspace(0, 1, piece_count(len(values), sides))
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    knots = 0.5 * (np.quantile(values, share) + low + share * (high - low)) if len(values) else share
    knots = knots + np.linspace(0, 1e-9 + 1e-6 * (high - low), len(share))
    return Splines(np.r_[knots[:1], knots, knots[-1:]], 1, sides)


def uniform_splines(values: Array, sides: int) -> Splines:
    """Cubic, equally spaced over the range of the values, shape (N,)."""
    pieces = piece_count(len(values), sides)
    low, high = float(values.min()), float(values.max())
    knots: Array = low + max(high - low, 1e-9) / pieces * np.arange(-3.0, pieces + 4.0)
    return Splines(knots, 3, sides)


def equally_filled_splines(values: Sequence[Array]) -> Splines:
    """Cubic, with the same number of samples in each piece; `values` per stretch."""
    together = np.concatenate(values)
    low, high = np.quantile(together, [0.001, 0.999])
    inner = np.quantile(together, np.linspace(0, 1, TEST_PIECES - 2)[1:-1])
    width = max(float(high - low), 1e-12)
    knots = np.concatenate(([low] * 4, np.clip(inner, low, high), [low + width] * 4))
    return Splines(np.maximum.accumulate(knots), 3)


@dataclass(frozen=True)
class CurveEquations:
    """Normal equations of a curve's coefficients for any κ."""

    torque: Array
    mixed: Array
    curvature: Array
    torque_right: Array
    curvature_right: Array

    def matrix(self, kappa: float) -> Array:
        """Shape (size, size)."""
        return self.torque + kappa * (self.mixed + self.mixed.T) + kappa**2 * self.curvature

    def right(self, kappa: float) -> Array:
        """Shape (size,)."""
        return self.torque_right + kappa * self.curvature_right


@dataclass(frozen=True)
class CurveResponse:
    """Response of the slow residual to every spline: torque u and curvature ü, shape (N, size) each.

    Both are zero where the residual is not shown.
    """

    torque: Array
    curvature: Array

    def normal(self, residual: Array, train: NDArray[np.bool_]) -> CurveEquations:
        """Normal equations from the samples `train`, shape (N,)."""
        a, b, r = self.torque[train], self.curvature[train], residual[train]
        return CurveEquations(a.T @ a, a.T @ b, b.T @ b, a.T @ r, b.T @ r)

    def columns(self, kappa: float, rows: NDArray[np.bool_] | slice = slice(None)) -> Array:
        """Response u + κ ü at some samples, shape (N', size)."""
        return self.torque[rows] + kappa * self.curvature[rows]


def curve_response(data: SlowResidual, joint: int, values: Array, splines: Splines) -> CurveResponse:
    """Response to a torque on a joint that depends on `values`, shape (N,)."""
    velocity = data.theta[1, :, joint]
    out = np.zeros((2, len(values), splines.size))
    for rows in data.stretches:
        count = rows.stop - rows.start
        if not data.shown[rows].any():
            continue
        fine = np.arange((count - 1) * OVERSAMPLING + 1) / OVERSAMPLING
        between = CubicInterpolation(np.arange(float(count)), fine)
        design = splines.design(between.read(values[rows])[0], between.read(velocity[rows])[0])
        step = float(data.step[rows.start]) / OVERSAMPLING
        out[:, rows] = SLOW.derivatives(design, step, 3, stride=OVERSAMPLING, every=2)
    out[:, ~data.shown] = 0.0
    return CurveResponse(*out)


def explained_by_curve(data: SlowResidual, folds: Folds, joint: int, name: str) -> ExplainedShare:
    """Out-of-sample share of a joint's residual explained by a free curve of one of its variables."""
    residual = data.residual[:, joint]
    values = data.variable("position" if name == DIRECTED else name, joint)
    splines = hat_functions(values[data.shown], name)
    response = curve_response(data, joint, values, splines)
    penalty = SMOOTHNESS * folds.gap * splines.penalty(1) + RIDGE * np.eye(splines.size)
    prediction = np.zeros(len(residual))
    for k, train in enumerate(folds.train):
        normal = response.normal(residual, train)
        fits = []
        for kappa in KAPPAS:
            right = normal.right(kappa)
            coefficients = np.linalg.solve(normal.matrix(kappa) + penalty, right)
            fits.append((float(right @ coefficients), kappa, coefficients))
        _, kappa, coefficients = max(fits, key=lambda fit: fit[0])
        test = folds.fold == k
        prediction[test] = response.columns(kappa, test) @ coefficients
    return explained_by_prediction(prediction, residual, folds)
