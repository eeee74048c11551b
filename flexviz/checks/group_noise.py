"""What the signals of one group are made of: motion, noise, and what changes suddenly."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from flexviz.base.arrays import Array
from flexviz.data.measurements import Group
from flexviz.data.noise import sudden_noise, white_noise
from flexviz.robot.robot import Robot

PERIOD = 0.1  # [s] means over it keep what is below 4 Hz, the narrowest band of an identification


@dataclass(frozen=True, eq=False)
class GroupNoise:
    """One group in means over a `period`, which keep what is slower than about 4 Hz.

    White noise of σ is σ/√m in means of m samples, and √6 times that in their second differences.

    Attributes:
        torque: shape (B, n), τ [Nm].
        acceleration: shape (A, n), second differences of θ [rad/s²].
        torque_noise, acceleration_noise: shape (n,), standard deviation of the noise in both.
        torque_sudden, acceleration_sudden: the same if all counts that changes from sample to sample, spikes
            and steps too.
    """

    torque: Array
    acceleration: Array
    torque_noise: Array
    acceleration_noise: Array
    torque_sudden: Array
    acceleration_sudden: Array


_KNOWN: WeakKeyDictionary[Group, GroupNoise] = WeakKeyDictionary()


def group_noise(group: Group, robot: Robot) -> GroupNoise:
    """What a group is made of, found once."""
    if (known := _KNOWN.get(group)) is None:
        known = _KNOWN[group] = _group_noise(group, robot)
    return known


def _group_noise(group: Group, robot: Robot) -> GroupNoise:
    none = np.zeros((0, robot.n))
    torque, acceleration, variances, count = [none], [none], np.zeros((4, robot.n)), 0
    for segment in group.segments:
        samples = max(1, round(PERIOD / segment.step))
        blocks = len(segment) // samples
        if not blocks:
            continue
        tau, theta = (
            y[: blocks * samples].reshape(blocks, samples, -1).mean(axis=1)
            for y in (segment.tau, segment.theta)
        )
        per_second = np.sqrt(6) / (samples * segment.step) ** 2
        torque.append(tau)
        acceleration.append(np.diff(theta, 2, axis=0) / (samples * segment.step) ** 2)
        found = np.array(
            [
                white_noise(segment.tau),
                per_second * white_noise(segment.theta),
                sudden_noise(segment.tau),
                per_second * sudden_noise(segment.theta),
            ]
        )
        variances += blocks / samples * found**2
        count += blocks
    deviations = np.sqrt(variances / max(count, 1))
    return GroupNoise(np.concatenate(torque), np.concatenate(acceleration), *deviations)
