"""Base parameters: the identifiable combinations of a robot's inertial parameters.

Columns of Y that are linearly dependent for every motion cannot be separated (Gautier, Khalil: Direct
calculation of minimum set of inertial parameters of serial robots, IEEE T-RA 6(3), 1990; numerically by QR,
Gautier, J. Robotic Systems 8(4), 1991). Masses are eliminated first, so that a planar arm keeps Izz, mx, my.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array
from flexviz.model.equation import INERTIAL_NAMES, LinkDynamics
from flexviz.robot.robot import Robot

NAMED = 1e-3  # of the largest factor of a base parameter: smaller terms are not in its name
DEPENDENT = 1e-7  # size of a column, and what is left of it, below which it counts as dependent
_PREFERRED = (9, 1, 2, 3, 4, 5, 6, 7, 8, 0)  # izz, mx, my, mz, ixx … iyz, mass


@dataclass(frozen=True)
class BaseParameters:
    """The base parameters β = T Γ.

    Attributes:
        names: one per base parameter, e.g. "izz:joint1 + 1 mass:joint2".
        columns: index in Γ of each leading parameter.
        matrix: T, shape (b, 10n).
    """

    names: tuple[str, ...]
    columns: tuple[int, ...]
    matrix: Array


def base_parameters(robot: Robot, seed: int = 0) -> BaseParameters:
    """Structural base parameters from the regressor at random states."""
    rng = np.random.default_rng(seed)
    n = robot.n
    q, v, a = rng.uniform(-2.5, 2.5, (3, 12 * n + 8, n))
    y = LinkDynamics(robot).regressor(q, v, a).reshape(-1, 10 * n)
    order = [10 * j + k for k in _PREFERRED for j in reversed(range(n))]
    scale = np.maximum(np.linalg.norm(y, axis=0), 1e-300)
    # a column that depends on those before it has nothing left on the diagonal of R
    left = np.abs(np.diag(np.linalg.qr((y / scale)[:, order], mode="r")))
    seen = scale[order] > DEPENDENT * scale.max()
    kept = [
        column for column, independent in zip(order, seen & (left > DEPENDENT), strict=True) if independent
    ]
    matrix: Array = np.linalg.lstsq(y[:, kept], y, rcond=None)[0].astype(float)
    matrix[np.abs(matrix) < DEPENDENT] = 0.0
    names = []
    for row, column in zip(matrix, kept, strict=True):
        terms = [_name(robot, column)]
        for other in np.flatnonzero(np.abs(row) >= NAMED * np.abs(row).max()):
            if other != column:
                sign = "−" if row[other] < 0 else "+"
                terms.append(f"{sign} {abs(row[other]):.4g} {_name(robot, int(other))}")
        names.append(" ".join(terms))
    return BaseParameters(tuple(names), tuple(kept), matrix)


def _name(robot: Robot, column: int) -> str:
    return f"{INERTIAL_NAMES[column % 10]}:{robot.joints[column // 10]}"
