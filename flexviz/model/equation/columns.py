"""JacobianColumns of the Jacobian ∂r/∂x, each chained from what its parameter does to s and q."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array
from flexviz.model.effects import EFFECTS, LoadedEffect, Terms
from flexviz.model.equation.chain import Chain
from flexviz.model.equation.context import EffectContext
from flexviz.model.equation.layout import Layout
from flexviz.model.equation.motions import viscous_scale
from flexviz.model.equation.signals import Signals

PlacedTerms = list[tuple[slice, Terms]]  # every effect's terms with its place in the vector


@dataclass(frozen=True, eq=False)
class JacobianColumns:
    """JacobianColumns of the Jacobian at x (P,), before initial states are removed.

    Attributes:
        signals, layout: observer outputs and layout of x.
        context: signals offered to the effects.
        x: shape (P,).
        terms: of every effect at x.
        chain: from changes of s and q to those of r.
    """

    signals: Signals
    layout: Layout
    context: EffectContext
    x: Array
    terms: PlacedTerms
    chain: Chain

    def fill(self, jacobian: Array, s: Array, q: Array) -> None:
        """Fill ∂r/∂x (N, n, P), but for the inertial parameters; s and q have the shape (3, N, n)."""
        lay, x, chain = self.layout, self.x, self.chain
        for j in range(lay.n):
            jacobian[:, :, lay.compliance.start + j] = -chain.column("deflection", (j,), s[:, :, [j]])
            for column, fall in self._motor_columns(j):
                jacobian[:, :, column] = chain.column("torque", (j,), fall[..., None])
            jacobian[:, j, lay.link_viscous.start + j] = -q[1, :, j]
        for j in lay.no_torque:  # its s is predicted
            bend = -x[lay.compliance][j] * self.signals.theta[1:4, :, [j]]
            jacobian[:, :, lay.link_viscous.start + j] = chain.column("deflection", (j,), bend)
        for where, term in self.terms:
            jacobian[:, :, where] = chain.columns(term.entry, term.joints, term.slopes)
        for effect, (_, term) in zip(lay.effects, self.terms, strict=True):
            if EFFECTS[effect.effect].relative:
                (j,) = term.joints
                scale, by_motor, by_link = viscous_scale(lay, x, j)
                column = chain.column(term.entry, term.joints, term.value / scale)
                if lay.motors:
                    jacobian[:, :, lay.motor_viscous.start + j] += by_motor * column
                jacobian[:, :, lay.link_viscous.start + j] += by_link * column

    def _motor_columns(self, j: int) -> list[tuple[int, Array]]:
        """Places of B and f_mv of a joint, each with what s falls by, (3, N); none without motors."""
        lay, theta = self.layout, self.signals.theta
        if not lay.motors:
            return []
        inertia, viscous = lay.motor_inertia.start + j, lay.motor_viscous.start + j
        return [(inertia, theta[2:, :, j]), (viscous, theta[1:4, :, j])]

    def add_load_chain(self, jacobian: Array) -> None:
        """Add ∂u/∂s ∂s/∂x (N, n, P) of effects whose u follows the transmission torque s."""
        lay, x, chain = self.layout, self.x, self.chain
        for effect, where in lay.effect_slices():
            law, j = EFFECTS[effect.effect], effect.joint
            if not isinstance(law, LoadedEffect) or j is None:
                continue
            parts = [law.torque_slope(m, x[where])[None] for m in self.context.motions(j)]
            gain = self.context.filtered(parts, j, 3)[0]  # (3, N)
            moves = self._motor_columns(j)
            for at, term in self.terms:
                if term.entry == "torque" and j in term.joints and at != where:
                    slopes = term.slopes[..., term.joints.index(j)]
                    moves += [(at.start + p, slope) for p, slope in enumerate(slopes)]
            for column, fall in moves:  # s falls by this
                first = gain[1] * fall[0] + gain[0] * fall[1]
                second = gain[2] * fall[0] + 2 * gain[1] * fall[1] + gain[0] * fall[2]
                product = np.stack((gain[0] * fall[0], first, second))[..., None]
                jacobian[:, :, column] -= chain.column("torque", (j,), product)
