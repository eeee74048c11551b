"""The identification equation (the paper's equation 6) and its analytic Jacobian.

    s = τ − B θ̈ − f_mv θ̇ − u_torque                     transmission torque seen from the motor [Nm]
    q = θ − c s + u_deflection, and its derivatives      c = 1/K [rad/Nm]
    r = s − [Y(q, q̇, q̈)(Γ + Γ_payload) + f_lv q̇ + u_residual]  →  0

A parameter that moves s by δs (and its derivatives) or q by δq moves r by
δs − [∂(YΓ)/∂q δq + (∂(YΓ)/∂q̇ + f_lv) δq̇ + M δq̈].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import EFFECTS, ChosenEffect, Terms
from flexviz.equation.chain import Chain
from flexviz.equation.context import EffectContext, viscous_scale
from flexviz.equation.initial_state import Remembered, remembered
from flexviz.equation.layout import Layout
from flexviz.equation.link import LinkDynamics, LinkTerms
from flexviz.equation.signals import Signals
from flexviz.robot import Robot

Array = NDArray[np.float64]

STATE_ROUNDS = 6


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
    """r(x) for given signals and effects.

    What an effect's law sees of the identified quantities (s, q, K in its `JointMotion`) stays as it is until
    `prepare` is called again; the Jacobian is exact for that. So does what friction with memory remembers of
    the time before a record, which r is freed of (`beginning`).
    """

    def __init__(
        self, robot: Robot, signals: Signals, layout: Layout, shared: dict[object, Any] | None = None
    ) -> None:
        """`shared` is kept by the caller for all equations of the same signals."""
        self.robot = robot
        self.signals = signals
        self.layout = layout
        self.context = EffectContext(robot, signals, layout, shared)
        self._link = LinkDynamics(robot)
        self._linear: dict[ChosenEffect, Terms] = {}
        self._prepared: Array | None = None
        self._remembered: list[Remembered] | None = None

    @property
    def has_state(self) -> bool:
        """Whether some effect's law depends on identified quantities."""
        return any(EFFECTS[e.effect].state for e in self.layout.effects)

    def prepare(self, x: Array) -> bool:
        """Let the effects see the parameters x.

        Returns:
            whether something that effects depend on has changed since the last call.
        """
        if self._prepared is not None:
            lay = self.layout
            seen = slice(lay.compliance.start, lay.size)
            scale = np.abs(self._prepared[seen]) + np.abs(x[seen]) + 1e-9
            if not self.has_state or np.max(np.abs(x[seen] - self._prepared[seen]) / scale) < 1e-3:
                return False
        first = self._prepared is None
        self._remembered = None
        self._forget()
        self._prepared = x.copy()
        self.context.refresh(x, self._rigid_or_elastic(x), self.context.last_s)
        if self.has_state:
            # s depends on what the effects make of s: a few rounds until it stays
            before = self.context.last_s
            for _ in range(STATE_ROUNDS):
                s, q = self.motor_side(x)
                self._forget()
                self.context.refresh(x, q, s[0])
                if before is not None and np.max(np.abs(s[0] - before)) < 1e-5 * (np.abs(s[0]).max() + 1e-12):
                    break
                before = s[0]
        return not first

    def _forget(self) -> None:
        self._linear = {e: t for e, t in self._linear.items() if not EFFECTS[e.effect].state}

    def _rigid_or_elastic(self, x: Array) -> Array:
        """q without any effect: a first link side for laws that need one."""
        lay, sig = self.layout, self.signals
        s = sig.tau - x[lay.motor_inertia] * sig.theta[2:5] - x[lay.motor_viscous] * sig.theta[1:4]
        return sig.theta[:3] - x[lay.compliance] * s

    def terms(self, x: Array) -> list[tuple[slice, Terms]]:
        """Every effect's terms at x, with the place of its parameters."""
        if self._prepared is None:
            self.prepare(x)
        out = []
        for effect, where in self.layout.effect_slices():
            law = EFFECTS[effect.effect]
            if not law.linear:
                term = law.terms(self.context, effect.place, x[where])
                out.append((where, self._rescaled(term, x) if law.relative else term))
                continue
            if effect not in self._linear:
                self._linear[effect] = law.terms(
                    self.context, effect.place, np.zeros(where.stop - where.start)
                )
            unit = self._linear[effect]
            value = np.tensordot(x[where], unit.slopes, axes=1)
            out.append((where, Terms(unit.entry, unit.joints, value, unit.slopes)))
        return out

    def _rescaled(self, term: Terms, x: Array) -> Terms:
        """A law that is relative to viscous friction, with that of x."""
        assert self._prepared is not None
        (joint,) = term.joints
        seen = viscous_scale(self.layout, self._prepared, joint)[0]
        ratio = viscous_scale(self.layout, x, joint)[0] / seen
        return replace(term, value=ratio * term.value, slopes=ratio * term.slopes)

    def motor_side(self, x: Array, terms: list[tuple[slice, Terms]] | None = None) -> tuple[Array, Array]:
        """s and q with two derivatives each, two arrays of shape (3, N, n)."""
        lay, sig = self.layout, self.signals
        terms = self.terms(x) if terms is None else terms
        s = sig.tau - x[lay.motor_inertia] * sig.theta[2:5]
        s -= x[lay.motor_viscous] * sig.theta[1:4]
        for _, term in terms:
            if term.entry == "torque":
                s[:, :, list(term.joints)] -= term.value
        q = sig.theta[:3] - x[lay.compliance] * s
        for _, term in terms:
            if term.entry == "deflection":
                q[:, :, list(term.joints)] += term.value
        return s, q

    def _bodies(self, x: Array) -> list[tuple[slice, Array]]:
        """Rows and inertial parameters with payload, shape (n, 10), of each block."""
        inertial = x[self.layout.inertial].reshape(self.layout.n, 10)
        return [(b.rows, inertial + self.signals.payload[b.group]) for b in self.signals.blocks]

    def link_terms(self, x: Array) -> LinkTerms:
        """The rigid-body terms at x."""
        q = self.motor_side(x)[1]
        return self._link.evaluate(self._bodies(x), q[0], q[1], q[2])

    def residual(self, x: Array) -> Array:
        """r alone at x, shape (N, n) [Nm]: a third of the work where no friction has a memory."""
        if any(EFFECTS[e.effect].memory for e in self.layout.effects):
            return self.evaluate(x).residual
        terms = self.terms(x)
        s, q = self.motor_side(x, terms)
        residual = s[0] - x[self.layout.link_viscous] * q[1]
        for rows, parameters in self._bodies(x):
            residual[rows] -= self._link.torque(parameters, q[0, rows], q[1, rows], q[2, rows])
        return _without(terms, residual)

    def evaluate(self, x: Array) -> Evaluation:
        """Residual and Jacobian at x (shape (P,))."""
        lay, sig, n = self.layout, self.signals, self.layout.n
        terms = self.terms(x)
        s, q = self.motor_side(x, terms)
        blocks = self._bodies(x)
        link = self._link.evaluate(blocks, q[0], q[1], q[2])

        residual = s[0] - x[lay.link_viscous] * q[1]
        for rows, parameters in blocks:
            residual[rows] -= link.regressor[rows] @ parameters.ravel()
        residual = _without(terms, residual)
        jacobian = np.zeros((sig.count, n, lay.size))
        jacobian[:, :, lay.inertial] = -link.regressor
        chain = Chain(x[lay.compliance], x[lay.link_viscous], link)
        for j in range(n):
            jacobian[:, :, lay.compliance.start + j] = chain.deflection(s[:, :, j], j)
            jacobian[:, :, lay.motor_inertia.start + j] = chain.torque(sig.theta[2:5, :, j], j)
            jacobian[:, :, lay.motor_viscous.start + j] = chain.torque(sig.theta[1:4, :, j], j)
            jacobian[:, j, lay.link_viscous.start + j] = -q[1, :, j]
        for where, term in terms:
            for p, column in enumerate(range(where.start, where.stop)):
                jacobian[:, :, column] = chain.column(term.entry, term.joints, term.slopes[p])
        for effect, (_, term) in zip(lay.effects, terms, strict=True):
            if EFFECTS[effect.effect].relative:
                (j,) = term.joints
                scale, by_motor, by_link = viscous_scale(lay, x, j)
                column = chain.column(term.entry, term.joints, term.value / scale)
                jacobian[:, :, lay.motor_viscous.start + j] += by_motor * column
                jacobian[:, :, lay.link_viscous.start + j] += by_link * column
        if self._remembered is None:
            values = [(effect, x[where]) for effect, where in lay.effect_slices()]
            self._remembered = remembered(self.context, sig, values, chain)
        for stretch in self._remembered:
            stretch.taken_out(residual)
            stretch.taken_out(jacobian)
        return Evaluation(residual, jacobian, s, q, link)


def _without(terms: list[tuple[slice, Terms]], residual: Array) -> Array:
    """The residual less what effects subtract from it directly."""
    for _, term in terms:
        if term.entry == "residual":
            residual[:, list(term.joints)] -= term.value[0]
    return residual
