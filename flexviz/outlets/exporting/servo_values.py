"""The identified values of joints that follow goals, by their names in `flexviz.model.servo`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexviz.base.statistics import NORMAL_95
from flexviz.model.servo import ABSENT, INDEX, LOG, NAMES, servo_values
from flexviz.outlets.exporting.identified import IdentifiedRobot

OFFSET = "torque_offset.offset"


@dataclass(frozen=True, eq=False)
class ServoJoint:
    """One joint.

    Attributes:
        values: parameter -> value in SI units, of all that it has.
        intervals: parameter -> 95 % interval; None where the data do not determine it.
    """

    name: str
    values: dict[str, float]
    intervals: dict[str, tuple[float, float] | None]

    def get(self, parameter: str) -> float:
        """A value; 0 without it."""
        return self.values.get(parameter, 0.0)

    def has(self, effect: str) -> bool:
        """Whether it has an effect."""
        return any(name.startswith(f"{effect}.") for name in self.values)


def servo_joints(identified: IdentifiedRobot) -> list[ServoJoint]:
    """All joints of a robot."""
    found = servo_values(identified.model)
    return [_joint(identified, joint, found[:, j]) for j, joint in enumerate(identified.joints)]


def _joint(identified: IdentifiedRobot, joint: str, found: np.ndarray) -> ServoJoint:
    values = {name: float(found[k]) for name, k in INDEX.items() if "." not in name or found[k] != ABSENT[k]}
    gain = values["gain"]
    if OFFSET in values:
        values[OFFSET] *= gain  # a parameter of the fit is the angle by which the goal differs
    return ServoJoint(
        joint, values, {name: _interval(identified, joint, name, values[name]) for name in values}
    )


def _interval(identified: IdentifiedRobot, joint: str, name: str, value: float) -> tuple[float, float] | None:
    """Of a parameter that is positive: symmetric in its logarithm if it was fitted as that."""
    label = "position_control.gain" if name == "gain" else name
    if all((p.name, p.joint) != (label, joint) for p in identified.document.all_parameters):
        return None
    found = identified.document[label, joint]
    std = found.std
    if std is None or not np.isfinite(std) or found.identifiable == "no":
        return None
    if LOG[NAMES.index(name)] and value > 0.0:
        factor = float(np.exp(NORMAL_95 * std / value))
        return value / factor, value * factor
    low = value - NORMAL_95 * std
    return max(low, 0.0) if value >= 0.0 else low, value + NORMAL_95 * std
