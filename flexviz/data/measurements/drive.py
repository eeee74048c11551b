"""What drives the joints of a set whose table has goals instead of torques."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flexviz.base.errors import InputError
from flexviz.data.measurements.data import Array, Group
from flexviz.data.measurements.schema import DriveTable

FARTHEST = 1.0  # [rad] that a joint, in the median, may be from its goal; more can only be another unit
LEAST_GOALS = 3  # different goals of a joint without which nothing can be learned from it


@dataclass(frozen=True)
class Drive:
    """Servos that follow goals.

    Attributes:
        kp: (n,) stated gains [Nm/rad]; None: they are estimated.
        same: joints, by name, that have the same servo.
    """

    kp: tuple[float, ...] | None = None
    same: tuple[tuple[str, ...], ...] = ()

    @staticmethod
    def of(table: DriveTable | None, n: int) -> Drive | None:
        """As a set states it."""
        if table is None:
            return None
        kp = None if table.kp is None else tuple(table.kp) * (n if len(table.kp) == 1 else 1)
        return Drive(kp, tuple(map(tuple, table.same)))

    def document(self) -> dict[str, Any]:
        """As the set's file has it."""
        kp = {} if self.kp is None else {"kp": list(self.kp)}
        return {"from": "goal", **kp, **({"same": [list(one) for one in self.same]} if self.same else {})}


def check_goals(goals: Array, theta: Array, joints: Sequence[str], file: Path) -> None:
    """InputError for goals (N, n) [rad] that no servo can have followed to θ (N, n)."""
    for j, joint in enumerate(joints):
        column, position = goals[:, j], theta[:, j]
        place = f"theta_ref_{joint}"
        away = float(np.median(np.abs(column - position)))
        if away <= FARTHEST:
            continue
        ratio = float(np.ptp(column) / max(np.ptp(position), 1e-9))
        meant = "in degrees? divide by 57.3" if 30 < ratio < 110 else "in the unit of theta, from its zero?"
        message = f"the goal is {away:.3g} rad away from theta_{joint}, in the median: is it {meant}"
        raise InputError(f"{message}; expected the goal of theta_{joint} [rad]", file=file, place=place)


def check_changes(groups: Sequence[Group], joints: Sequence[str]) -> None:
    """InputError for a joint whose goal does not change in any group."""
    for j, joint in enumerate(joints):
        goals = [group.theta_ref[:, j] for group in groups if group.theta_ref is not None]
        if all(len(np.unique(one)) < LEAST_GOALS for one in goals):
            raise InputError(
                "the goal does not change, expected the positions that were sent to the joint's servo; a "
                "joint that does not move can be left out of joints",
                file=groups[0].file,
                place=f"theta_ref_{joint}",
            )
