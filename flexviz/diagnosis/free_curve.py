"""A free-form curve for what no effect of the library explains: a stopgap, not a model.

The residual of one joint as a smooth torque u of one variable: cubic B-splines with a penalty on the
coefficients' second differences (Eilers and Marx, Statist. Sci. 11, 1996), the penalty's weight chosen by
cross-validation over blocks of time. The splines pass the flexible joint and the residual's low-pass
(`curves`), and what the model's own parameters would take off them is taken off first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from flexviz._scipy import fft
from flexviz.diagnosis.cross_validation import Folds, explained_by_prediction, make_folds, remainder_spectrum
from flexviz.diagnosis.curves import STIFFNESSES, columns, in_directions
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.records import CLEARLY, DIRECTED, DIRECTIONS, UNITS, FreeCurve
from flexviz.diagnosis.residual_location import joint_maps
from flexviz.diagnosis.residuals import Absorption, SlowResidual, absorption, joint_residuals, samples
from flexviz.diagnosis.result import ResidualLocation

Array = NDArray[np.float64]

PIECES = 24
SAMPLES_PER_PIECE = 40  # at least, on average
WEIGHTS = tuple(np.logspace(-4, 4, 9))  # of the penalty, relative to the splines' own size
RIDGE = 1e-3  # relative too: holds what neither data nor the penalty determine
POINTS = 81


@dataclass(frozen=True)
class _Splines:
    """Cubic B-splines over the range of a variable, once for each direction of motion."""

    knots: Array
    sides: int

    @property
    def size(self) -> int:
        return self.sides * (len(self.knots) - 4)

    def design(self, value: Array, velocity: Array) -> Array:
        """All splines at M instants, shape (M, size)."""
        inside = np.clip(value, self.knots[3], self.knots[-4])
        one = np.array(BSpline.design_matrix(inside, self.knots, 3).toarray(), dtype=float)
        return in_directions(one, velocity, self.sides)

    def penalty(self) -> Array:
        """Squared second differences of the coefficients, shape (size, size)."""
        bend: Array = np.diff(np.eye(len(self.knots) - 4), 2, axis=0)
        return np.kron(np.eye(self.sides), bend.T @ bend).astype(np.float64)


def fit_free_curve(context: FitContext, fit: Fit, place: ResidualLocation) -> FreeCurve:
    """The curve of a joint's residual against the variable of a place.

    Where the place is a group or a frequency, against which no torque can be drawn, the joint's best other
    variable is taken; for position, one curve a direction where that explains clearly more.
    """
    parts = joint_residuals(context, fit)
    data = samples(context, fit, parts)
    joint = fit.layout.joints.index(place.joint)
    variable, sides = _variable(data, joint, place.variable)
    taken = absorption(context, fit, parts)
    values = data.variable(variable, joint)
    splines = _splines(values[data.shown], sides)
    residual = data.residual[:, joint]
    folds = make_folds(residual, data.shown, data.stretches)
    shapes = columns(data, joint, values, splines)
    for each in shapes:
        _take_off(each, data, joint, taken, len(parts[0].shown))
    size = float(np.sum(shapes[0] ** 2)) / splines.size
    penalty = splines.penalty()
    ridge = RIDGE * size * np.eye(splines.size)
    weight, kappa, prediction = _chosen(*shapes, penalty * size, ridge, residual, folds)
    shown = shapes[0] + kappa * shapes[1]
    found = explained_by_prediction(prediction, residual, folds)
    matrix = weight * size * penalty + ridge
    hessian = shown.T @ shown + matrix
    coefficients = np.linalg.solve(hessian, shown.T @ residual)
    cov = _covariance(shown, hessian, matrix, residual - shown @ coefficients, folds)
    centres: Array = np.linspace(splines.knots[3], splines.knots[-4], POINTS)
    value, std = np.empty((sides, POINTS)), np.empty((sides, POINTS))
    for side in range(sides):
        here = splines.design(centres, np.full(POINTS, 1.0 - 2.0 * side))
        value[side] = here @ coefficients
        std[side] = np.sqrt(np.maximum(np.einsum("mi,ij,mj->m", here, cov, here), 0.0))
        seen = data.shown
        if sides == 2:
            seen = seen & ((data.theta[1, :, joint] > 0) == (side == 0))
        if variable == "velocity" and sides == 2:
            seen = data.shown
            wrong = centres < 0 if side == 0 else centres > 0
            value[side, wrong] = std[side, wrong] = np.nan
        low, high = (values[seen].min(), values[seen].max()) if seen.any() else (np.inf, -np.inf)
        never = (centres < low) | (centres > high)
        value[side, never] = std[side, never] = np.nan
    return FreeCurve(
        joint=place.joint,
        variable=variable,
        unit=UNITS[variable],
        directions=DIRECTIONS if sides == 2 else ("",),
        centres=centres,
        value=value,
        std=std,
        explained=found.share,
        explained_std=found.std,
        smoothing=weight,
    )


def _variable(data: SlowResidual, joint: int, wanted: str) -> tuple[str, int]:
    """The variable to draw against, and how many curves."""
    if wanted in ("velocity",):
        return wanted, 2  # what depends on speed may jump where it turns
    if wanted in ("acceleration", "load", "time"):
        return wanted, 1
    found = {m.variable: m for m in joint_maps(data, joint)}
    if wanted not in ("position", DIRECTED):
        best = max(found.values(), key=lambda m: -np.inf if m.variable == "group" else m.explained)
        if best.variable not in ("position", DIRECTED):
            return _variable(data, joint, best.variable)
    directed = found[DIRECTED].explained > found["position"].explained + CLEARLY
    return "position", 2 if directed or wanted == DIRECTED else 1


def _splines(values: Array, sides: int) -> _Splines:
    pieces = int(np.clip(len(values) // (SAMPLES_PER_PIECE * sides), 4, PIECES))
    low, high = float(values.min()), float(values.max())
    width = max(high - low, 1e-9) / pieces
    knots: Array = low + width * np.arange(-3.0, pieces + 4.0)
    return _Splines(knots, sides)


def _take_off(out: Array, data: SlowResidual, joint: int, taken: Absorption, fitted: int) -> None:
    """Take off columns, in place, what the model's parameters would take off them."""
    own = np.concatenate([j[:, joint] for j in taken.jacobians])
    weight = taken.weight[joint] ** 2
    right = weight * own[:fitted].T @ out[:fitted]
    scale = 1 / np.sqrt(np.maximum(np.diag(taken.hessian), 1e-300))
    scaled = taken.hessian * scale[:, None] * scale
    out -= (own * scale) @ np.linalg.solve(scaled, right * scale[:, None])
    out[~data.shown] = 0.0


