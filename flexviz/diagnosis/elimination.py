"""Drops in closed form: which effects of a fitted model do the data need?

A fit gives its parameters as a normal distribution of precision H. Leaving an effect out fixes its
parameters, which moves all others linearly and changes the residual by the Jacobian times that move. One
Jacobian and H therefore judge every smaller model by the criterion, without a fit.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.criterion import Gain, Likelihood, Residuals, gain, likelihood
from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import Layout
from flexviz.estimation import Bounds, scaled_inverse

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Linearised:
    """A fitted model and its residuals as linear functions of its parameters.

    Attributes:
        layout, x: the model and its parameters, shape (P,).
        parts: residuals of the fit groups, and of the validation groups if there are any.
        jacobians: of each part, shape (N, n, P).
        floor: shape (n,), standard deviation of each joint's residual due to the noise.
        hessian: shape (P, P), of the objective.
        prior: gradient (P,) and Hessian (P, P) of the prior.
        held: shape (P,), parameters that do not move.
        bounds: of the parameters.
        likelihood: of the model.
        outlier: as in `likelihood`.
    """

    layout: Layout
    x: Array
    parts: Sequence[Residuals]
    jacobians: Sequence[Array]
    floor: Array
    hessian: Array
    prior: tuple[Array, Array]
    held: Bools
    bounds: Bounds
    likelihood: Likelihood
    outlier: float


@dataclass(frozen=True, eq=False)
class Elimination:
    """Result of an elimination: the effects that stay, and the start of a fit without the others.

    Attributes:
        kept: what each effect gains given the others.
        dropped: effects left out, in this order, with what each gained when it was dropped.
        x: shape (P,), parameters of the full layout with the dropped effects at zero.
    """

    kept: dict[ChosenEffect, Gain]
    dropped: dict[ChosenEffect, Gain]
    x: Array


def eliminate(
    data: Linearised,
    firm: Callable[[Layout], Collection[ChosenEffect]],
    impossible: Collection[ChosenEffect],
    tried: int,
    trace: Callable[[ChosenEffect], float] = lambda effect: 0.0,
) -> Elimination:
    """Drop, one by one, the effects that a model does not need: the impossible ones, then the least needed.

    Args:
        data: the model.
        firm: effects of a model that are not dropped, such as those of the set's own model.
        impossible: effects whose parameters could not be real.
        tried: number of candidates from which the effects were chosen.
        trace: what approximate laws leave where an effect acts, which it has to exceed [nats].
    """
    left, dropped = dict(data.layout.effect_slices()), dict[ChosenEffect, Gain]()
    moved, now = np.zeros(len(data.x)), data
    held = data.held.copy()
    while True:
        covariance = _inverse(data.hessian, held)
        moves = {effect: _move(now, effect, where, covariance) for effect, where in left.items()}
        found = _gains(now, moves, tried, trace)
        stay = firm(data.layout.with_effects(left))
        weak = [e for e, g in found.items() if e not in stay and (e in impossible or not g.accepted)]
        if not weak:
            return Elimination(found, dropped, now.x)
        worst: dict[int | None, ChosenEffect] = {}
        for effect in sorted(weak, key=lambda e: (e not in impossible, found[e].delta)):
            worst.setdefault(effect.joint, effect)  # those of one joint may stand in for one another
        moved = moved + _joint_move(now, [left[e] for e in worst.values()], list(worst.values()), covariance)
        for effect in worst.values():
            held[left.pop(effect)] = True
            dropped[effect] = found[effect]
        now = _moved(data, moved)


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


def _move(data: Linearised, effect: ChosenEffect, where: slice, covariance: Array) -> Array:
    """How the parameters move when an effect is left out, shape (P,)."""
    return _joint_move(data, [where], [effect], covariance)


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


def _moved(data: Linearised, move: Array) -> Linearised:
    """The model with other parameters, linearised at the same point."""
    parts = [
        replace(part, values=part.values + jacobian @ move)
        for part, jacobian in zip(data.parts, data.jacobians, strict=True)
    ]
    gradient, hessian = data.prior
    other = data.likelihood.other + float(gradient @ move + 0.5 * move @ hessian @ move)
    before = data.likelihood
    found = likelihood(parts, data.floor, other, before.freedom, data.outlier, before.times)
    prior = gradient + hessian @ move, hessian
    return replace(data, x=data.x + move, parts=parts, prior=prior, likelihood=found)


def _gains(
    data: Linearised,
    moves: Mapping[ChosenEffect, Array],
    tried: int,
    trace: Callable[[ChosenEffect], float],
) -> dict[ChosenEffect, Gain]:
    """What each effect gains given the others, from the moves (P,) that leave it out."""
    together = np.stack(list(moves.values()), axis=1) if moves else np.zeros((len(data.x), 0))
    changes = [jacobian @ together for jacobian in data.jacobians]
    gradient, hessian = data.prior
    costs = gradient @ together + 0.5 * np.einsum("pe,pq,qe->e", together, hessian, together)
    before, out = data.likelihood, {}
    for k, effect in enumerate(moves):
        law = EFFECTS[effect.effect]
        parts = [
            replace(part, values=part.values + change[:, :, k])
            for part, change in zip(data.parts, changes, strict=True)
        ]
        freedom = before.freedom - len(law.parameters)
        other = before.other + float(costs[k])
        smaller = likelihood(parts, data.floor, other, freedom, data.outlier, before.times)
        out[effect] = gain(smaller, before, tried, trace(effect))
    return out
