"""The identification equation (the paper's equation 6) and its analytic Jacobian.

    s = τ − B θ̈ − f_mv θ̇ − u_motor                      transmission torque seen from the motor [Nm]
    q = θ − c s,  q̇ = θ̇ − c ṡ,  q̈ = θ̈ − c s̈            c = 1/K [rad/Nm]
    r = s − [Y(q, q̇, q̈)(Γ + Γ_payload) + f_lv q̇ + u_link]  →  0

A parameter that moves s by δs (and its derivatives) or q by δq moves r by
δs − [∂(YΓ)/∂q δq + (∂(YΓ)/∂q̇ + f_lv) δq̇ + M δq̈].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation.layout import Layout
from flexviz.equation.link import LinkDynamics, LinkTerms
from flexviz.equation.signals import Signals
from flexviz.robot import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Evaluation:
    """The equation at one parameter vector.

    Attributes:
        residual: shape (N, n), r [Nm].
        jacobian: shape (N, n, P), ∂r/∂x.
        torque: shape (3, N, n), s and its derivatives [Nm/s^k].
        q: shape (3, N, n), link side and its derivatives [rad/s^k].
        link: the rigid-body terms.
    """

    residual: Array
    jacobian: Array
    torque: Array
    q: Array
    link: LinkTerms


class Equation:
    """r(x) for given signals and effects."""

    def __init__(self, robot: Robot, signals: Signals, layout: Layout) -> None:
        self.signals = signals
        self.layout = layout
        self._link = LinkDynamics(robot)
        self._columns: dict[ChosenEffect, Array] = {}
        self._velocity_stiffness: Array | None = None

    def prepare(self, stiffness: Array) -> bool:
        """Compute the effects' columns; those of link effects follow the stiffness (shape (n,) [Nm/rad]).

        Returns:
            whether columns that were already there have changed.

        The dependence of sign(q̇) on the stiffness is not part of the Jacobian: columns stay as they are until
        this is called again.
        """
        known = self._velocity_stiffness
        moved = known is None or np.max(np.abs(stiffness / known - 1)) > 1e-3
        changed = False
        for effect in self.layout.effects:
            stale = effect in self._columns and moved and EFFECTS[effect.effect].where == "link"
            if stale or effect not in self._columns:
                self._columns[effect] = self.signals.effect_columns(effect, stiffness)
            changed |= stale
        if moved:
            self._velocity_stiffness = stiffness.copy()
        return changed

    @property
    def has_link_effects(self) -> bool:
        """Whether some columns depend on the stiffness."""
        return any(EFFECTS[e.effect].where == "link" for e in self.layout.effects)

    def columns_of(self, effect: ChosenEffect) -> Array:
        """An effect's columns, shape (P, D, N); see `Signals.effect_columns`."""
        return self._columns[effect]

    def motor_side(self, x: Array) -> tuple[Array, Array]:
        """s and q with two derivatives each, two arrays of shape (3, N, n)."""
        lay, sig = self.layout, self.signals
        s = sig.tau - x[lay.motor_inertia] * sig.theta[2:5]
        s -= x[lay.motor_viscous] * sig.theta[1:4]
        for effect, where in lay.effect_slices():
            if EFFECTS[effect.effect].where == "motor":
                s[:, :, effect.joint] -= np.tensordot(x[where], self._columns[effect], axes=1)
        return s, sig.theta[:3] - x[lay.compliance] * s

    def _bodies(self, x: Array) -> list[tuple[slice, Array]]:
        """Rows and inertial parameters with payload, shape (n, 10), of each block."""
        inertial = x[self.layout.inertial].reshape(self.layout.n, 10)
        return [(b.rows, inertial + self.signals.payload[b.group]) for b in self.signals.blocks]

    def link_terms(self, x: Array) -> LinkTerms:
        """The rigid-body terms at x."""
        q = self.motor_side(x)[1]
        return self._link.evaluate(self._bodies(x), q[0], q[1], q[2])

    def evaluate(self, x: Array) -> Evaluation:
        """Residual and Jacobian at x (shape (P,))."""
        if self._velocity_stiffness is None:
            self.prepare(1 / x[self.layout.compliance])
        lay, sig, n = self.layout, self.signals, self.layout.n
        s, q = self.motor_side(x)
        blocks = self._bodies(x)
        link = self._link.evaluate(blocks, q[0], q[1], q[2])

        residual = s[0] - x[lay.link_viscous] * q[1]
        for rows, parameters in blocks:
            residual[rows] -= link.regressor[rows] @ parameters.ravel()
        jacobian = np.zeros((sig.count, n, lay.size))
        jacobian[:, :, lay.inertial] = -link.regressor
        self._fill(x, jacobian, residual, s, q, link)
        return Evaluation(residual, jacobian, s, q, link)

    def _fill(self, x: Array, jacobian: Array, residual: Array, s: Array, q: Array, link: LinkTerms) -> None:
        lay, theta = self.layout, self.signals.theta
        compliance, viscous = x[lay.compliance], x[lay.link_viscous]
        damping = link.dv + np.diag(viscous)

        def through_link(dq: Array, j: int) -> Array:
            """Change of Y Γ + f_lv q̇ when joint j's q moves by dq (shape (3, N)): shape (N, n)."""
            return (
                link.dq[:, :, j] * dq[0][:, None]
                + damping[:, :, j] * dq[1][:, None]
                + link.mass[:, :, j] * dq[2][:, None]
            )

        def motor_torque(column: int, u: Array, j: int) -> None:
            """A parameter whose torque u (shape (3, N)) is subtracted from joint j's s."""
            jacobian[:, :, column] = -through_link(compliance[j] * u, j)
            jacobian[:, j, column] -= u[0]

        for j in range(lay.n):
            jacobian[:, :, lay.compliance.start + j] = through_link(s[:, :, j], j)
            motor_torque(lay.motor_inertia.start + j, theta[2:5, :, j], j)
            motor_torque(lay.motor_viscous.start + j, theta[1:4, :, j], j)
            jacobian[:, j, lay.link_viscous.start + j] = -q[1, :, j]
        for effect, where in lay.effect_slices():
            columns, j = self._columns[effect], effect.joint
            if EFFECTS[effect.effect].where == "motor":
                for p, column in enumerate(range(where.start, where.stop)):
                    motor_torque(column, columns[p], j)
            else:
                jacobian[:, j, where] = -columns[:, 0].T
                residual[:, j] -= x[where] @ columns[:, 0]
