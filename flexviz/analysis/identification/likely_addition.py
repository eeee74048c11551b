"""How a fit moves when it is given the effects that it seems to lack."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from flexviz.analysis.estimation import ScoredCandidate, gauss_newton, start_values
from flexviz.analysis.identification.plain_fit import PlainFit
from flexviz.analysis.motion import MotionFit
from flexviz.base.arrays import Array
from flexviz.data.measurements import MeasurementSet
from flexviz.model.equation import Equation, Layout

STEPS = 10  # of the solver


def likely_move(measurements: MeasurementSet, plain: PlainFit) -> Array:
    """Change of the parameters, shape (P,), when each joint above the noise gets the most telling effect.

    A missing effect may move a stiffness several times as far as its derivative says, so the larger model is
    fitted. Zero where noise explains the residual, or if the larger model describes the data no better.

    Raises:
        Stopped: by the user.
    """
    layout, solution = plain.equation.layout, plain.solution
    none = np.zeros(layout.size)
    loud = set(np.flatnonzero(plain.excess).tolist())
    telling = [one for one in (plain.fitted.most_telling() if loud else ()) if one.effect.joint in loud]
    if not telling:
        return none
    larger, x = _with_telling(layout, solution.x, telling)
    equation = Equation(measurements.robot, plain.equation.signals, larger)
    start = start_values(measurements, equation)
    x = start.bounds.clip(x)
    end = gauss_newton(equation, start.prior, start.bounds, x, watch=plain.watch, max_iterations=STEPS)
    if end.evaluation.residual.var(axis=0).prod() >= solution.evaluation.residual.var(axis=0).prod():
        return none
    return layout.vector(larger.model(end.x)) - solution.x


def likely_move_in_motion(fit: MotionFit, check: Callable[[], None]) -> Array:
    """The same of a fit in the band of the motion, in which each joint is weighted by what the model leaves.

    `check` may raise to stop.
    """
    layout, loud = fit.layout, set(np.flatnonzero(fit.excess).tolist())
    telling = [one for one in fit.fitted_model(fit.held).most_telling() if one.effect.joint in loud]
    if not telling:
        return np.zeros(layout.size)
    larger, x = _with_telling(layout, fit.x, telling)
    end = fit.context.fit(larger, x, iterations=STEPS, check=check)
    return layout.vector(larger.model(end.x)) - fit.x if end.objective < fit.objective else 0.0 * fit.x


def _with_telling(layout: Layout, x: Array, telling: Sequence[ScoredCandidate]) -> tuple[Layout, Array]:
    """A model with further effects at their scored values, and its parameters, from x, shape (P,)."""
    larger = layout.with_effects((*layout.effects, *(one.effect for one in telling)))
    start = larger.vector(layout.model(x))
    for one in telling:
        start[larger.effect_slice(one.effect)] = one.values
    return larger, start
