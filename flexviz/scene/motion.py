"""Measured and simulated robot motion over time, with joint deflections."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexviz.measurements import Group, MeasurementSet

if TYPE_CHECKING:
    from flexviz.identification import Identification

Array = NDArray[np.float64]
SAMPLE_RATE = 100.0  # [1/s] of the drawn motion; playback interpolates
ROUND_FACTORS = (1, 2, 5, 10, 20, 50, 100, 200, 500)  # of the deflection


@dataclass(frozen=True, eq=False)
class RobotMotion:
    """Drawn motion of one group: M instants, n joints.

    Attributes:
        group: its name.
        time: (M,) [s].
        theta: (M, n) measured motor positions [rad].
        deflection: (M, n) θ − q of the measured motion [rad]; None if unknown.
        deflection_source: its origin, for the label.
        model_theta, model_deflection: (M, n) the simulated model's θ and θ − q [rad]; None if unknown.
        model_note: how the model was simulated, for the label.
        link: (M, n) measured link positions q [rad], or None without link encoders.
        torque: (M, n) measured torque [Nm].
    """

    group: str
    time: Array
    theta: Array
    deflection: Array | None
    deflection_source: str
    model_theta: Array | None = None
    model_deflection: Array | None = None
    model_note: str = ""
    link: Array | None = None
    torque: Array | None = None

    @property
    def duration(self) -> float:
        """[s]"""
        return float(self.time[-1] - self.time[0])

    def pose(
        self, time: float, deflection: float = 0.0, error: float = 1.0, link_side: bool = False
    ) -> tuple[Array, Array]:
        """Joint positions (n,) of the measured and the identified robot at one instant [rad].

        `deflection` scales θ − q, `error` scales simulated − measured θ. With `link_side`, measured and
        simulated q are compared, if q is measured.
        """
        if link_side and self.link is not None:
            return self._link_pose(time, error)
        measured = sample(self.time, self.theta, time)
        drawn = measured
        if self.deflection is not None:
            drawn = measured - deflection * sample(self.time, self.deflection, time)
        if self.model_theta is None:
            return drawn, measured
        model = measured + error * (sample(self.time, self.model_theta, time) - measured)
        if self.model_deflection is not None:
            model = model - deflection * sample(self.time, self.model_deflection, time)
        return drawn, model

    def _link_pose(self, time: float, error: float) -> tuple[Array, Array]:
        assert self.link is not None
        measured = sample(self.time, self.link, time)
        if self.model_theta is None or self.model_deflection is None:
            return measured, measured
        theta, bent = (sample(self.time, v, time) for v in (self.model_theta, self.model_deflection))
        return measured, measured + error * (theta - bent - measured)

    def torque_shares(self, time: float) -> Array:
        """(n,) torque at one instant relative to each joint's largest, −1 … 1."""
        if self.torque is None:
            return np.zeros(self.theta.shape[1])
        largest = np.abs(self.torque).max(axis=0)
        return sample(self.time, self.torque, time) / np.where(largest > 0, largest, 1.0)


def scene_labels(
    motion: RobotMotion,
    deflection: float,
    error: float,
    why: str = "not identified yet",
    simulated_data: bool = False,
    link_side: bool = False,
) -> tuple[str, str]:
    """Labels of the measured and the identified robot, with the scale factors.

    `why` is the reason for a missing simulation of the identified model.
    """
    first = "measured (simulated data)" if simulated_data else "measured"
    if link_side and motion.link is not None:
        measured = f"{first}\nlink side q, encoders"
        if motion.model_theta is None:
            return measured, f"{why}:\nshows the measured link side"
        return measured, f"identified, error ×{error:g}\nlink side q (simulated)"
    if motion.deflection is None:
        measured = f"{first}\ndeflection unknown before Run"
    else:
        measured = f"{first}\ndeflection ×{deflection:g} ({motion.deflection_source})"
    if motion.model_theta is None:
        return measured, f"{why}:\nshows the measured motor angle"
    return measured, f"identified, error ×{error:g}\ndeflection ×{deflection:g} (simulated)"


