"""Uncertainty of the parameters due to what the model lacks.

A torque that the model lacks is a function of the motion, as the regressor is. A fit absorbs the part that
resembles the regressor and leaves the rest, so that the residual cannot show what was absorbed, and the
spectra of the residual (`covariance`) count it as chance. But the library knows what missing torques look
like. A torque h of unit size leaves (1 − Z H⁻¹ Zᵀ) h in the residual and moves the parameters by H⁻¹ Zᵀ h. If
the effects of a joint are equally large on average, their size follows from the residual above the noise, and
with it the covariance of the parameters, for each joint j with residual variance v_j above the noise

    v_j Σ_h (H⁻¹ Zᵀ h)(H⁻¹ Zᵀ h)ᵀ / Σ_h mean((1 − Z H⁻¹ Zᵀ) h)²

(method of moments for a variance component: Searle, Casella, McCulloch, Variance Components, 1992). On data
that the model explains down to the noise it vanishes; a stiffness that resembles friction, a delay or
backlash gets the interval it deserves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.analysis.estimation.covariance import Covariance
from flexviz.analysis.estimation.least_squares import Stopped
from flexviz.analysis.estimation.score_test import Projection, ScoredCandidate, Weigh, score, weighted_guesses
from flexviz.base.arrays import Array, Bools
from flexviz.base.statistics import NORMAL_95, student_95
from flexviz.model.effects import EFFECTS, ChosenEffect
from flexviz.model.equation import Chain, OperatingPoint

NEGLIGIBLE = 1e-3  # share of a variance below which its uncertainty does not matter


@dataclass(frozen=True, eq=False)
class FittedModel:
    """What a fit knows of its model and data.

    Attributes:
        point: operating point, with the stretches of `weigh`.
        chain: sensitivity of r to s and q.
        weigh: applies the weights of the residual to columns.
        residual: shape (M,), weighted.
        instruments: shape (M, P), weighted Jacobian.
        hessian: shape (P, P), of the prior.
        at_bound: shape (P,), parameters held at a bound.
    """

    point: OperatingPoint
    chain: Chain
    weigh: Weigh
    residual: Array
    instruments: Array
    hessian: Array
    at_bound: Bools

    @property
    def projection(self) -> Projection:
        """Projects out the parameters that are not at a bound."""
        free = ~self.at_bound
        instruments = self.instruments[:, free]
        hessian = instruments.T @ instruments + self.hessian[np.ix_(free, free)]
        return Projection(self.residual, instruments, hessian)

    @property
    def lacking(self) -> list[ChosenEffect]:
        """Every effect of the library on every joint and payload that the model lacks."""
        layout = self.point.layout
        payloads = sorted({g.payload for g in self.point.signals.groups if g.bodies})
        places = (
            ChosenEffect(name, target.joint, target.group, target.payload)
            for name, law in EFFECTS.items()
            if (layout.motors or law.behind_gear) and not (law.by_temperature or law.stopgap)
            for target in law.targets(layout.n, payloads)
        )
        return [place for place in places if place not in layout.effects]

    def most_telling(self) -> list[ScoredCandidate]:
        """Of each joint the lacking effect that would explain most, of those linear in their parameters."""
        wanted = [e for e in self.lacking if EFFECTS[e.effect].linear and e.joint is not None]
        scored = score(self.point, self.chain, wanted, self.weigh, self.projection)
        by_gain = sorted(scored, key=lambda one: one.gain)
        return list({one.effect.joint: one for one in by_gain}.values())


def with_model_error(
    chance: Sequence[Covariance], fits: Sequence[FittedModel], excess: Array
) -> list[Covariance]:
    """The covariance of each fit's parameters and that of what its model lacks.

    A missing torque h moves the parameters by H⁻¹ Zᵀ h and leaves (1 − Z H⁻¹ Zᵀ) h. The library's effects
    stand for what may be missing; their common size on a joint follows from its residual above the noise, and
    the moves of that size are added to the covariance.

    Args:
        chance: from the noise or the residual's spectra, one per fit.
        fits: of one model at one point, that hold different parameters at their bounds.
        excess: shape (n,), mean square of each joint's weighted residual above that of the noise.

    Returns:
        one per fit; that of chance alone if the user stops it.
    """
    if not excess.any():
        return list(chance)
    one, moves = fits[0], [_Moves(fit) for fit in fits]
    try:
        for effect, columns in weighted_guesses(one.point, one.chain, one.lacking, one.weigh):
            unit = columns / np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
            for each in moves:
                each.add(effect, unit)
    except Stopped:
        return list(chance)
    return [each.widened(covariance, excess) for each, covariance in zip(moves, chance, strict=True)]


class _Moves:
    """How effects of unit size move the parameters of a fit, and what they leave in its residual."""

    def __init__(self, fit: FittedModel) -> None:
        self._fit, self._projection = fit, fit.projection
        self._found: dict[ChosenEffect, list[tuple[Array, Array]]] = {}

    def add(self, effect: ChosenEffect, unit: Array) -> None:
        """Add signatures (M, C) of unit length of an effect."""
        self._found.setdefault(effect, []).append(self._projection.remainder(unit))

    def widened(self, covariance: Covariance, excess: Array) -> Covariance:
        """The covariance, and that of the moves by effects as large as the residual says."""
        free, n = np.flatnonzero(~self._fit.at_bound), len(excess)
        owner = np.array([n if e.joint is None else e.joint for e in self._found])
        moved, left = np.zeros((n + 1, len(free), len(free))), np.zeros(n + 1)
        alone = np.zeros((len(self._found), len(free)))
        for k, parts in enumerate(self._found.values()):
            share, rest = (np.concatenate(p, axis=-1) for p in zip(*parts, strict=True))
            moved[owner[k]] += share @ share.T / len(rest)
            left[owner[k]] += rest.mean()
            alone[k] = np.mean(share**2, axis=1)
        variance = np.zeros(n + 1)  # of one effect, the sum of its squares
        count = self._fit.point.signals.count
        variance[:n] = count * excess / np.maximum(left[:n], np.finfo(float).tiny)
        variance[n] = variance[:n].mean()  # what belongs to no joint is as large as what belongs to one
        total = covariance.matrix.copy()
        total[np.ix_(free, free)] += np.tensordot(variance, moved, axes=1)
        # few effects: Student's quantile in place of the normal one
        wider = np.ones(len(total))
        wider[free] = student_factor(np.diag(total)[free], alone * variance[owner][:, None])
        return covariance.replaced(total * wider[:, None] * wider)


def student_factor(total: Array, parts: Array) -> Array:
    """Student's 97.5 % quantile over the normal one, for variances (P,) with few uncertain parts (E, P).

    Degrees of freedom as of Satterthwaite (Biometrics Bulletin 2, 1946), each part with one: how large a
    single effect is, is known as little as a variance of which there is one sample.
    """
    squares = np.sum(parts**2, axis=0)
    certain = squares <= (NEGLIGIBLE * total) ** 2
    freedom = total**2 / np.where(certain, 1.0, squares)
    return np.where(certain, 1.0, student_95(np.maximum(freedom, 1.0)) / NORMAL_95)
