"""The range for which an acceptance holds: what the robot did while it was tested."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.content.wording import listed, number, plural, quantity
from flexviz.data.measurements import Group, MeasurementSet

NOT_PROVED = (
    "Poses, speeds, torques and payloads beyond the range stated above; between its ends, what no held-out "
    "motion passed.",
    "Other robots of this type, and this one after wear, repair, or a change of temperature or oil.",
    "The link side: motor-side data show the torque that a motion needs, not where the flange is.",
    "That the named effects are the cause: an effect that acts alike in these motions has the same error.",
    "Systematic errors of the sensors: a wrong torque constant scales torque and parameters alike.",
)


@dataclass(frozen=True)
class JointRange:
    """What a joint did.

    Attributes:
        low, high: motor angle [rad].
        speed: largest speed [rad/s].
        torque: largest torque [Nm].
    """

    joint: str
    low: float
    high: float
    speed: float
    torque: float

    @property
    def text(self) -> str:
        """ "joint1: -1.20 … 1.30 rad, up to 2.10 rad/s and 40.0 Nm"."""
        angle = f"{number(self.low, 3)} … {number(self.high, 3)} rad"
        return f"{self.joint}: {angle}, up to {number(self.speed, 3)} rad/s and {quantity(self.torque, 'Nm')}"


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
    def text(self) -> str:
        """The scope in one sentence."""
        how = "held out, " if self.held_out else "fitted, not held out, "
        loads = listed([f"{name} ({quantity(mass, 'kg')})" for name, mass in self.payloads.items()])
        gravity = ", ".join(f"{value:g}" for value in self.gravity)
        degrees = " … ".join(f"{value:g}" for value in dict.fromkeys(self.temperatures))
        warm = f", at {degrees} °C" if degrees else ", at temperatures that are not stated"
        return (
            f"Holds for predictions within the recorded range of position, speed, torque and payload: "
            f"{plural(len(self.groups), 'group')} ({how}{self.seconds:.0f} s), "
            f"payload {loads}, gravity [{gravity}] m/s²{warm}."
        )


def acceptance_scope(measurements: MeasurementSet) -> AcceptanceScope:
    """The range of a set's held-out groups; of all groups if none is held out."""
    groups = measurements.validation_groups or measurements.groups
    degrees = np.concatenate([[], *(g.temperature for g in groups if g.temperature is not None)])
    return AcceptanceScope(
        tuple(group.name for group in groups),
        bool(measurements.validation_groups),
        sum(group.duration for group in groups),
        tuple(_ranges(groups, measurements.joints)),
        {group.payload: sum(body.mass for body in group.bodies) for group in groups},
        tuple(map(float, measurements.robot.gravity)),
        (float(degrees.min()), float(degrees.max())) if len(degrees) else (),
    )


def _ranges(groups: Sequence[Group], joints: Sequence[str]) -> Iterator[JointRange]:
    theta, tau = (np.concatenate([group.joined(name) for group in groups]) for name in ("theta", "tau"))
    fastest = [np.abs(s.mean_speeds).max(axis=0) for group in groups for s in group.segments]
    speed = np.max(fastest, axis=0)
    for j, joint in enumerate(joints):
        low, high = float(theta[:, j].min()), float(theta[:, j].max())
        yield JointRange(joint, low, high, float(speed[j]), float(np.abs(tau[:, j]).max()))
