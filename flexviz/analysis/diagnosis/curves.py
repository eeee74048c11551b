"""Free curves of a residual: what follows one variable of a joint, in cross-validation, and the curve itself.

The curve is a smooth torque u on the motor, with the nodes and the prior of the effect `FreeCurveEffect`, as
large as the residual. It changes the residual of a flexible joint by about u + κ ü with κ = M/K: slow
components keep their sign, those above the frequency 1/√κ are inverted and amplified. κ is chosen by the
data, because the stiffness of an incomplete model may be far off. The response is low-passed like the
residual.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.cross_validation import (
    ExplainedShare,
    Folds,
    explained_by_prediction,
    make_folds,
)
from flexviz.analysis.diagnosis.fit_context import Fit, FitContext
from flexviz.analysis.diagnosis.residuals import (
    DIRECTED,
    DIRECTION_GAIN,
    SLOW,
    UNITS,
    Absorption,
    JointResiduals,
    SlowResidual,
    absorption,
    joint_residuals,
    samples,
)
from flexviz.analysis.estimation import WIDE_HERTZ, spectral_covariance
from flexviz.content.records import FreeCurve, ResidualLocation
from flexviz.model.effects import FreeCurveEffect, free_curve
from flexviz.model.effects.free_curve import CONSTANTS, DIRECTIONS, NODES, SIZE

Array = NDArray[np.float64]

BASES = {DIRECTED: "free_curve_direction", "velocity": "free_curve_velocity"}  # else a curve of one branch
CURVED = ("position", DIRECTED, "velocity", "acceleration", "load", "time")


@dataclass(frozen=True)
class CurveFit:
    """A curve fitted to one joint's residual.

    Attributes:
        ends: lower and upper end of the splines' range.
        columns: shape (N, C), response to the torque at each node.
        coefficients: shape (C,), torque at the nodes [Nm].
        precision: shape (C, C), of their prior [1/Nm²].
        noise: variance of an independent sample of what the curve leaves [Nm²].
        found: share explained out of sample.
    """

    curve: FreeCurveEffect
    ends: Array
    columns: Array
    coefficients: Array
    precision: Array
    noise: float
    found: ExplainedShare


def fit_curve(
    data: SlowResidual, folds: Folds, joint: int, variable: str, model: Absorption | None = None
) -> CurveFit:
    """Curve of a joint's residual against one of its variables; `model` absorbs a part of the curve."""
    curve = free_curve(BASES.get(variable, "free_curve_position"))
    assert curve is not None
    residual, values = data.residual[:, joint], data.variable(variable, joint)
    seen = values[data.shown] if data.shown.any() else np.zeros(1)
    low, high = (0.0, np.abs(seen).max()) if variable == "velocity" else (seen.min(), seen.max())
    ends = np.array([low, high], float)
    both = np.zeros((2, len(residual), NODES * curve.sides))  # of u and of ü
    for rows in data.stretches:
        if data.shown[rows].any():
            design = curve.design(values[rows], data.theta[1, rows, joint], ends)
            both[:, rows] = SLOW.derivatives(design, float(data.step[rows.start]), 3)[::2]
    both = both if model is None else np.stack([model.left(columns, joint) for columns in both])
    both *= data.shown[:, None]
    parts = [(both[:, train], residual[train]) for train in folds.train]
    normal = [(np.tensordot(own, own, (1, 1)), np.tensordot(own, rest, (1, 0))) for own, rest in parts]
    size, largest = float(np.mean(residual**2)) or 1.0, float(np.abs(residual).max()) or 1.0
    precision = curve.precision(largest / SIZE)[CONSTANTS:, CONSTANTS:]

    def predicted(way: Array, noise: float) -> Array:
        prediction = np.zeros(len(residual))
        for k, (gram, right) in enumerate(normal):
            own = np.einsum("a,aibj,b->ij", way, gram, way) + folds.gap * noise * precision
            test = folds.fold == k
            prediction[test] = np.tensordot(way, both[:, test], 1) @ np.linalg.solve(own, way @ right)
        return prediction

    def left(prediction: Array) -> float:
        return float(np.mean((residual - prediction) ** 2) + 1e-9 * size)

    ways = [np.array([1.0, (k / (2 * np.pi * WIDE_HERTZ)) ** 2]) for k in range(NODES)]
    # the prior counts relative to what the curve before leaves out of sample
    noise = left(predicted(ways[0], size))
    way = min(ways, key=lambda way: left(predicted(way, noise)))
    for _ in range(2):
        noise = left(prediction := predicted(way, noise))
    columns = np.tensordot(way, both, 1)
    hessian = columns.T @ columns + folds.gap * noise * precision
    coefficients = np.asarray(np.linalg.solve(hessian, columns.T @ residual), float)
    found = explained_by_prediction(prediction, residual, folds)
    return CurveFit(curve, ends, columns, coefficients, precision, folds.gap * noise, found)


def fit_free_curve(
    context: FitContext, fit: Fit, place: ResidualLocation, parts: list[JointResiduals] | None = None
) -> FreeCurve:
    """Curve of a joint's residual against the variable of a location.

    A group or a frequency is replaced by the variable of the joint that explains most. Against position there
    is one curve per direction if this explains clearly more. `parts`: the residuals, if they are known.
    """
    parts = joint_residuals(context, fit) if parts is None else parts
    data, joint = samples(context, fit, parts), fit.layout.joints.index(place.joint)
    residual = data.residual[:, joint]
    folds = make_folds(data.shown, data.stretches, data.cycle)
    model = None if fit.unbiased else absorption(context, fit, parts)
    wanted = [v for v in CURVED if v.split()[0] == place.variable] or CURVED
    tried = {v: fit_curve(data, folds, joint, v, model) for v in wanted}
    variable = max(tried, key=lambda v: tried[v].found.share - DIRECTION_GAIN * (v == DIRECTED))
    best, values = tried[variable], data.variable(variable, joint)
    rest = (residual - best.columns @ best.coefficients) / np.sqrt(best.noise)
    columns = best.columns / np.sqrt(best.noise)
    covariance = spectral_covariance(rest[:, None], columns[:, None], folds.stretches, best.precision).matrix
    low, high = best.ends
    centres: Array = np.linspace(-high if variable == "velocity" else low, high, best.columns.shape[1])
    value, std = np.full((2, best.curve.sides, len(centres)), np.nan)
    for side, direction in enumerate((1.0, -1.0)[: best.curve.sides]):
        seen = data.shown & ((direction * data.theta[1, :, joint] > 0) | (best.curve.sides == 1))
        if seen.any():
            at = (centres >= values[seen].min()) & (centres <= values[seen].max())
            design = best.curve.design(centres[at], np.full(int(at.sum()), direction), best.ends)
            value[side, at] = design @ best.coefficients
            std[side, at] = np.sqrt(np.einsum("mi,ij,mj->m", design, covariance, design))
    curve = FreeCurve(
        place.joint, variable.split()[0], UNITS[variable], DIRECTIONS if best.curve.sides == 2 else ("",),
        centres, value, std, best.found.share, best.found.std, best.noise,
    )  # fmt: skip
    form = curve.simple_form() if curve.certain else None
    return replace(curve, form=form.fact if form else "")
