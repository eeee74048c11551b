"""How far the free motion of a model is from the measured one: what is stated of every model [rad]."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexviz.analysis.estimation import PredictionErrors
from flexviz.base.arrays import Array
from flexviz.content.records import GroupError
from flexviz.data.measurements import MeasurementSet
from flexviz.data.noise import segments_noise
from flexviz.model.servo import DrivenMotion, driven_motion, free_motion


@dataclass(frozen=True, eq=False)
class FreeRun:
    """The free motion of one group over time: time (N,) [s]; theta, error, torque (N, n) [rad], [Nm]."""

    time: Array
    theta: Array
    error: Array


class TrajectoryJudge:
    """Simulates each group from its goals alone, from the first sample to the last without a restart.

    What the joints do to each other comes from their measured motion. The first second does not count: it
    shows how the motion began.
    """

    def __init__(self, measurements: MeasurementSet, motion: DrivenMotion | None = None) -> None:
        self.measurements = measurements
        self.motion = motion or driven_motion(measurements.robot, measurements.groups, whole=True)

    def refreshed(self, values: Array) -> TrajectoryJudge:
        """One that takes fast motion of the other joints from the free motion of a model, (P, n)."""
        theta = free_motion(self.motion, values[:, None])[0]
        read = self.measurements
        return TrajectoryJudge(read, driven_motion(read.robot, read.groups, theta, whole=True))

    @cached_property
    def noise(self) -> tuple[float, ...]:
        """Deviation of the measured angles (n,) [rad]."""
        segments = [s for g in self.measurements.groups for s in g.segments]
        return tuple(map(float, segments_noise(segments)[0]))

    @cached_property
    def spread(self) -> tuple[float, ...]:
        """Deviation of what the goals alone leave, (n,) [rad]."""
        return self.measurements.torque_spread

    def errors(self, values: Array, names: tuple[str, ...] | None = None) -> PredictionErrors:
        """Of a model with parameters `values` (P, n); `names` of the groups that were fitted."""
        return self.many([values], names)[0]

    def many(self, models: list[Array], names: tuple[str, ...] | None = None) -> list[PredictionErrors]:
        """Of several models, simulated at once."""
        theta = free_motion(self.motion, np.stack(models, axis=1))
        return [self._judged(one - self.motion.theta, names) for one in theta]

    def runs(self, values: Array) -> dict[str, FreeRun]:
        """The free motion of every group."""
        theta = free_motion(self.motion, values[:, None])[0]
        out: dict[str, FreeRun] = {}
        for g, group in enumerate(self.measurements.groups):
            parts = np.flatnonzero(self.motion.group == g)
            counts = [len(segment) for segment in group.segments]
            time = group.joined("time")
            found = np.concatenate([theta[:count, :, c] for c, count in zip(parts, counts, strict=True)])
            out[group.name] = FreeRun(time, found, found - group.joined("theta"))
        return out

    def _judged(self, error: Array, names: tuple[str, ...] | None) -> PredictionErrors:
        motion, groups = self.motion, self.measurements.groups
        squares, counts = (
            np.array([one[:, :, motion.group == g].sum(axis=(0, 2)) for g in range(len(groups))])
            for one in (np.square(error) * motion.used, motion.used)
        )

        def rms(chosen: list[int]) -> tuple[float, ...]:
            total = squares[chosen].sum(axis=0) / np.maximum(counts[chosen].sum(axis=0), 1)
            return tuple(map(float, np.sqrt(total)))

        held = [k for k, g in enumerate(groups) if g.validation]
        fit = [k for k, g in enumerate(groups) if not g.validation and (names is None or g.name in names)]
        return PredictionErrors(
            rms(fit), rms(held) if held else None,
            tuple(GroupError(g.name, rms([k]), g.validation) for k, g in enumerate(groups)),
            self.noise, np.zeros((0, self.measurements.n)), self.spread, self.measurements.torque_units,
        )  # fmt: skip
