"""Find wrong units without ever refusing plausible data.

The reference is the robot itself: τ is compared with the rigid inverse dynamics of the CAD model along the
recorded motion, pooled over the joints, with offset, viscous and Coulomb friction free on each. The slope of
that comparison is near 1 whatever the friction (0.6–2.2 on all sets tried), and 1000 times that for torques
in mNm. Angles in degrees make the comparison fail, and reading them as degrees makes it succeed. Data that
only look odd give a warning; data that the dynamics contradict as well are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NoReturn

import numpy as np

from flexviz.base.errors import InputError
from flexviz.data.measurements.data import Array
from flexviz.data.measurements.sampled_motion import SampledMotion, sample_motion
from flexviz.robot.robot import PayloadBody, Robot

DEGREE = np.pi / 180  # [rad]

Warn = Callable[[str], None]


@dataclass(frozen=True)
class UnitThresholds:
    """When data look odd, when they are refused; `pytest tests/data/test_bad_measurements.py` supports them.

    All sets of the practice cases, the presets and the real recordings pass without a warning.
    """

    slowest_step: float = 0.2  # [s] slower sampling cannot show a flexible joint: time is not in seconds
    slow_step: float = 0.05  # [s] slower sampling is odd, and
    resting_speed: float = 5e-3  # [rad/s] refused for a robot that hardly moves
    fast_step: float = 2e-5  # [s] faster sampling is uncommon
    widest: float = 8 * np.pi  # [rad] limits assumed where the robot description has none
    fastest: float = 40.0  # [rad/s]
    # span or speed in units of the joint's limits: degrees are tried, odd, refused unless dynamics explain it
    excess_checked: float = 2.0
    excess_odd: float = 3.0
    excess_refused: float = 20.0
    explained: float = 0.2  # share of τ that the rigid model must explain before its slope is trusted
    explained_alone: float = 0.5  # the same for a single joint
    odd_slope: float = 20.0  # τ beyond this factor of the rigid model (or its inverse) is odd
    milli_slope: float = 100.0  # slopes of mNm are 1000
    milli_slope_alone: float = 200.0  # the same for a single joint
    kilo_slope: float = 1 / 200  # slopes of kNm are 1/1000; torques before a gear
    effort: float = 20.0  # times the joint's effort limit above which τ is odd
    deflection_odd: float = 1.0  # [rad] deflection by `initial.stiffness` that is odd, and the one that
    deflection_refused: float = 0.3  # [rad] refuses τ above the effort limits
    # squared correlation and factor (or its inverse) of an optional column that is in another unit
    optional_follows: float = 0.7
    optional_slope: float = 20.0


UNITS = UnitThresholds()


@dataclass(frozen=True)
class Agreement:
    """Slope of τ against the rigid model, and the share of τ's variance that it explains."""

    slope: float  # of all joints pooled
    share: float
    slopes: Array  # (n,) of each joint
    shares: Array


def wrong_time_unit(step: float, speed: float) -> str | None:
    """The unit that a time with this median step seems to be in; None where it can be seconds.

    Args:
        step: as if it were in seconds.
        speed: largest joint speed that it implies [rad/s].
    """
    if step > UNITS.slowest_step or (step > UNITS.slow_step and speed < UNITS.resting_speed):
        return "milliseconds" if step < 100 else "microseconds" if step < 1e5 else "nanoseconds"
    return None


def motion_limits(robot: Robot) -> tuple[Array, Array]:
    """(n,) range [rad] and speed [rad/s] of the joints; infinite where the robot description has none."""
    width, speed = robot.upper_limit - robot.lower_limit, robot.velocity_limit
    return np.where(width > 0.5, width, np.inf), np.where(speed > 0.1, speed, np.inf)


def likely_limits(robot: Robot) -> tuple[Array, Array]:
    """`motion_limits` where the robot description has narrower ones than any robot needs."""
    width, speed = motion_limits(robot)
    return np.minimum(width, UNITS.widest), np.minimum(speed, UNITS.fastest)