def _chosen(
    u: Array, curved: Array, penalty: Array, ridge: Array, residual: Array, folds: Folds
) -> tuple[float, float, Array]:
    """The penalty's weight and the κ with the least error out of sample, and the prediction, shape (N,)."""
    whole = max(int(folds.used.sum()), 1)
    tried = [(weight, kappa) for kappa in STIFFNESSES for weight in WEIGHTS]
    predictions = np.zeros((len(tried), len(residual)))
    for k, train in enumerate(folds.train):
        test = folds.fold == k
        a, b, r = u[train], curved[train], residual[train]
        aa, ab, bb = a.T @ a, a.T @ b, b.T @ b
        ar, br = a.T @ r, b.T @ r
        share = len(a) / whole
        for m, (weight, kappa) in enumerate(tried):
            matrix = aa + kappa * (ab + ab.T) + kappa**2 * bb + share * (weight * penalty + ridge)
            coefficients = np.linalg.solve(matrix, ar + kappa * br)
            predictions[m, test] = (u[test] + kappa * curved[test]) @ coefficients
    error = np.sum((residual - predictions)[:, folds.used] ** 2, axis=1)
    best = int(np.argmin(error))
    return *tried[best], predictions[best]


def _covariance(shown: Array, hessian: Array, prior: Array, rest: Array, folds: Folds) -> Array:
    """Of the coefficients: from the remainder's own autocovariance, and from what the penalty assumes."""
    length, power = remainder_spectrum(rest, folds)
    colour = np.zeros_like(hessian)
    for rows in folds.stretches:
        f = fft.rfft(shown[rows], length, axis=0) * np.sqrt(power)[:, None]
        colour += f.real.T @ f.real + f.imag.T @ f.imag
    size = float(np.trace(colour)) / max(float(np.sum(shown**2)), 1e-300)
    inverse = np.linalg.inv(hessian)
    return inverse @ (colour + size * prior) @ inverse
