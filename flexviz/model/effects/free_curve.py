"""Free curves: a smooth torque of one variable of a joint, for what no law of the library explains.

Not physics: a free curve is never a candidate of the diagnosis. It is added only where the user asks for it.
The curve is a natural cubic spline through values at equally spaced nodes, so that its parameters are torques
that can be read off, and it is constant beyond the range of the data. A prior keeps it small and smooth where
the data do not show it, and leaves to the physical parameters what they can explain.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from math import log10, tanh
from typing import Any, ClassVar

import numpy as np

from flexviz.base._scipy import sp
from flexviz.model.effects.law import LawEffect, LoadedEffect
from flexviz.model.effects.terms import (
    SIGN_VELOCITY,
    Array,
    JointMotion,
    JointState,
    ParameterSpec,
    smooth_sign,
)

NODES = 24  # of each curve
SIZE = 0.1  # prior standard deviation of a node, relative to the rms torque of the joint
BEND = 0.05  # likewise of the second difference of neighbouring nodes
GRID = 20.0  # the range is rounded outwards to a power of ten divided by this
CONSTANTS = 2  # leading parameters: lower and upper end
DIRECTIONS = ("forward", "backward")


@cache
def _splines() -> Any:
    """The natural splines that are one at one node and zero at the others."""
    return sp.interpolate.CubicSpline(np.arange(NODES), np.eye(NODES), bc_type="natural")


def _cardinal(place: Array, order: int) -> Array:
    """These splines, or their first or second derivatives, at N places 0 … NODES − 1, shape (N, NODES)."""
    out: Array = _splines()(place, order)
    return out


class FreeCurveEffect(LawEffect):
    """A smooth torque of one variable, one curve or one per direction of motion.

    Attributes:
        variable: "position", "velocity", "load" or "time".
        unit: of the variable.
        each_way: one curve per direction of motion.
        opposes: the curve changes its sign with the direction of motion.
    """

    where = "motor"
    linear = True
    stopgap = True
    signature = "Whatever is left of the residual against this variable."
    confirm = "Nothing: it describes the recorded motion only. Look for the law behind the curve."
    reference = (
        "Eilers, Marx: Flexible smoothing with B-splines and penalties, Statistical Science 11(2), 1996"
    )
    variable: ClassVar[str]
    unit: ClassVar[str]
    each_way: ClassVar[bool] = False
    opposes: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        sides = [f"{way}_" for way in DIRECTIONS] if cls.each_way else ["value_"]
        cls.smooth = not (cls.each_way or cls.opposes)
        cls.size_at = tuple(range(CONSTANTS, CONSTANTS + NODES * len(sides)))
        cls.parameters = (
            ParameterSpec("low", cls.unit, explanation="lower end of the range", given=True),
            ParameterSpec("high", cls.unit, explanation="upper end of the range", given=True),
            *(
                ParameterSpec(f"{side}{k + 1}", "Nm", explanation=f"torque at node {k + 1} of {NODES}")
                for side in sides
                for k in range(NODES)
            ),
        )
        node: Array = np.linspace(-1, 1, NODES)
        bump = 5.0 * np.exp(-4 * node**2)
        ends = (0.0 if cls.variable in ("velocity", "time") else -1.0, 1.0)
        cls.example = (*ends, *bump.tolist(), *([] if len(sides) == 1 else (-0.5 * bump).tolist()))

    @property
    def sides(self) -> int:
        """Number of curves: 1, or one per direction of motion."""
        return 2 if self.each_way or self.opposes else 1

    # -- the law

    def value(self, motion: JointMotion) -> Array:
        """The variable along a motion, shape (N,)."""
        if self.where == "link" and self.variable in ("position", "velocity"):
            return getattr(motion, f"link_{self.variable}")
        return getattr(motion, {"load": "torque"}.get(self.variable, self.variable))

    def law(self, motion: JointMotion, values: Array) -> tuple[Array, Array]:
        velocity = motion.link_velocity if self.where == "link" else motion.velocity
        slopes = np.zeros((len(values), len(motion.time)))
        slopes[CONSTANTS:] = self.design(self.value(motion), velocity, values).T
        return values[CONSTANTS:] @ slopes[CONSTANTS:], slopes

    def design(self, value: Array, velocity: Array, values: Array, order: int = 0) -> Array:
        """∂u/∂(node) at M instants, or its derivative by the place in nodes, shape (M, sides · nodes)."""
        place = self.place(value, values)
        one = _cardinal(place, order)
        if order:
            one = one * ((place > 0) & (place < NODES - 1))[:, None]
        if self.opposes:
            return one * smooth_sign(velocity)[:, None]
        if self.sides == 1:
            return one
        forward = 0.5 * (1 + smooth_sign(velocity))[:, None]
        return np.hstack((one * forward, one * (1 - forward)))

    def place(self, value: Array, values: Array) -> Array:
        """Place of the variable in nodes from the lower end, clipped to the range."""
        low, high = values[:CONSTANTS]
        return np.clip((value - low) / max(high - low, 1e-9), 0.0, 1.0) * (NODES - 1)

    def simulation(self, values: Array) -> Callable[[JointState], float]:
        at, tables = self.fine(np.asarray(values, float))

        def torque(now: JointState) -> float:
            velocity = now.q_velocity if self.where == "link" else now.theta_velocity
            sign = tanh(velocity / SIGN_VELOCITY)
            here = [float(np.interp(self.value_at(now), at, table)) for table in tables]
            return here[0] if len(here) == 1 else 0.5 * ((1 + sign) * here[0] + (1 - sign) * here[1])

        return torque

    def value_at(self, now: JointState) -> float:
        """The variable at one instant."""
        link = self.where == "link"
        if self.variable == "position":
            return now.q if link else now.theta
        if self.variable == "velocity":
            return abs(now.q_velocity if link else now.theta_velocity)
        return now.load if self.variable == "load" else now.time

    def node_places(self, values: Array) -> Array:
        """The variable at the nodes, shape (NODES,)."""
        return np.linspace(values[0], values[1], NODES)

    def node_values(self, values: Array) -> Array:
        """The torque at the nodes, shape (sides, NODES) [Nm]."""
        own = np.reshape(values[CONSTANTS:], (len(self.branches), NODES))
        return np.concatenate((own, -own)) if self.opposes else own

    @property
    def node_parameters(self) -> tuple[tuple[ParameterSpec, ...], ...]:
        """The parameters of the nodes, one tuple per side."""
        own = tuple(tuple(self.parameters[k] for k in branch) for branch in self.branches)
        return own * (self.sides // len(own))

    @property
    def branches(self) -> tuple[tuple[int, ...], ...]:
        """Places of the nodes among the parameters, one tuple per curve that is estimated."""
        own = range(CONSTANTS, len(self.parameters))
        return tuple(tuple(own[k : k + NODES]) for k in range(0, len(own), NODES))

    def fine(self, values: Array, per_node: int = 20) -> tuple[Array, Array]:
        """The variable, shape (M,), and the torque there, shape (sides, M) [Nm], for tables and plots."""
        place: Array = np.linspace(0, NODES - 1, per_node * (NODES - 1) + 1)
        at: Array = values[0] + (values[1] - values[0]) * place / (NODES - 1)
        return at, (_cardinal(place, 0) @ self.node_values(values).T).T

    # -- range and prior

    def constants(self, reach: Mapping[str, tuple[float, float]]) -> Array:
        """The range of the data, rounded outwards."""
        low, high = reach[self.variable]
        step = 10 ** np.floor(log10(max(high - low, 1e-6))) / GRID
        return np.array([np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9)]) * step

    def precision(self, torque: float) -> Array:
        bend: Array = np.diff(np.eye(NODES), 2, axis=0) / (BEND * torque)
        own = np.eye(NODES) / (SIZE * torque) ** 2 + bend.T @ bend
        out = np.zeros((len(self.parameters), len(self.parameters)))
        out[CONSTANTS:, CONSTANTS:] = np.kron(np.eye(len(self.branches)), own)
        return out


class FreePositionCurve(FreeCurveEffect):
    name = "free_curve_position"
    title = "Free curve of position (not physics)"
    explanation = "A torque that depends on the position only, of any form: not physics."
    equation = "u = c(θ), a smooth curve"
    variable, unit = "position", "rad"


class FreeDirectionCurve(FreeCurveEffect):
    name = "free_curve_direction"
    title = "Free curve of position in each direction (not physics)"
    explanation = "A torque that depends on position and direction, of any form: not physics."
    equation = "u = c₊(θ) for θ̇ > 0, c₋(θ) for θ̇ < 0, smooth curves"
    variable, unit, each_way = "position", "rad", True


class FreeFrictionCurve(FreeCurveEffect):
    name = "free_curve_friction"
    title = "Free curve of friction by position (not physics)"
    explanation = "A torque against the motion that depends on the position, of any form: not physics."
    equation = "u = c(θ) sign(θ̇), c a smooth curve"
    variable, unit, opposes = "position", "rad", True


class FreeVelocityCurve(FreeCurveEffect):
    name = "free_curve_velocity"
    title = "Free curve of velocity (not physics)"
    explanation = "A torque that depends on the velocity only, of any form: not physics."
    equation = "u = c₊(|θ̇|) for θ̇ > 0, c₋(|θ̇|) for θ̇ < 0, smooth curves"
    variable, unit, each_way = "velocity", "rad/s", True

    def place(self, value: Array, values: Array) -> Array:
        return super().place(np.abs(value), values)

    def constants(self, reach: Mapping[str, tuple[float, float]]) -> Array:
        fastest = max(map(abs, reach["velocity"]))
        return super().constants({"velocity": (0.0, fastest)})


class FreeLoadCurve(FreeCurveEffect, LoadedEffect):
    name = "free_curve_load"
    title = "Free curve of load (not physics)"
    explanation = "A torque that depends on the transmitted torque only, of any form: not physics."
    equation = "u = c(τ_j), a smooth curve"
    variable, unit = "load", "Nm"
    state = True

    def torque_slope(self, motion: JointMotion, values: Array) -> Array:
        step = max(values[1] - values[0], 1e-9) / (NODES - 1)
        slope = self.design(motion.torque, motion.velocity, values, 1) @ values[CONSTANTS:] / step
        return slope / np.maximum(1 + slope, 0.1) if self.where == "motor" else slope


class FreeTimeCurve(FreeCurveEffect):
    name = "free_curve_time"
    title = "Free curve of time (not physics)"
    explanation = "A torque that depends on the time since a run began, of any form: not physics."
    equation = "u = c(t), a smooth curve, t the group's own time"
    variable, unit = "time", "s"


def _on_link(curve: type[FreeCurveEffect]) -> FreeCurveEffect:
    """The same curve as a torque on the link."""
    texts = {
        "name": curve.name.replace("curve", "link_curve"),
        "title": curve.title.replace(" (", " on the link ("),
        "explanation": curve.explanation.replace("torque", "torque on the link", 1),
        "where": "link",
        "state": True,
    }
    return type(f"Link{curve.__name__}", (curve,), texts)()


KINDS = (FreePositionCurve, FreeDirectionCurve, FreeVelocityCurve, FreeLoadCurve, FreeTimeCurve)
CURVES: tuple[FreeCurveEffect, ...] = (*(kind() for kind in KINDS), *map(_on_link, KINDS))
# only a search for many effects tries them, in place of an unknown law
STAND_INS = (FreeFrictionCurve(), _on_link(FreeFrictionCurve))
_BY_NAME = {curve.name: curve for curve in (*CURVES, *STAND_INS)}


def free_curve(effect: str) -> FreeCurveEffect | None:
    """The free curve of a name, text (`name:joint`) or parameter (`name.high`); None for an effect."""
    return _BY_NAME.get(effect.partition(":")[0].partition(".")[0])
