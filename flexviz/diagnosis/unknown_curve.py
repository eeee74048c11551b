"""An unknown law of one joint, eliminated from a fit as a free curve.

A friction patch or a cogging torque that no effect describes pulls the parameters of all others. A curve of
the joint's position, of its position times the direction of motion, or of its velocity takes its place:
piecewise linear, its coefficients eliminated in closed form under a weak prior, so that everything else is
estimated beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import JointMotion, smooth_sign
from flexviz.equation import OperatingPoint, Signals

Array = NDArray[np.float64]
Variable = Literal["position", "position × direction", "position, each direction", "velocity"]

VARIABLES: tuple[Variable, ...] = (
    "position × direction",
    "position",
    "velocity",
    "position, each direction",
)
PIECES = 24
SPREAD = 0.1  # prior standard deviation of the curve, relative to the spread of the joint's torque


@dataclass(frozen=True)
class UnknownCurve:
    """A free curve of one joint.

    Attributes:
        joint: index in the set's joint order.
        variable: what it depends on.
        low, high: range of the variable; the curve is constant beyond.
        size: prior standard deviation [Nm].
    """

    joint: int
    variable: Variable
    low: float
    high: float
    size: float

    def columns(self, point: OperatingPoint) -> Array:
        """Response of the joint's residual to every piece, shape (N, pieces)."""
        context = point.context

        def make() -> Array:
            parts = [self._pieces(motion) for motion in context.motions(self.joint)]
            return -context.filtered(parts, self.joint, 1)[:, 0].T

        return context.once(("unknown curve", self), make)

    def _pieces(self, motion: JointMotion) -> Array:
        """Hat functions along a motion, shape (pieces, N_fine)."""
        value = motion.velocity if self.variable == "velocity" else motion.position
        place = (value - self.low) / max(self.high - self.low, 1e-9) * (PIECES - 1)
        hats = np.maximum(1 - np.abs(np.clip(place, 0, PIECES - 1)[None] - np.arange(PIECES)[:, None]), 0.0)
        sign = smooth_sign(motion.velocity)
        if self.variable == "position, each direction":
            return np.concatenate((hats * 0.5 * (1 + sign), hats * 0.5 * (1 - sign)))
        return hats * sign if self.variable == "position × direction" else hats


@dataclass(frozen=True, eq=False)
class Eliminated:
    """Map from a joint's residual or Jacobian y to the coefficients of its curve, solve @ y.

    Attributes:
        curve: the curve.
        columns: shape (N, pieces), response of the residual.
        solve: shape (pieces, N).
    """

    curve: UnknownCurve
    columns: Array
    solve: Array

    def remove(self, values: Array) -> Array:
        """Residual (N, n) or Jacobian (N, n, P) without what the curve explains."""
        out = values.copy()
        out[:, self.curve.joint] -= self.columns @ (self.solve @ values[:, self.curve.joint])
        return out

    def remove_elsewhere(self, values: Array, fitted: Array, point: OperatingPoint) -> Array:
        """The same for other groups, with the coefficients of the fit groups' values."""
        out = values.copy()
        out[:, self.curve.joint] -= self.curve.columns(point) @ (self.solve @ fitted[:, self.curve.joint])
        return out


def curve_over(
    parts: Sequence[Signals], joint: int, variable: Variable, torque_spread: float
) -> UnknownCurve:
    """A free curve over the range of some signals; `torque_spread` is that of the joint's torque [Nm]."""
    row = 1 if variable == "velocity" else 0
    values = np.concatenate([signals.theta[row, :, joint] for signals in parts])
    return UnknownCurve(joint, variable, float(values.min()), float(values.max()), SPREAD * torque_spread)


def eliminated(curve: UnknownCurve, point: OperatingPoint, weights: Array) -> Eliminated:
    """The curve fitted under its prior to a residual with weights (N,) [1/Nm]."""
    columns = curve.columns(point)
    weighted = columns * weights[:, None]
    precision = weighted.T @ weighted + np.eye(columns.shape[1]) / curve.size**2
    solve = np.linalg.solve(precision, weighted.T * weights).astype(np.float64)
    return Eliminated(curve, columns, solve)


def explained_gain(curve: UnknownCurve, gram: Array, along: Array) -> float:
    """Decrease of the weighted sum of squares by the curve under its prior."""
    return float(along @ np.linalg.solve(gram + np.eye(len(along)) / curve.size**2, along))