def sample(time: Array, values: Array, at: float) -> Array:
    """values (M, n) linearly interpolated at one instant: (n,)."""
    right = int(np.searchsorted(time, at))
    if right <= 0:
        return values[0]
    if right >= len(time):
        return values[-1]
    share = (at - time[right - 1]) / (time[right] - time[right - 1])
    return (1.0 - share) * values[right - 1] + share * values[right]


def measured_motion(measurements: MeasurementSet, group: Group, result: Identification | None) -> RobotMotion:
    """The measured motion of a group with the best deflection available."""
    start, end = group.segments[0].time[0], group.segments[-1].time[-1]
    count = max(int((end - start) * SAMPLE_RATE) + 1, 2)
    time = np.linspace(start, end, count)
    all_time = joined(group, "time")
    theta = _columns(time, all_time, joined(group, "theta"))
    deflection, source = _deflection(measurements, group, result, time, all_time, theta)
    link = None
    if group.q is not None and np.isfinite(group.q).all():
        link = _columns(time, group.time, group.q)
    torque = _columns(time, all_time, joined(group, "tau"))
    return RobotMotion(group.name, time, theta, deflection, source, link=link, torque=torque)


def joined(group: Group, name: str) -> Array:
    """time (N,), theta or tau (N, n) over all segments; not copied if there is only one."""
    parts = [getattr(segment, name) for segment in group.segments]
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def with_replay(motion: RobotMotion, run: Any) -> RobotMotion:
    """The motion together with a simulation of the identified model (a `simulation.Run`)."""
    return replace(
        motion,
        model_theta=_columns(motion.time, run.time, run.theta),
        model_deflection=_columns(motion.time, run.time, run.theta - run.q),
        model_note=getattr(run, "note", "") or "",
    )


def nice_factor(motion: RobotMotion, target: float = 0.25) -> int:
    """The largest round factor that scales the deflection to at most `target` [rad]."""
    if motion.deflection is None:
        return 1
    largest = float(np.quantile(np.abs(motion.deflection), 0.98))
    if largest <= 0:
        return 1
    return max((factor for factor in ROUND_FACTORS if factor * largest <= target), default=1)


def _columns(time: Array, from_time: Array, values: Array) -> Array:
    return np.stack([np.interp(time, from_time, column) for column in np.asarray(values).T], axis=1)


def _deflection(
    measurements: MeasurementSet,
    group: Group,
    result: Identification | None,
    time: Array,
    all_time: Array,
    theta: Array,
) -> tuple[Array | None, str]:
    """Deflection (M, n) [rad] and its source: link encoders, the identified model, or rough start values."""
    if group.q is not None and np.isfinite(group.q).all():
        return theta - _columns(time, group.time, group.q), "link encoders"
    series = None if result is None else result.residuals.get(group.name)
    if series is not None and result is not None and len(series.time):
        deflection = series.torque / result.model.stiffness
        return _columns(time, series.time, deflection), "identified"
    if measurements.initial_stiffness is None:
        return None, "unknown"
    tau = joined(group, "tau")
    rough = _smooth(tau, all_time) / measurements.initial_stiffness
    return _columns(time, all_time, rough), "rough, from start K"


def _smooth(values: Array, time: Array, width: float = 0.1) -> Array:
    """A moving average over `width` [s]."""
    count = max(int(width / max((time[-1] - time[0]) / max(len(time) - 1, 1), 1e-9)), 1)
    sums = np.cumsum(np.concatenate((np.zeros((1, values.shape[1])), values)), axis=0)
    low = np.clip(np.arange(len(values)) - count // 2, 0, len(values))
    high = np.clip(low + count, 1, len(values))
    return (sums[high] - sums[low]) / (high - low)[:, None]
