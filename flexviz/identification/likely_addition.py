"""How a fit moves when it is given the effects that it seems to lack."""

from __future__ import annotations

import numpy as np

from flexviz.arrays import Array
from flexviz.equation import Equation
from flexviz.estimation import gauss_newton, start_values
from flexviz.identification.plain_fit import PlainFit
from flexviz.measurements import MeasurementSet

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
    larger = layout.with_effects((*layout.effects, *(one.effect for one in telling)))
    x = larger.vector(layout.model(solution.x))
    for one in telling:
        x[larger.effect_slice(one.effect)] = one.values
    equation = Equation(measurements.robot, plain.equation.signals, larger)
    start = start_values(measurements, equation)
    x = start.bounds.clip(x)
    end = gauss_newton(equation, start.prior, start.bounds, x, watch=plain.watch, max_iterations=STEPS)
    if end.evaluation.residual.var(axis=0).prod() >= solution.evaluation.residual.var(axis=0).prod():
        return none
    return layout.vector(larger.model(end.x)) - solution.x
