"""A robot's tree as plain tables: what generated code needs to move it without a library.

Bodies are in Pinocchio's order, parents first. Body b hangs on its parent by

    rotation     A + B sin q + C cos q        (3, 3), own frame → parent's; B = C = 0 where the joint slides
    translation  p + r q                      (3,) in the parent's frame [m]; r = 0 where the joint turns
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.errors import InputError
from flexviz.robot import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Tree:
    """The tables of n bodies.

    Attributes
    ----------
    joint: (n,) index of body b's joint in the set's order.
    parent: (n,) index of the body it hangs on, −1 for the base.
    still, sine, cosine: (n, 3, 3) A, B, C.
    place, slide: (n, 3) p [m], r [-].
    turn, push: (n, 3) the joint's axis in body b's frame: one of the two is zero.
    """

    joint: tuple[int, ...]
    parent: tuple[int, ...]
    still: Array
    sine: Array
    cosine: Array
    place: Array
    slide: Array
    turn: Array
    push: Array

    @property
    def n(self) -> int:
        """Number of bodies, and of joints."""
        return len(self.joint)


def tree(robot: Robot) -> Tree:
    """The tables of a robot whose joints turn about or slide along one axis each."""
    n = robot.n
    at = {int(robot.order[i]): i for i in range(n)}  # Pinocchio's index -> the set's
    still, sine, cosine = (np.zeros((n, 3, 3)) for _ in range(3))
    place, slide, turn, push = (np.zeros((n, 3)) for _ in range(4))
    for b in range(n):
        linear, angular = axis(robot, b)
        placement = robot.model.jointPlacements[1 + b]
        rotation = np.array(placement.rotation)
        place[b], turn[b], push[b] = placement.translation, angular, linear
        if angular.any():
            along = np.outer(angular, angular)
            still[b], cosine[b] = rotation @ along, rotation @ (np.eye(3) - along)
            sine[b] = rotation @ skew(angular)
        else:
            still[b], slide[b] = rotation, rotation @ linear
    parents = tuple(int(robot.model.parents[1 + b]) - 1 for b in range(n))
    return Tree(tuple(at[b] for b in range(n)), parents, still, sine, cosine, place, slide, turn, push)


def axis(robot: Robot, b: int) -> tuple[Array, Array]:
    """Unit vectors (3,) that Pinocchio's joint b slides along and turns about; one of them is zero."""
    joint = robot.model.joints[1 + b]
    data = joint.createData()
    joint.calc(data, np.zeros(1))
    s = np.array(data.S, dtype=float).reshape(6)
    linear, angular = s[:3], s[3:]
    if bool(linear.any()) == bool(angular.any()):
        name = robot.model.names[1 + b]
        raise InputError(f'joint "{name}" neither turns about nor slides along one axis: it is not exported')
    return linear, angular


def skew(v: Sequence[float] | Array) -> Array:
    """(3, 3) matrix of the cross product v × ·"""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
