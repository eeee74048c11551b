"""Free curve for a residual that no effect of the library explains: a stopgap, not a model.

The residual of one joint is fitted by a smooth torque u of one variable: cubic B-splines with a penalty on
the second differences of the coefficients (Eilers and Marx, Statist. Sci. 11, 1996), whose weight is chosen
by cross-validation over blocks of time. First, the part that the model's parameters can absorb is subtracted
from the response of the splines.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.cross_validation import Folds, explained_by_prediction, make_folds, remainder_spectrum
from flexviz.diagnosis.curves import KAPPAS, CurveResponse, Splines, curve_response, uniform_splines
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.records import DIRECTED, DIRECTION_GAIN, DIRECTIONS, UNITS, FreeCurve
from flexviz.diagnosis.residual_location import joint_maps
from flexviz.diagnosis.residuals import (
    Absorption,
    JointResiduals,
    SlowResidual,
    absorption,
    joint_residuals,
    samples,
)
from flexviz.diagnosis.result import ResidualLocation

Array = NDArray[np.float64]

PENALTY_WEIGHTS = tuple(np.logspace(-4, 4, 9))  # relative to the mean square of the splines
RIDGE = 1e-3  # likewise; fixes coefficients that neither data nor penalty determine
LEAST_SHARE_OF_FORM = 0.2  # of the residual: the form of a curve that explains less is not named
CURVE_POINTS = 81  # of a plotted curve


@dataclass(frozen=True)
class SmoothFit:
    """Penalty weight and κ [s²] chosen by cross-validation; out-of-fold prediction, shape (N,) [Nm]."""

    weight: float
    kappa: float
    prediction: Array


def fit_free_curve(
    context: FitContext, fit: Fit, place: ResidualLocation, parts: list[JointResiduals] | None = None
) -> FreeCurve:
    """Curve of a joint's residual against the variable of a location.

    A group or a frequency is replaced by the variable of the joint that explains most. Against position there
    is one curve per direction if this explains clearly more. `parts`: the residuals, if they are known.
    """
    parts = joint_residuals(context, fit) if parts is None else parts
    data = samples(context, fit, parts)
    joint = fit.layout.joints.index(place.joint)
    variable, sides = _variable(data, joint, place.variable)
    values = data.variable(variable, joint)
    splines = uniform_splines(values[data.shown], sides)
    residual = data.residual[:, joint]
    folds = make_folds(residual, data.shown, data.stretches)
    response = curve_response(data, joint, values, splines)
    if not fit.unbiased:
        model = absorption(context, fit, parts)
        for columns in (response.torque, response.curvature):
            _subtract_absorbed(columns, data, joint, model, len(parts[0].shown))
    size = float(np.sum(response.torque**2)) / splines.size
    penalty = splines.penalty(2)
    ridge = RIDGE * size * np.eye(splines.size)
    chosen = _cross_validated(response, penalty * size, ridge, residual, folds)
    shown = response.columns(chosen.kappa)
    found = explained_by_prediction(chosen.prediction, residual, folds)
    prior = chosen.weight * size * penalty + ridge
    hessian = shown.T @ shown + prior
    coefficients = np.asarray(np.linalg.solve(hessian, shown.T @ residual), float)
    cov = _covariance(shown, hessian, prior, residual - shown @ coefficients, folds)
    centres: Array = np.linspace(*splines.range, CURVE_POINTS)
    value, std = _drawn(data, joint, variable, values, centres, splines, coefficients, cov)
    curve = FreeCurve(
        joint=place.joint,
        variable=variable,
        unit=UNITS[variable],
        directions=DIRECTIONS if sides == 2 else ("",),
        centres=centres,
        value=value,
        std=std,
        explained=found.share,
        explained_std=found.std,
        smoothing=chosen.weight,
    )
    form = curve.simple_form() if found.share >= LEAST_SHARE_OF_FORM else None
    return replace(curve, form=form.text if form else "")


def _drawn(
    data: SlowResidual,
    joint: int,
    variable: str,
    values: Array,
    centres: Array,
    splines: Splines,
    coefficients: Array,
    cov: Array,
) -> tuple[Array, Array]:
    """Value and standard error at the centres, shape (S, M) each; NaN outside the range of the motion."""
    value, std = np.empty((2, splines.sides, len(centres)))
    for side in range(splines.sides):
        here = splines.design(centres, np.full(len(centres), 1.0 - 2.0 * side))
        value[side] = here @ coefficients
        std[side] = np.sqrt(np.maximum(np.einsum("mi,ij,mj->m", here, cov, here), 0.0))
        seen, never = data.shown, np.zeros(len(centres), bool)
        if splines.sides == 2 and variable == "velocity":
            never = centres < 0 if side == 0 else centres > 0
        elif splines.sides == 2:
            seen = seen & ((data.theta[1, :, joint] > 0) == (side == 0))
        low, high = (values[seen].min(), values[seen].max()) if seen.any() else (np.inf, -np.inf)
        never |= (centres < low) | (centres > high)
        value[side, never] = std[side, never] = np.nan
    return value, std


def _variable(data: SlowResidual, joint: int, wanted: str) -> tuple[str, int]:
    """Variable of the curve, and the number of curves."""
    if wanted == "velocity":
        return wanted, 2  # friction may jump at a reversal
    if wanted in ("acceleration", "load", "time"):
        return wanted, 1
    found = {m.variable: m for m in joint_maps(data, joint)}
    if wanted not in ("position", DIRECTED):
        best = max(found.values(), key=lambda m: -np.inf if m.variable == "group" else m.explained)
        if best.variable not in ("position", DIRECTED):
            return _variable(data, joint, best.variable)
    directed = found[DIRECTED].explained > found["position"].explained + DIRECTION_GAIN
    return "position", 2 if directed or wanted == DIRECTED else 1


def _subtract_absorbed(
    columns: Array, data: SlowResidual, joint: int, model: Absorption, fit_rows: int
) -> None:
    """Subtract from columns, in place, the part that the model's parameters can absorb."""
    own = np.concatenate([j[:, joint] for j in model.jacobians])
    right = model.weight[joint] ** 2 * own[:fit_rows].T @ columns[:fit_rows]
    scale = 1 / np.sqrt(np.maximum(np.diag(model.hessian), 1e-300))
    scaled = model.hessian * scale[:, None] * scale
    columns -= (own * scale) @ np.linalg.solve(scaled, right * scale[:, None])
    columns[~data.shown] = 0.0


