"""The identification equation (the paper's equation 6) and its analytic Jacobian.

    s = τ − B θ̈ − f_mv θ̇ − u_torque                     transmission torque seen from the motor [Nm]
    q = θ − c s + u_deflection, and its derivatives      c = 1/K [rad/Nm]
    r = s − [Y(q, q̇, q̈)(Γ + Γ_payload) + f_lv q̇ + u_residual]  →  0

A change of s by δs (and its derivatives) or of q by δq changes r by
δs − [∂(YΓ)/∂q δq + (∂(YΓ)/∂q̇ + f_lv) δq̇ + M δq̈].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flexviz.base.arrays import Array
from flexviz.base.errors import InputError
from flexviz.model.effects import EFFECTS, ChosenEffect, LoadedEffect, Terms
from flexviz.model.equation.chain import Chain
from flexviz.model.equation.columns import JacobianColumns, PlacedTerms
from flexviz.model.equation.context import EffectContext
from flexviz.model.equation.initial_state import InitialStates, initial_states
from flexviz.model.equation.layout import Layout
from flexviz.model.equation.link import LinkDynamics, LinkTerms
from flexviz.model.equation.motions import viscous_scale
from flexviz.model.equation.nearby import NearbyTerms
from flexviz.model.equation.predicted_torque import predict_torques
from flexviz.model.equation.signals import Signals
from flexviz.robot.robot import Robot

MAX_STATE_ITERATIONS = 6  # fixed-point iterations: s depends on effects that depend on s
STATE_TOLERANCE = 1e-5  # next change of s, relative to its largest value, that is not worth computing
STATE_CHANGE = 1e-3  # relative change of a parameter after which effects are evaluated again


@dataclass(frozen=True)
class Evaluation:
    """The equation at one parameter vector."""

    residual: Array  # (N, n), r [Nm]
    jacobian: Array  # (N, n, P), ∂r/∂x
    torque: Array  # (3, N, n), s and its derivatives [Nm/s^k]
    q: Array  # (3, N, n), link side and its derivatives [rad/s^k]
    link: LinkTerms  # the rigid-body terms


class Equation:
    """r(x) for given signals and effects: what the links' motion leaves of the transmission torque.

    The link side, which is not measured, is eliminated by q = θ − s/K. Γ enters linearly, K through q.

    Args:
        robot: rigid-body model.
        signals: observer outputs.
        layout: layout of x.
        shared: cache kept by the caller for all equations of the same signals.
    """

    def __init__(
        self, robot: Robot, signals: Signals, layout: Layout, shared: dict[object, Any] | None = None
    ) -> None:
        self.robot = robot
        self.signals = signals
        self.layout = layout
        self.link = LinkDynamics(robot)
        require_temperatures(signals, layout)
        self._shared: dict[object, Any] = {} if shared is None else shared
        self.rigid: NearbyTerms = self._shared.setdefault(NearbyTerms, NearbyTerms())

    @property
    def has_state(self) -> bool:
        """Whether an effect depends on identified quantities."""
        return any(EFFECTS[e.effect].state for e in self.layout.effects)

    def at(self, x: Array, after: OperatingPoint | None = None, *, moving: bool = False) -> OperatingPoint:
        """Operating point of the effects at the parameters x.

        Args:
            x: shape (P,).
            after: an earlier point of the same fit. It is returned if nothing relevant to the effects has
                changed; otherwise the iteration for s starts from it.
            moving: any change is relevant to effects that follow the transmission torque, as in
                `OperatingPoint.evaluate`.
        """
        follows = moving and any(isinstance(EFFECTS[e.effect], LoadedEffect) for e in self.layout.effects)
        noticeable = 0.0 if follows else STATE_CHANGE
        if after is not None and not (self.has_state and after.left_behind(x, noticeable)):
            return after
        q = self.without_effects(x)
        if after is None:
            context = EffectContext(self.link, self.signals, self.layout, self._shared, x, q)
            point = OperatingPoint(self, x, context, {})
        else:
            point = after.seeing(x, q, after.context.s)
        if not self.has_state:
            return point
        before, last = point.context.s, np.inf
        for _ in range(MAX_STATE_ITERATIONS):
            s, q = point.motor_side(x)
            point = point.seeing(x, q, s[0])
            change = np.inf if before is None else float(np.max(np.abs(s[0] - before)))
            rate = min(change / last, 1.0) if np.isfinite(last) else 1.0  # at which the changes fall
            if rate * change < STATE_TOLERANCE * (np.abs(s[0]).max() + 1e-12):
                break
            before, last = s[0], change
        return point

    def evaluate(self, x: Array) -> Evaluation:
        """Residual and Jacobian at x, shape (P,), which is also the operating point of the effects."""
        return self.at(x).evaluate(x)

    def without_effects(self, x: Array) -> Array:
        """q without any effect, shape (3, N, n), as an initial link side for the effects."""
        return self.signals.theta[:3] - x[self.layout.compliance] * self.transmitted(x)

    def transmitted(self, x: Array) -> Array:
        """s without any effect and its derivatives, shape (3, N, n) [Nm/s^k]; predicted without a torque."""
        lay, sig = self.layout, self.signals
        inertia, viscous = lay.motor_side(x)
        s = sig.tau - inertia * sig.theta[2:] - viscous * sig.theta[1:4]
        if lay.no_torque:
            predict_torques(s, self.link, sig, lay, x, self.bodies(x))
        return s

    def bodies(self, x: Array) -> list[tuple[slice, Array]]:
        """Rows and inertial parameters with payload, shape (n, 10), of each block."""
        inertial = x[self.layout.inertial].reshape(self.layout.n, 10)
        return [(b.rows, inertial + self.signals.payload[b.group]) for b in self.signals.blocks]


class OperatingPoint:
    """The equation with the effects evaluated at fixed parameters; created by `Equation.at`.

    The identified quantities offered to an effect (s, q, K in its `JointMotion`) are those of `x`, even if
    the residual is evaluated at other parameters; the Jacobian is exact in this sense. The columns of unknown
    initial states of friction with memory (`initial_state`) are fixed by the first evaluation.

    Attributes:
        equation: the equation.
        x: shape (P,), parameters offered to the effects.
        context: signals offered to the effects.
    """

    def __init__(
        self, equation: Equation, x: Array, context: EffectContext, linear: dict[ChosenEffect, Terms]
    ) -> None:
        self.equation, self.context = equation, context
        self.signals, self.layout = equation.signals, equation.layout
        self.x = x.copy()
        self._linear = linear  # of laws that are linear in their parameters: the same at every x
        self._last: dict[ChosenEffect, tuple[Array, Terms]] = {}
        self._initial: list[InitialStates] | None = None

    def left_behind(self, x: Array, noticeable: float = STATE_CHANGE) -> bool:
        """Whether x differs by more than a relative change from the parameters offered to the effects."""
        seen = slice(self.layout.compliance.start, self.layout.size)
        scale = np.abs(self.x[seen]) + np.abs(x[seen]) + 1e-9
        return bool(np.max(np.abs(x[seen] - self.x[seen]) / scale) > noticeable)

    def seeing(self, x: Array, q: Array, s: Array | None) -> OperatingPoint:
        """The operating point with x, q (3, N, n) and s (N, n) offered to the effects."""
        kept = {e: t for e, t in self._linear.items() if not EFFECTS[e.effect].state}
        point = OperatingPoint(self.equation, x, self.context.seeing(x, q, s), kept)
        point._last = self._last
        return point

    def terms(self, x: Array, *, with_residual: bool = True) -> PlacedTerms:
        """Every effect's terms at x; without those that enter the residual alone, s and q are the same."""
        out = []
        for effect, where in self.layout.effect_slices():
            law = EFFECTS[effect.effect]
            if law.entry in ("residual", "gravity") and not with_residual:
                continue
            if not law.linear:
                term = self._nonlinear(effect, x[where])
                if law.relative:  # to viscous friction, which is that of x
                    seen, now = (viscous_scale(self.layout, y, term.joints[0])[0] for y in (self.x, x))
                    term = replace(term, value=now / seen * term.value, slopes=now / seen * term.slopes)
                out.append((where, term))
                continue
            if effect not in self._linear:
                self._linear[effect] = law.terms(self.context, effect.place, x[where])
            unit = self._linear[effect]
            value = np.tensordot(x[where], unit.slopes, axes=1)
            out.append((where, Terms(unit.entry, unit.joints, value, unit.slopes)))
        return out

    def _nonlinear(self, effect: ChosenEffect, values: Array) -> Terms:
        """Terms of an effect at values (P,); those without a state depend on nothing else and are kept."""
        law = EFFECTS[effect.effect]
        if law.state:
            return law.terms(self.context, effect.place, values)
        kept = self._last.get(effect)
        if kept is None or not np.array_equal(kept[0], values):
            self._last[effect] = kept = values.copy(), law.terms(self.context, effect.place, values)
        return kept[1]

    def motor_side(self, x: Array, terms: PlacedTerms | None = None) -> tuple[Array, Array]:
        """s and q with two derivatives each, two arrays of shape (3, N, n)."""
        lay, sig = self.layout, self.signals
        terms = self.terms(x, with_residual=False) if terms is None else terms
        s = self.equation.transmitted(x)
        for _, term in terms:
            if term.entry == "torque":
                s[:, :, list(term.joints)] -= term.value
        q = sig.theta[:3] - x[lay.compliance] * s
        for _, term in terms:
            if term.entry == "deflection":
                q[:, :, list(term.joints)] += term.value
        return s, q

    def link_terms(self, x: Array) -> LinkTerms:
        """The rigid-body terms at x."""
        s, q = self.motor_side(x)
        link = self.equation.link.evaluate(self.equation.bodies(x), *q, gravity=self._gravity(x))
        return self._with_torque(link, s[0])

    def _with_torque(self, link: LinkTerms, torque: Array) -> LinkTerms:
        """The rigid-body terms, with what effects see of the transmission torque (N, n)."""
        elastic = any(EFFECTS[e.effect].absorbed_by_stiffness for e in self.layout.effects)
        return replace(link, torque=torque.copy(), seen=self.context.seen() if elastic else None)

    def residual(self, x: Array) -> Array:
        """Residual alone at x, shape (N, n) [Nm]; three times faster than with the Jacobian."""
        if self._initial is None and any(EFFECTS[e.effect].memory for e in self.layout.effects):
            return self.evaluate(x).residual
        terms = self.terms(x)
        s, q = self.motor_side(x, terms)
        residual = s[0] - x[self.layout.link_viscous] * q[1]
        gravity = self._gravity(x)
        for rows, parameters in self.equation.bodies(x):
            residual[rows] -= self.equation.link.torque(parameters, *q[:, rows], gravity=gravity)
        residual = _without(terms, residual)
        for stretch in self._initial or []:
            stretch.remove_from(residual)
        residual[:, list(self.layout.no_torque)] = 0.0
        return residual

    def evaluate(self, x: Array, *, moving: bool = False, near: bool = False) -> Evaluation:
        """Residual and Jacobian at x (shape (P,)).

        Args:
            x: shape (P,).
            near: the Jacobian may have the rigid-body terms of an earlier motion of the link side that is
                nearly the same; the residual is exact.
            moving: let the operating point move with x: the Jacobian includes ∂u/∂s ∂s/∂x of effects whose u
                follows the transmission torque s. Without it, a direction that the rest of the equation does
                not show (motor inertia against link inertia) seems free, although it changes s and with it
                the friction: a fit that renews the operating point at every step would oscillate.
        """
        lay = self.layout
        terms = self.terms(x)
        s, q = self.motor_side(x, terms)
        blocks = self.equation.bodies(x)
        jacobian = np.zeros((self.signals.count, lay.n, lay.size))
        regressor = jacobian[:, :, lay.inertial]
        residual = s[0] - x[lay.link_viscous] * q[1]
        link = self._near(x, q, regressor, residual) if near else None
        if link is None:
            link = self.equation.link.evaluate(blocks, q[0], q[1], q[2], regressor, self._gravity(x))
            if near:
                self.equation.rigid.keep(x[lay.inertial], q, regressor, link)
            for rows, parameters in blocks:
                residual[rows] -= regressor[rows] @ parameters.ravel()
        link = self._with_torque(link, s[0])
        np.negative(regressor, out=regressor)
        residual = _without(terms, residual)
        chain = Chain(x[lay.compliance], x[lay.link_viscous], link)
        columns = JacobianColumns(self.signals, lay, self.context, x, terms, chain)
        columns.fill(jacobian, s, q)
        if moving:
            columns.add_load_chain(jacobian)
        if self._initial is None:
            values = [(effect, x[where]) for effect, where in lay.effect_slices()]
            self._initial = initial_states(self.context, self.signals, values, chain)
        for stretch in self._initial:
            stretch.remove_from(residual)
            stretch.remove_from(jacobian)
        left_out = list(lay.no_torque)
        residual[:, left_out], jacobian[:, left_out] = 0.0, 0.0
        return Evaluation(residual, jacobian, s, q, link)

    def _near(self, x: Array, q: Array, regressor: Array, residual: Array) -> LinkTerms | None:
        """Rigid-body terms of a motion near q (3, N, n), if they are known.

        Their torque is subtracted from `residual` (N, n) exactly, and `regressor` (N, n, 10n) is set.
        """
        inertial = x[self.layout.inertial]
        known = None if self._gravity(x) is not None else self.equation.rigid.near(inertial, q)
        if known is None:
            return None
        regressor[:] = known.regressor
        for rows, parameters in self.equation.bodies(x):
            residual[rows] -= self.equation.link.torque(parameters, *q[:, rows])
        return known.link

    def _gravity(self, x: Array) -> Array | None:
        """Acceleration of gravity (3,) at x; None: that of the model."""
        stated = self.equation.link.gravity
        changed = (EFFECTS[e.effect].gravity(x[where], stated) for e, where in self.layout.effect_slices())
        return next((gravity for gravity in changed if gravity is not None), None)


def require_temperatures(signals: Signals, layout: Layout) -> None:
    """InputError for an effect that needs a temperature which a group does not state."""
    needing = next((e.effect for e in layout.effects if EFFECTS[e.effect].by_temperature), None)
    unknown = next((g.name for g in signals.groups if g.temperature is None), None)
    if needing is not None and unknown is not None:
        raise InputError(
            f'effect "{needing}" needs the temperature of every run, but group "{unknown}" states none: '
            "expected temperature = … [°C] in its [[groups]] entry"
        )


def _without(terms: PlacedTerms, residual: Array) -> Array:
    """The residual less the terms of effects that enter it directly."""
    for _, term in terms:
        if term.entry == "residual":
            residual[:, list(term.joints)] -= term.value[0]
    return residual
