"""What a compensation removed: friction identified without and with it, by joint and speed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flexviz.base.arrays import Array
from flexviz.base.errors import InputError
from flexviz.base.units import joint_unit
from flexviz.content.wording import number, percent, quantity
from flexviz.data.measurements import MeasurementSet
from flexviz.model.compensation import sliding_friction
from flexviz.robot.model import FlexibleModel

RANGES = 5  # of speed, with equally many samples each


@dataclass(frozen=True)
class SpeedRange:
    """Friction at the speeds from `low` to `high` [rad/s], of both directions.

    Attributes:
        before, after: rms friction torque without and with compensation [Nm].
    """

    low: float
    high: float
    before: float
    after: float
    slides: bool = False  # of a joint that slides: m/s and N

    @property
    def removed(self) -> float:
        """Share of the rms friction torque that is gone; negative where there is more."""
        return removed(self.before, self.after)

    @property
    def text(self) -> str:
        """ "0.10 … 0.32 rad/s"."""
        return f"{number(self.low, 2)} … {number(self.high, 2)} {joint_unit('rad/s', self.slides)}"


@dataclass(frozen=True)
class ComparedFriction:
    """One joint: rms friction torque over the motion of the first set [Nm], and by speed."""

    joint: str
    before: float
    after: float
    speeds: tuple[SpeedRange, ...]
    slides: bool = False  # N

    @property
    def removed(self) -> float:
        """Share of the rms friction torque that is gone."""
        return removed(self.before, self.after)

    @property
    def text(self) -> str:
        """ "joint1: 92 % of the friction torque removed, 2.10 Nm to 0.160 Nm"."""
        unit = joint_unit("Nm", self.slides)
        fall = f"{quantity(self.before, unit)} to {quantity(self.after, unit)}"
        return f"{self.joint}: {percent(self.removed)} of the friction torque removed, {fall}"


def removed(before: float, after: float) -> float:
    """Share of a friction torque that is gone."""
    return 1.0 - after / before if before > 0 else 0.0


def compare_friction(
    measurements: MeasurementSet, before: FlexibleModel, after: FlexibleModel
) -> tuple[ComparedFriction, ...]:
    """Friction of two identified models along the recorded motion of the first set.

    Both frictions are evaluated at the same speeds and loads, so that the two recordings may move
    differently. The load is the recorded torque.

    Args:
        measurements: the set without compensation.
        before, after: models identified without and with it; the second set's torque is what the controller
            commands without the compensation.

    Raises:
        InputError: the models have other joints.
    """
    if before.joints != after.joints:
        text = f"the sets have the joints {', '.join(before.joints)} and {', '.join(after.joints)}"
        raise InputError(f"{text}, expected the same robot")
    return tuple(_joints(measurements, before, after))


def _joints(
    measurements: MeasurementSet, before: FlexibleModel, after: FlexibleModel
) -> Iterator[ComparedFriction]:
    segments = [s for group in measurements.groups for s in group.segments]
    speeds = [s.mean_speeds for s in segments]
    middles = [(len(s) - len(v)) // 2 for s, v in zip(segments, speeds, strict=True)]
    loads = [s.tau[m : len(s) - m] for s, m in zip(segments, middles, strict=True)]
    speed, load = np.concatenate(speeds), np.concatenate(loads)
    for j, joint in enumerate(before.joints):
        v, s, slides = speed[:, j], load[:, j], bool(measurements.robot.prismatic[j])
        old, new = (sliding_friction(model, j, v, s) for model in (before, after))
        edges = np.quantile(np.abs(v), np.linspace(0, 1, RANGES + 1))
        of = np.clip(np.searchsorted(edges, np.abs(v), side="right") - 1, 0, RANGES - 1)
        ranges = tuple(
            SpeedRange(float(edges[k]), float(edges[k + 1]), _rms(old[of == k]), _rms(new[of == k]), slides)
            for k in range(RANGES)
            if np.any(of == k)
        )
        yield ComparedFriction(joint, _rms(old), _rms(new), ranges, slides)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
