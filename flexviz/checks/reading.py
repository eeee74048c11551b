"""How columns are read, against what the mapping says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.robot.robot import PayloadBody, Robot


@dataclass(frozen=True, eq=False)
class Reading:
    """θ = (θ_read[order]) · factor + zero; τ = τ_read[order] · sign · size, `late` seconds later.

    Attributes:
        factor: (groups, n) of θ.
        zero: (groups, n) [rad], [m].
        sign: (n,) of τ.
        size: (groups, n) of τ.
        late: (n,) [s] by which τ is stamped late.
        drifts: (n,) whether the zero of τ drifts.
        free: (n,) whether the size of τ is unknown.
        theta_order, tau_order: joint -> column.
        down: [m/s²] gravity in the base's frame.
        gravity, load, motion: whether τ has the torque of the robot's gravity, the payload's, the motion.
        magnitude: whether τ lost its sign: it has that of the robot's masses.
        bodies: of each group, the payload that it carried.
        added: (groups,) [kg] what it carried besides, see `Comparison.kilogram`.
        drive: (n, n) joint angles = drive · motor angles, where τ is the motors'.
        theta_too: whether θ is the motors', too.
        converted: whether τ was converted to the joints already: only friction is the motors'.
    """

    factor: Array
    zero: Array
    sign: Array
    size: Array
    late: Array
    drifts: Bools
    free: Bools
    theta_order: tuple[int, ...]
    tau_order: tuple[int, ...]
    down: tuple[float, float, float]
    bodies: tuple[tuple[PayloadBody, ...], ...]
    added: Array
    gravity: bool = True
    load: bool = True
    motion: bool = True
    magnitude: bool = False
    drive: Array | None = None
    theta_too: bool = False
    converted: bool = False

    @staticmethod
    def stated(robot: Robot, bodies: Sequence[Sequence[PayloadBody]]) -> Reading:
        """The columns, the mounting and the groups' payloads as the mapping states them."""
        n, order, ones = robot.n, tuple(range(robot.n)), np.ones(robot.n)
        zero, same = np.zeros((len(bodies), n)), np.ones((len(bodies), n))
        late, never = np.zeros(n), np.zeros(n, bool)
        carried = tuple(map(tuple, bodies))
        added = np.zeros(len(bodies))
        return Reading(
            same, zero, ones, same, late, never, never, order, order, robot.gravity, carried, added
        )
