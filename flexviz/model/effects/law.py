"""Effects whose u depends on the motion of their joint only, computed at full bandwidth, then filtered."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from itertools import product
from typing import ClassVar

import numpy as np

from flexviz.base.arrays import Bools
from flexviz.model.effects.effect import Effect
from flexviz.model.effects.terms import Array, Context, EffectTarget, Guess, JointMotion, Terms


class LawEffect(Effect):
    """An effect given by a law of its joint's motion.

    Attributes:
        memory: u depends on the time before the record (see `unknown`).
        smooth: u is continuous where velocity or torque changes sign, so that no sample is ambiguous.
        grid: nonlinear parameter → values that a search tries; u is linear in the others.
    """

    grid: ClassVar[Mapping[str, Sequence[float]]] = {}
    smooth: ClassVar[bool] = False

    @abstractmethod
    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        """u, shape (N,), and ∂u/∂p, shape (P, N)."""

    def unknown(self, motion: JointMotion, values: Array) -> Array:
        """Standard deviations of u due to the unknown time before the record, shape (M, N)."""
        return np.zeros((0, len(motion.time)))

    def undecided(self, motion: JointMotion, values: Array) -> tuple[Bools, Array] | None:
        """Samples at which the motion does not determine u, and the range of u there, shape (N,) each.

        None: the samples at which the law jumps within the noise of its signals.
        """
        return None

    @property
    def depth(self) -> int:
        """Number of derivatives that the equation needs of u, u itself included."""
        return 1 if self.entry == "residual" else 3

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        parts = []
        for motion in context.motions(place.own_joint):
            u, slopes = self.law(motion, values)
            parts.append(np.concatenate((u[None], slopes)))
        out = context.filtered(parts, place.own_joint, self.depth)[..., None]
        return Terms(self.entry, (place.own_joint,), out[0], out[1:])

    def guesses(self, context: Context, place: EffectTarget) -> list[Guess]:
        names = [p.name for p in self.parameters]
        return [
            self.guess(
                context, place, {names.index(name): v for name, v in zip(self.grid, tried, strict=True)}
            )
            for tried in product(*self.grid.values())
        ]

    def guess(self, context: Context, place: EffectTarget, fixed: Mapping[int, float]) -> Guess:
        """The slopes at zero as columns, with the parameters in `fixed` (index → value) held."""
        start = np.zeros(len(self.parameters))
        start[list(fixed)] = list(fixed.values())
        free = [k for k in range(len(start)) if k not in fixed]
        terms = self.terms(context, place, start)

        def to_values(coefficients: Array) -> Array:
            values = start.copy()
            values[free] = coefficients
            return values

        return Guess(terms.entry, terms.joints, terms.slopes[free], to_values)


class LinearEffect(LawEffect):
    """u = Σ p · column(t)."""

    linear = True

    @abstractmethod
    def columns(self, motion: JointMotion) -> Array:
        """∂u/∂p for each parameter, shape (P, N) [Nm per unit of p]."""

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        columns = self.columns(motion)
        return values @ columns, columns

    def terms(self, context: Context, place: EffectTarget, values: Array) -> Terms:
        columns = [self.columns(motion) for motion in context.motions(place.own_joint)]
        slopes = context.filtered(columns, place.own_joint, self.depth)[..., None]
        return Terms(self.entry, (place.own_joint,), np.tensordot(values, slopes, axes=1), slopes)


class LoadedEffect(LawEffect):
    """A law whose torque follows the transmission torque s."""

    @abstractmethod
    def torque_slope(self, motion: JointMotion, values: Array) -> Array:
        """∂u/∂s, shape (N,), with the feedback of u on s itself."""


def chained(factor: Array, offset: Array) -> Array:
    """x_{k+1} = factor_k x_k + offset_k from x_0 = 0: shape (R,) → (R + 1,); maps composed by doubling."""
    factor, offset, reach = factor.copy(), offset.copy(), 1
    while reach < len(factor):
        offset[reach:] += factor[reach:] * offset[:-reach]
        factor[reach:] = factor[reach:] * factor[:-reach]
        reach *= 2
    return np.concatenate(([0.0], offset))
