"""Whether recorded signals are those of a robot, and how much of them is noise."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.base.errors import InputError
from flexviz.base.facts import Fact
from flexviz.base.spelling import number
from flexviz.checks.group_noise import GroupNoise, group_noise
from flexviz.checks.set_samples import spoilt_group
from flexviz.data.measurements import Group, MeasurementSet, row_name
from flexviz.robot.robot import Robot

POSES = 5  # at which a joint's inertia is taken
NOISE_ONLY = 0.8  # share of the variance of means from which a torque is nothing but noise
NOTICEABLE = 0.1  # share of the noise in a joint's torque from which it is named
NOISE_TORQUE = 1.0  # torque that it takes to follow the noise of a position over the joint's own,
LEAST_TORQUE = 0.01  # which counts as this share of the largest joint's at least: refused


def check_signals(measurements: MeasurementSet, groups: Sequence[Group] | None = None) -> tuple[float, ...]:
    """Share of the noise in each joint's torque, in the band of an identification; 1: nothing but noise.

    The noise is that of τ, and the torque that it would take to follow the noise of θ, over the spread of τ.

    Args:
        measurements: the set.
        groups: to look at; default: all.

    Raises:
        InputError: positions jump, values were dropped, or the noise of a position or torque leaves no room
            for the motion.
    """
    groups = measurements.groups if groups is None else groups
    found = [group_noise(group, measurements.robot) for group in groups]
    for group in groups:
        _refuse_spoilt(group, measurements.robot)
    if not any(len(one.torque) for one in found):
        return (0.0,) * measurements.n
    pooled = _Pooled.of(groups, found, measurements.robot)
    pooled.refuse_positions()
    pooled.refuse_torques()
    return tuple(pooled.shares().tolist())


def noise_notes(measurements: MeasurementSet) -> list[Fact]:
    """A fact on the joints whose torque is noise in part; raises as `check_signals` does."""
    shares = zip(measurements.joints, check_signals(measurements), strict=True)
    large = {joint: share for joint, share in shares if share > NOTICEABLE}
    return [Fact("noise", "odd", tuple(large), values={"shares": tuple(large.values())})] if large else []


def _refuse_spoilt(group: Group, robot: Robot) -> None:
    """InputError for samples of which nothing can be concluded."""
    if not (issues := spoilt_group(group, robot)):
        return
    first = issues[0]
    column = f"{first.signal}_{first.values['joint']}"
    every = (f"{issue.signal}_{joint}" for issue in issues for joint in issue.joints)
    also = tuple(name for name in every if name != column)
    text = Fact("spoilt-samples", "wrong", columns=also, values={"issue": first}).text
    row = row_name(group.file, first.values["stretches"][0][0] - 1)
    raise InputError(text, file=group.file, place=f"row {row}, column {column}")


@dataclass(frozen=True, eq=False)
class _Pooled:
    """Several groups together, each array of shape (n,).

    Attributes:
        groups, parts: the groups.
        robot: theirs.
        spread: of the torque [Nm].
        size: of the torque [Nm]; of a joint that gravity or its neighbours move, what its motion takes.
        noise: of the torque, and the torque that it takes to follow that of θ, of the links alone [Nm].
        following_sudden: torque that it takes to follow all that changes from sample to sample [Nm].
        noise_only: whether a torque is nothing but noise or spikes.
    """

    groups: Sequence[Group]
    parts: Sequence[GroupNoise]
    robot: Robot
    spread: Array
    size: Array
    noise: Array
    following_sudden: Array
    noise_only: Bools

    @staticmethod
    def of(groups: Sequence[Group], parts: Sequence[GroupNoise], robot: Robot) -> _Pooled:
        weights = [len(one.torque) for one in parts]

        def mean(deviations: list[Array]) -> Array:
            return np.sqrt(np.average(np.square(deviations), axis=0, weights=weights))

        inertia = _inertia(groups, robot)
        spread = np.std(np.concatenate([one.torque for one in parts]), axis=0)
        sudden = mean([one.torque_sudden for one in parts])
        sudden_acceleration = mean([one.acceleration_sudden for one in parts])
        accelerations = np.concatenate([np.zeros((1, robot.n)), *(one.acceleration for one in parts)])
        motion = np.maximum(np.mean(accelerations**2, axis=0) - sudden_acceleration**2, 0.0)
        following = inertia * mean([one.acceleration_noise for one in parts])
        return _Pooled(
            groups, parts, robot, spread,
            size=np.maximum(spread, inertia * np.sqrt(motion)),
            noise=np.hypot(mean([one.torque_noise for one in parts]), following),
            following_sudden=inertia * sudden_acceleration,
            noise_only=(sudden > 0) & (sudden**2 >= NOISE_ONLY * spread**2),
        )  # fmt: skip

    def refuse_positions(self) -> None:
        """InputError for a position whose noise would take more torque to follow than the joint has."""
        most = np.maximum(self.size, LEAST_TORQUE * self.spread.max())
        for j in np.flatnonzero(self.following_sudden > NOISE_TORQUE * most):
            worst = int(np.argmax([one.acceleration_sudden[j] for one in self.parts]))
            unit = "N" if self.robot.prismatic[j] else "Nm"
            raise InputError(
                "the noise of this position is larger than its motion: to follow it below 4 Hz would take "
                f"{number(self.following_sudden[j], 3)} {unit}, and the joint's whole torque varies by "
                f"{number(self.spread[j], 3)} {unit}; expected a measured position",
                file=self.groups[worst].file,
                place=f"column theta_{self.robot.joints[j]}",
            )

    def refuse_torques(self) -> None:
        """InputError if every torque is nothing but noise.

        A single one is possible: of a joint that rests, or that only gravity and its neighbours move.
        """
        if self.noise_only.all():
            raise InputError(
                "every torque is nothing but noise or spikes, expected torques that move the robot",
                file=self.groups[0].file,
                place=f"columns {', '.join(f'tau_{joint}' for joint in self.robot.joints)}",
            )

    def shares(self) -> Array:
        """Of the noise in each torque, at most 1; none in a constant one."""
        share = self.noise / np.maximum(self.size, 1e-300)
        return np.where(self.noise_only, 1.0, np.where(self.spread > 0, np.minimum(share, 1.0), 0.0))


def _inertia(groups: Sequence[Group], robot: Robot) -> Array:
    """The least about each joint, of the CAD model without payload and motors, shape (n,)."""
    n = robot.n
    positions = groups[0].segments[0].theta
    poses = positions[np.linspace(0, len(positions) - 1, POSES).astype(int)]
    none, one = np.zeros((n, n)), np.eye(n)
    least = np.full(n, np.inf)
    with suppress(InputError):  # bodies without mass
        for pose in poses:
            q = np.repeat(pose[None], n, axis=0)
            moved = robot.cad_torques((), q, none, one) - robot.cad_torques((), q, none, none)
            least = np.minimum(least, np.diag(moved))
    return np.where(np.isfinite(least), np.maximum(least, 0.0), 0.0)
