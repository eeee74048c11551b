"""Start values of effects that are nonlinear in their parameters.

At a fit without them, small versions of each effect are scored over a grid (orders of a ripple, widths of a
Stribeck peak), and the best one gives the start values. Started at zero, most would end in a local minimum.
The interval of an episode is found in closed form.
"""

from __future__ import annotations

import numpy as np

from flexviz.analysis.estimation import Projection, best_intervals, gauss_newton, score, start_values
from flexviz.base.arrays import Array
from flexviz.data.measurements import MeasurementSet
from flexviz.model.effects import EFFECTS
from flexviz.model.equation import Chain, Equation, Layout


def needs_search(layout: Layout) -> bool:
    """Whether the layout has effects that are nonlinear in their parameters."""
    return any(not EFFECTS[e.effect].linear for e in layout.effects)


def searched_start(measurements: MeasurementSet, equation: Equation) -> Array:
    """Start values of all parameters, shape (P,): a fit without nonlinear effects, then the best guesses."""
    layout = equation.layout
    simple = layout.with_effects(e for e in layout.effects if EFFECTS[e.effect].linear)
    inner = Equation(measurements.robot, equation.signals, simple)
    start = start_values(measurements, inner)
    solution = gauss_newton(
        inner, start.prior, start.bounds, start.x, after=start.point, reweightings=2, max_iterations=25
    )
    x, evaluation = solution.x, solution.evaluation
    # a new equation, whose wide-band signals suit x rather than the start
    point = Equation(measurements.robot, equation.signals, simple).at(x)
    weights, (residual, jacobian) = solution.weights[:, :, None], solution.whitened
    instruments = jacobian.reshape(-1, simple.size)
    hessian = instruments.T @ instruments + start.prior.gradient_and_hessian(x)[1]

    def weigh(columns: Array, block: int) -> Array:
        return (columns * weights[point.signals.blocks[block].rows]).reshape(-1, columns.shape[2])

    wanted = [e for e in layout.effects if not EFFECTS[e.effect].linear]
    projection = Projection(residual.ravel(), instruments, hessian)
    chain = Chain(x[simple.compliance], x[simple.link_viscous], evaluation.link)
    found = {s.effect: s.values for s in score(point, chain, wanted, weigh, projection)}
    for effect in wanted:
        if effect.joint is not None and effect.group is not None:
            best = best_intervals(point, effect.joint, weigh, projection, group=effect.group)
            if best:
                found[effect] = best[0].values
    out = layout.vector(simple.model(x))
    for effect, where in layout.effect_slices():
        if effect in found:
            specs = EFFECTS[effect.effect].parameters
            out[where] = np.clip(found[effect], [p.lower for p in specs], [p.upper for p in specs])
    return out
