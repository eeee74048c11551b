"""Measured and simulated robot motion over time, with torques and joint deflections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.content.scene.arcs import round_up
from flexviz.data.measurements import Group, MeasurementSet

if TYPE_CHECKING:
    from flexviz.analysis.identification import Identification

SAMPLE_RATE = 100.0  # [1/s] of the drawn motion; playback interpolates
ROUND_FACTORS = (1, 2, 5, 10, 20, 50, 100, 200, 500)  # of the deflection


@dataclass(frozen=True, eq=False)
class RobotMotion:
    """Drawn motion of one group: M instants, n joints. What is None is unknown."""

    group: str  # its name
    time: Array  # (M,) [s]
    theta: Array  # (M, n) measured motor positions [rad]
    deflection: Array | None  # (M, n) θ − q of the measured motion [rad]
    deflection_source: str  # its origin, for the label
    model_theta: Array | None = None  # (M, n) of the simulated model [rad]
    model_deflection: Array | None = None  # (M, n) its θ − q [rad]
    model_note: str = ""  # how the model was simulated, for the label
    link: Array | None = None  # (M, n) link positions q of link encoders [rad]
    torque: Array | None = None  # (M, n) measured [Nm]
    determined: Bools | None = None  # (n,) whether the deflection of a joint is; None: of every joint
    model_determined: Bools | None = None  # the same of the model: whether its stiffness is
    rigid: bool = False  # no joint has elasticity: there is no deflection to draw or to speak of

    def at(self, values: Array, time: float) -> Array:
        """values (M, n) linearly interpolated at one instant [s]: (n,)."""
        right = int(np.searchsorted(self.time, time))
        if right <= 0:
            return values[0]
        if right >= len(self.time):
            return values[-1]
        share = (time - self.time[right - 1]) / (self.time[right] - self.time[right - 1])
        return (1.0 - share) * values[right - 1] + share * values[right]

    def pose(
        self, time: float, deflection: float = 0.0, error: float = 1.0, link_side: bool = False
    ) -> tuple[Array, Array]:
        """Joint positions (n,) of the measured and the identified robot at one instant [rad].

        `deflection` scales θ − q, where that is determined, `error` scales simulated − measured θ. With
        `link_side`, measured and simulated q are compared, if q is measured.
        """
        if link_side and self.link is not None:
            measured = self.at(self.link, time)
            if self.model_theta is None or self.model_deflection is None:
                return measured, measured
            model = self.at(self.model_theta, time) - self.at(self.model_deflection, time)
            return measured, measured + error * (model - measured)
        measured = self.at(self.theta, time)
        drawn = measured
        if self.deflection is not None:
            drawn = measured - deflection * _known(self.at(self.deflection, time), self.determined)
        if self.model_theta is None:
            return drawn, measured
        model = measured + error * (self.at(self.model_theta, time) - measured)
        if self.model_deflection is not None:
            own = _known(self.at(self.model_deflection, time), self.model_determined)
            model = model - deflection * own
        return drawn, model

    @cached_property
    def half_turns(self) -> tuple[Array | None, Array | None]:
        """Torque [Nm] and deflection [rad] of each joint that half a turn of its arcs means, (n,) each."""

        def ends(values: Array | None) -> Array | None:
            return None if values is None else np.array([round_up(top) for top in np.abs(values).max(axis=0)])

        return ends(self.torque), ends(self.deflection)

    def loads(self, time: float) -> tuple[Array | None, Array | None]:
        """Torque [Nm] and deflection [rad] of the joints at one instant, (n,) each; None where unknown."""
        torque, deflection = self.torque, self.deflection
        return (
            None if torque is None else self.at(torque, time),
            None if deflection is None else self.at(deflection, time),
        )

    def arcs(self, time: float) -> tuple[Array | None, Array | None]:
        """The loads at one instant as shares of half a turn, −1 … 1."""
        pairs = zip(self.loads(time), self.half_turns, strict=True)
        torque, deflection = (None if now is None or end is None else now / end for now, end in pairs)
        return torque, deflection


def scene_labels(
    motion: RobotMotion,
    deflection: float,
    error: float,
    why: str = "not identified yet",
    simulated_data: bool = False,
    link_side: bool = False,
    name: str = "identified",
) -> tuple[str, str]:
    """Labels of the measured and the identified robot, with the scale factors.

    `why` is the reason for a missing simulation of the identified model, `name` what the model is called.
    """
    first = "measured (simulated data)" if simulated_data else "measured"
    if link_side and motion.link is not None:
        measured = f"{first}\nlink side q, encoders"
        if motion.model_theta is None:
            return measured, f"{why}:\nshows the measured link side"
        return measured, f"{name}, error ×{error:g}\nlink side q (simulated)"
    if motion.rigid:
        return (
            first,
            f"{why}:\nshows the measured motion"
            if motion.model_theta is None
            else f"{name}, error ×{error:g}",
        )
    if motion.deflection is None:
        measured = f"{first}\ndeflection unknown before Run"
    else:
        measured = f"{first}\ndeflection ×{deflection:g} ({motion.deflection_source})"
        if motion.determined is not None and not motion.determined.any():
            measured = f"{first}\ndeflection not drawn: K is not determined"
    if motion.model_theta is None:
        return measured, f"{why}:\nshows the measured motor angle"
    return measured, f"{name}, error ×{error:g}\ndeflection ×{deflection:g} (simulated)"


def measured_motion(measurements: MeasurementSet, group: Group, result: Identification | None) -> RobotMotion:
    """The measured motion of a group with the best deflection available."""
    start, end = group.segments[0].time[0], group.segments[-1].time[-1]
    count = max(int((end - start) * SAMPLE_RATE) + 1, 2)
    time = np.linspace(start, end, count)
    recorded = group.joined("time")
    theta, torque = (_columns(time, recorded, group.joined(name)) for name in ("theta", "tau"))
    link, rigid = group.at("q", time), set(measurements.rigid) == set(measurements.joints)
    if link is not None and np.isfinite(link).all():
        deflection, source = theta - link, "link encoders"
    elif rigid:
        link, deflection, source = None, None, ""
    else:
        link = None
        deflection, source = _deflection(measurements, group, result, time)
    known = stiffness_known(measurements.joints, result)
    determined = known if link is None and deflection is not None else None
    return RobotMotion(
        group.name, time, theta, deflection, source, link=link, torque=torque, determined=determined,
        model_determined=known, rigid=rigid and link is None,
    )  # fmt: skip


def stiffness_known(joints: Sequence[str], result: Identification | None) -> Bools:
    """Whether the data determine the stiffness of each joint, at least weakly and within its bounds, (n,)."""
    found = () if result is None else (p for p in result.parameters if p.name == "stiffness")
    known = {p.joint for p in found if p.identifiable != "no" and not p.at_bound}
    return np.array([joint in known for joint in joints])


def with_replay(motion: RobotMotion, run: Any) -> RobotMotion:
    """The motion together with a simulation of the identified model (a `simulation.Run`)."""
    return replace(
        motion,
        model_theta=_columns(motion.time, run.time, run.theta),
        model_deflection=None if motion.rigid else _columns(motion.time, run.time, run.theta - run.q),
        model_note=getattr(run, "note", "") or "",
    )


def nice_factor(motion: RobotMotion, target: float = 0.25) -> int | None:
    """The largest round factor that scales the drawn deflections to at most `target` [rad]; or None."""
    if motion.deflection is None:
        return None
    shown = motion.deflection if motion.determined is None else motion.deflection[:, motion.determined]
    if not shown.size:
        return None
    largest = float(np.quantile(np.abs(shown), 0.98))
    if largest <= 0:
        return 1
    return max((factor for factor in ROUND_FACTORS if factor * largest <= target), default=1)


def _known(deflection: Array, determined: Bools | None) -> Array:
    """Deflections (n,) [rad], 0 where they are not determined."""
    return deflection if determined is None else np.where(determined, deflection, 0.0)


def _columns(time: Array, from_time: Array, values: Array) -> Array:
    return np.stack([np.interp(time, from_time, column) for column in np.asarray(values).T], axis=1)


def _deflection(
    measurements: MeasurementSet, group: Group, result: Identification | None, time: Array
) -> tuple[Array | None, str]:
    """Deflection (M, n) [rad] and its source, without link encoders: the model, or rough start values."""
    series = None if result is None else result.residuals.get(group.name)
    if series is not None and result is not None and len(series.time):
        return _columns(time, series.time, series.torque / result.model.stiffness), "identified"
    if measurements.initial_stiffness is None:
        return None, "unknown"
    recorded = group.joined("time")
    rough = _smooth(group.joined("tau"), recorded) / measurements.initial_stiffness
    return _columns(time, recorded, rough), "rough, from start K"


def _smooth(values: Array, time: Array, width: float = 0.1) -> Array:
    """A moving average over `width` [s]."""
    count = max(int(width / max((time[-1] - time[0]) / max(len(time) - 1, 1), 1e-9)), 1)
    sums = np.cumsum(np.concatenate((np.zeros((1, values.shape[1])), values)), axis=0)
    low = np.clip(np.arange(len(values)) - count // 2, 0, len(values))
    high = np.clip(low + count, 1, len(values))
    return (sums[high] - sums[low]) / (high - low)[:, None]