def _cross_validated(
    response: CurveResponse, penalty: Array, ridge: Array, residual: Array, folds: Folds
) -> SmoothFit:
    """Penalty weight and κ of least out-of-sample error."""
    samples = max(int(folds.used.sum()), 1)
    tried = [(weight, kappa) for kappa in KAPPAS for weight in PENALTY_WEIGHTS]
    predictions = np.zeros((len(tried), len(residual)))
    for k, train in enumerate(folds.train):
        test = folds.fold == k
        normal = response.normal(residual, train)
        share = np.count_nonzero(train) / samples
        for m, (weight, kappa) in enumerate(tried):
            matrix = normal.matrix(kappa) + share * (weight * penalty + ridge)
            coefficients = np.linalg.solve(matrix, normal.right(kappa))
            predictions[m, test] = response.columns(kappa, test) @ coefficients
    error = np.sum((residual - predictions)[:, folds.used] ** 2, axis=1)
    best = int(np.argmin(error))
    return SmoothFit(*tried[best], predictions[best])


def _covariance(shown: Array, hessian: Array, prior: Array, rest: Array, folds: Folds) -> Array:
    """Covariance of the coefficients from the autocovariance of the remainder and from the penalty."""
    length, power = remainder_spectrum(rest, folds)
    score_covariance = np.zeros_like(hessian)
    for rows in folds.stretches:
        f = np.fft.rfft(shown[rows], length, axis=0) * np.sqrt(power)[:, None]
        score_covariance += f.real.T @ f.real + f.imag.T @ f.imag
    size = float(np.trace(score_covariance)) / max(float(np.sum(shown**2)), 1e-300)
    inverse = np.linalg.inv(hessian)
    return inverse @ (score_covariance + size * prior) @ inverse
