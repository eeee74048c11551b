"""Drops in closed form: which effects of a fitted model do the data need?

A fit gives its parameters as a normal distribution of precision H. Leaving an effect out fixes its
parameters, which moves all others linearly and changes the residual by the Jacobian times that move. One
Jacobian and H therefore judge every smaller model by the criterion, without a fit.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.criterion import Criterion, Gain, Residuals, Score, gain
from flexviz.analysis.estimation import Bounds, scaled_inverse, torque_scale
from flexviz.model.effects import EFFECTS, ChosenEffect
from flexviz.model.equation import Layout

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Linearised:
    """A fitted model and its residuals as linear functions of its parameters.

    Attributes:
        layout, x: the model and its parameters, shape (P,).
        parts: residuals of the fit groups, and of the validation groups if there are any.
        jacobians: of each part, shape (N, n, P).
        hessian: shape (P, P), of the objective.
        prior: gradient (P,) and Hessian (P, P) of the prior.
        held: shape (P,), parameters that do not move.
        bounds: of the parameters.
    """

    layout: Layout
    x: Array
    parts: Sequence[Residuals]
    jacobians: Sequence[Array]
    hessian: Array
    prior: tuple[Array, Array]
    held: Bools
    bounds: Bounds


class Costs(Protocol):
    """What judges models and prices effects."""

    @property
    def criterion(self) -> Criterion: ...

    def saved(self, layout: Layout, effect: ChosenEffect) -> float: ...


def needs(
    data: Linearised, score: Score, costs: Costs, among: Collection[ChosenEffect] | None = None
) -> dict[ChosenEffect, tuple[Gain, Array]]:
    """What each effect of a model, or each of `among`, gains given the others.

    With the parameters (P,) of the model without it.
    """
    covariance = _inverse(data.hessian, data.held)
    out = {}
    for effect, where in data.layout.effect_slices():
        if among is not None and effect not in among:
            continue
        move = _joint_move(data, [where], [effect], covariance)
        saved = costs.saved(data.layout, effect)
        out[effect] = gain(_moved(data, move, score.cost - saved, costs), score), data.x + move
    return out


def eliminated(
    data: Linearised, score: Score, costs: Costs, among: Collection[ChosenEffect]
) -> tuple[list[ChosenEffect], Array]:
    """Those of some effects that a model does not need, dropped one by one.

    With the parameters (P,) of the model without them.
    """
    slices, gone = dict(data.layout.effect_slices()), list[ChosenEffect]()
    covariance, x, now, layout = _inverse(data.hessian, data.held), data.x, score, data.layout
    while left := [e for e in among if e not in gone]:
        trials = []
        for effect in left:
            some = [*gone, effect]
            move = _joint_move(data, [slices[e] for e in some], some, covariance)
            cost = now.cost - costs.saved(layout, effect)
            trials.append((_moved(data, move, cost, costs), effect, data.x + move))
        best, effect, there = min(trials, key=lambda trial: trial[0].total)
        if best.total > now.total:
            break
        gone, now, x = [*gone, effect], best, there
        layout = layout.with_effects(e for e in layout.effects if e != effect)
    return gone, x


def _moved(data: Linearised, move: Array, cost: float, costs: Costs) -> Score:
    """The score of a model with parameters moved, shape (P,), and another cost."""
    parts = [
        replace(part, values=part.values + jacobian @ move)
        for part, jacobian in zip(data.parts, data.jacobians, strict=True)
    ]
    return costs.criterion.score(parts, cost, torque_scale(data.layout, data.x + move))


def _joint_move(
    data: Linearised, places: Sequence[slice], effects: Sequence[ChosenEffect], covariance: Array
) -> Array:
    """How the parameters move when several effects are left out together, shape (P,)."""
    if not places:
        return np.zeros(len(data.x))
    rows = np.concatenate([np.arange(where.start, where.stop, dtype=np.intp) for where in places])
    target = np.zeros(len(data.x))
    # without an effect in proportion to the motor's viscous friction, that friction cannot stand in for it
    viscous = range(data.layout.size)[data.layout.motor_viscous]
    proportional = {e.joint for e in effects if EFFECTS[e.effect].relative}
    beside = [row for joint, row in enumerate(viscous) if joint in proportional]
    rows = np.concatenate((rows, np.array(beside, np.intp)))
    for effect, where in zip(effects, places, strict=True):
        sizes = [where.start + k for k in EFFECTS[effect.effect].size_at]
        target[sizes] = -data.x[sizes]
    return _within(data, rows, target[rows], covariance)


def by_weight(
    data: Linearised, effects: Collection[ChosenEffect], spread: Array
) -> list[tuple[ChosenEffect, Array]]:
    """The effects, the weightiest first, each with the parameters (P,) of the model without it and the next.

    Each is the one that lowers the mean square of the held-out residual (fitted, if none is held out) most,
    relative to each joint's torque `spread`, shape (n,), given those before it.
    """
    where = {effect: at for effect, at in data.layout.effect_slices() if effect in effects}
    residual, used = data.parts[-1].values, data.parts[-1].used
    order: list[tuple[ChosenEffect, Array]] = []

    def without(absent: Mapping[ChosenEffect, slice]) -> Array:
        covariance = _inverse(data.hessian, data.held)
        return _joint_move(data, list(absent.values()), list(absent), covariance)

    def misfit(move: Array) -> float:
        squares = (residual + data.jacobians[-1] @ move) ** 2 * used
        varies = spread > 0
        mean = squares.sum(axis=0) / np.maximum(used.sum(axis=0), 1)
        return float(np.sum(mean[varies] / spread[varies] ** 2))

    while where:
        before = data.x + without(where)
        trials = {e: misfit(without({k: v for k, v in where.items() if k != e})) for e in where}
        best = min(trials, key=lambda e: trials[e])
        del where[best]
        order.append((best, before))
    return order


def _inverse(hessian: Array, held: Bools) -> Array:
    out, free = np.zeros_like(hessian), np.ix_(~held, ~held)
    out[free] = scaled_inverse(hessian[free])
    return out


def _within(data: Linearised, rows: NDArray[np.intp], target: Array, covariance: Array) -> Array:
    """The move (P,) of all parameters when those at `rows` move by `target`; none leaves its bounds."""
    free = covariance[rows, rows] > 0
    at, wanted, move = rows[free], target[free], np.zeros(len(data.x))
    for _ in range(2):
        if len(at):
            inside = covariance[np.ix_(at, at)]
            move = covariance[:, at] @ np.linalg.lstsq(inside, wanted, rcond=1e-12)[0]
        move[rows] = target
        end = data.x + move
        clipped = np.clip(end, data.bounds.lower, data.bounds.upper) - data.x
        out = ((end < data.bounds.lower) | (end > data.bounds.upper)) & (np.diag(covariance) > 0)
        out[rows] = False
        if not out.any():
            break
        # those that would leave their bounds stay at them, and the others move again
        at, wanted = np.concatenate((at, np.flatnonzero(out))), np.concatenate((wanted, clipped[out]))
    move = np.clip(data.x + move, data.bounds.lower, data.bounds.upper) - data.x
    move[rows] = target
    return move