@dataclass(frozen=True, eq=False)
class UnitCheck:
    """Refuses a table whose columns are not in s, rad and Nm; warns where that is not certain."""

    robot: Robot
    bodies: Sequence[PayloadBody]
    time: Array  # (N,)
    theta: Array  # (N, n)
    tau: Array  # (N, n)
    file: Path
    warn: Warn

    @cached_property
    def motion(self) -> SampledMotion:
        return sample_motion(self.time, self.theta, self.tau)

    def refuse(self, column: str, message: str) -> NoReturn:
        """InputError for a column."""
        raise InputError(message, file=self.file, place=f"column {column}")

    def check_time(self) -> None:
        """Time in ms, µs or ns."""
        step = float(np.median(np.diff(self.time)))
        if unit := wrong_time_unit(step, float(np.max(np.abs(self.motion.v)))):
            self.refuse("time", f"the median step is {step:g}: is time in {unit}? expected seconds")
        if step > UNITS.slow_step:
            self.warn(f"the step is {step:g} s, slow for flexible joints: is time in seconds?")
        if step < UNITS.fast_step:
            self.warn(f"the step is {step:g} s, uncommonly short: is time in seconds?")

    def check_theta(self) -> None:
        """Angles in degrees, or of the motor before the gear."""
        span = np.ptp(self.theta, axis=0)
        speed = np.max(np.abs(self.motion.v), axis=0)
        limits, speeds = motion_limits(self.robot)
        likely = likely_limits(self.robot)
        excess = np.maximum(span / likely[0], speed / likely[1])
        worst = int(np.argmax(excess))
        if excess[worst] < UNITS.excess_checked:
            return
        column = f"theta_{self.robot.joints[worst]}"
        found = (
            f"spans {span[worst]:.3g} at up to {speed[worst]:.3g} /s; the joint's limits are "
            f"{limits[worst]:.3g} rad and {speeds[worst]:.3g} rad/s"
        )
        in_radians = self.agreement(1.0)
        odd_joints = np.where(excess > UNITS.excess_checked, DEGREE, 1.0)
        for unit in (DEGREE, odd_joints):
            in_degrees = self.agreement(unit)
            plausible = 1 / UNITS.odd_slope < in_degrees.slope < UNITS.odd_slope
            if plausible and in_degrees.share > max(0.1, 2 * in_radians.share):
                self.refuse(column, f"{found}: are these degrees? expected radians (after the gear)")
        impossible = (span > np.maximum(2.5 * limits, 4 * np.pi)) & (speed > np.maximum(6.0 * speeds, 15.0))
        if impossible[worst] or (excess[worst] > UNITS.excess_refused and in_radians.share < 0.1):
            hint = "degrees, or the motor's angle before the gear? expected radians at the joint side"
            self.refuse(column, f"{found}: {hint}")
        if excess[worst] > UNITS.excess_odd:
            self.warn(f"column {column} {found}: radians at the joint side?")

    def check_tau(self, stiffness: Array | None) -> None:
        """Torques in mNm or kNm, or of the motor before the gear."""
        largest = np.maximum(self.tau.max(axis=0), -self.tau.min(axis=0))
        rigid, joints = self.agreement(1.0), self.robot.joints
        limits = self.robot.effort_limit
        strong = largest > UNITS.effort * np.where(limits > 0.0, limits, np.inf)
        deflection = largest / (np.inf if stiffness is None else stiffness)  # [rad]
        worst = int(np.argmax(largest))

        def refuse(j: int, why: str, unit: str) -> NoReturn:
            message = f"reaches {largest[j]:.4g}, {why}: is this {unit}? expected Nm at the joint side"
            self.refuse(f"tau_{joints[j]}", message)

        trusted = rigid.share > UNITS.explained
        if trusted and rigid.slope > UNITS.milli_slope:
            refuse(worst, f"{rigid.slope:.0f} times the torque of the rigid model", "mNm")
        if trusted and 0.0 < rigid.slope < UNITS.kilo_slope:
            why = f"1/{1 / rigid.slope:.0f} of the torque of the rigid model"
            refuse(worst, why, "kNm, or the motor's torque before the gear")
        for j in (int(j) for j in np.flatnonzero(strong | (deflection > UNITS.deflection_odd))):
            slope, alone = rigid.slopes[j], rigid.shares[j] > UNITS.explained_alone
            if alone and slope > UNITS.milli_slope_alone:
                refuse(j, f"{slope:.0f} times the torque of the rigid model", "mNm")
            explained = alone and slope < UNITS.odd_slope
            if strong[j] and deflection[j] > UNITS.deflection_refused and not explained:
                why = f"far above the effort limit, and the joint would deflect by {deflection[j]:.2g} rad"
                refuse(j, why, "mNm")
        column = f"column tau_{joints[worst]} reaches {largest[worst]:.4g}"
        if trusted and not 1 / UNITS.odd_slope < abs(rigid.slope) < UNITS.odd_slope:
            self.warn(
                f"{column}, {rigid.slope:.3g} times the torque of the rigid model: Nm at the joint side?"
            )
        elif strong.any():
            self.warn(f"{column}, far above the joints' effort limits: Nm at the joint side?")
        elif np.any(deflection > UNITS.deflection_odd):
            hint = "with initial.stiffness a joint would deflect by more than 1 rad; Nm and Nm/rad?"
            self.warn(f"{column}: {hint}")

    def agreement(self, unit: float | Array) -> Agreement:
        """Compare τ with the rigid CAD model along the motion, with angles in `unit` [rad], (n,) or one."""
        n, motion = self.robot.n, self.motion
        nothing = Agreement(1.0, 0.0, np.ones(n), np.zeros(n))
        try:
            rigid = self.robot.cad_torques(self.bodies, motion.q * unit, motion.v * unit, motion.a * unit)
        except InputError:
            return nothing  # bodies without mass
        if not np.isfinite(rigid).all():
            return nothing
        cross, own, total = np.zeros(n), np.full(n, 1e-30), np.full(n, 1e-30)
        for j in range(n):
            v = motion.v[:, j] / (np.max(np.abs(motion.v[:, j])) + 1e-12)
            friction, _ = np.linalg.qr(np.stack([np.ones_like(v), v, np.tanh(30 * v)], axis=1))
            torque = motion.torque[:, j] - friction @ (friction.T @ motion.torque[:, j])
            model_torque = rigid[:, j] - friction @ (friction.T @ rigid[:, j])
            cross[j] = torque @ model_torque
            own[j] += model_torque @ model_torque
            total[j] += torque @ torque
        slope = float(cross.sum() / own.sum())
        share = slope * float(cross.sum() / total.sum())
        return Agreement(slope, share, cross / own, cross**2 / (own * total))


def check_optional(name: str, values: Array, reference: Array, file: Path, warn: Warn) -> None:
    """Refuse an optional column (N,) that is its measured one (N,) in another unit."""
    values, reference = values - np.mean(values), reference - np.mean(reference)
    power = float(reference @ reference)
    if power == 0.0 or not values.any():
        return
    slope = float(values @ reference) / power
    follows = float(values @ reference) ** 2 > UNITS.optional_follows * power * float(values @ values)
    if follows and not 1 / UNITS.optional_slope <= abs(slope) <= UNITS.optional_slope:
        message = f"is {slope:.3g} times its measured column, expected rad and Nm at the joint side"
        raise InputError(message, file=file, place=f"column {name}")
    if not name.startswith("tau_") and not 0.5 < slope < 2.0:
        warn(f"column {name} hardly follows theta (slope {slope:.2g}): same sign, unit and joint?")
