"""The range for which an acceptance holds: what the robot did while it was tested."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.base.facts import Fact
from flexviz.data.measurements import Group, MeasurementSet

NOT_PROVED = tuple(
    Fact("not-proved", values={"what": what}) for what in ("range", "robots", "link-side", "cause", "sensors")
)


@dataclass(frozen=True)
class JointRange:
    """What a joint did.

    Attributes:
        low, high: motor angle [rad].
        speed: largest speed [rad/s].
        torque: largest torque, or by how much its goal was ahead.
        slides: whether it slides: m and N.
        of: unit of `torque`.
    """

    joint: str
    low: float
    high: float
    speed: float
    torque: float
    slides: bool = False
    of: str = "Nm"

    @property
    def fact(self) -> Fact:
        """The same for a text."""
        names = ("low", "high", "speed", "torque", "slides", "of")
        values = {name: getattr(self, name) for name in names}
        return Fact("joint-range", joints=(self.joint,), values=values)


@dataclass(frozen=True)
class AcceptanceScope:
    """The range in which a prediction was tested.

    Attributes:
        groups: the held-out groups, else the fitted ones.
        held_out: whether they were held out.
        seconds: their length.
        joints: what every joint did in them.
        payloads: name → mass [kg].
        gravity: (3,) in the base's frame [m/s²].
        temperatures: lowest and highest stated one [°C]; empty if none is.
    """

    groups: tuple[str, ...]
    held_out: bool
    seconds: float
    joints: tuple[JointRange, ...]
    payloads: dict[str, float]
    gravity: tuple[float, ...]
    temperatures: tuple[float, ...]

    @property
    def fact(self) -> Fact:
        """The scope without its joints, for a text."""
        values = {
            "held_out": self.held_out,
            "seconds": self.seconds,
            "payloads": tuple(self.payloads.items()),
            "gravity": self.gravity,
            "temperatures": self.temperatures,
        }
        return Fact("acceptance-scope", groups=self.groups, values=values)

    @property
    def text(self) -> str:
        """The scope in one sentence."""
        return self.fact.text


def acceptance_scope(measurements: MeasurementSet) -> AcceptanceScope:
    """The range of a set's held-out groups; of all groups if none is held out."""
    groups = measurements.validation_groups or measurements.groups
    degrees = np.concatenate([[], *(g.temperature for g in groups if g.temperature is not None)])
    return AcceptanceScope(
        tuple(group.name for group in groups),
        bool(measurements.validation_groups),
        sum(group.duration for group in groups),
        tuple(_ranges(groups, measurements)),
        {group.payload: sum(body.mass for body in group.bodies) for group in groups},
        tuple(map(float, measurements.robot.gravity)),
        (float(degrees.min()), float(degrees.max())) if len(degrees) else (),
    )


def _ranges(groups: Sequence[Group], measurements: MeasurementSet) -> Iterator[JointRange]:
    slides, units = measurements.robot.prismatic, measurements.torque_units
    theta, tau = (np.concatenate([group.joined(name) for group in groups]) for name in ("theta", "tau"))
    fastest = [np.abs(s.mean_speeds).max(axis=0) for group in groups for s in group.segments]
    speed = np.max(fastest, axis=0)
    for j, joint in enumerate(measurements.joints):
        low, high = float(theta[:, j].min()), float(theta[:, j].max())
        most = float(np.abs(tau[:, j]).max())
        unit = units[j] if units else "Nm"
        yield JointRange(joint, low, high, float(speed[j]), most, bool(slides[j]), unit)
