"""Find wrong units without ever refusing plausible data.

The judge is the robot itself: τ is compared with the rigid inverse dynamics of the CAD model along the
recorded motion, pooled over the joints, with offset, viscous and Coulomb friction free on each. The slope of
that comparison is near 1 whatever the friction (0.6–2.2 on everything that was tried), and 1000 times that
for torques in mNm. Angles in degrees make the comparison fail, and taking them as degrees makes it succeed.
What only looks odd is a warning; what looks odd and is contradicted by the dynamics is an error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flexviz._pinocchio import pin
from flexviz.errors import InputError
from flexviz.measurements.data import Array
from flexviz.robot import PayloadBody, Robot

DEGREE = np.pi / 180  # [rad]
SLOWEST_STEP = 0.2  # [s] slower sampling cannot show a flexible joint
ODD_STEP = 0.05  # [s]
WINDOW = 0.05  # [s] half width of the local parabolas that give velocity and acceleration
INSTANTS = 200  # where the dynamics is compared

Warn = Callable[[str], None]


@dataclass(frozen=True)
class Agreement:
    """How τ follows the rigid model.

    Attributes
    ----------
    slope, share: of τ against the model; what of τ's variance that explains; all joints pooled [-].
    slopes, shares: (n,) the same joint by joint.
    """

    slope: float
    share: float
    slopes: Array
    shares: Array


@dataclass(frozen=True)
class Motion:
    """The motion at a few instants: positions, velocities, accelerations, torques, all (M, n)."""

    q: Array
    v: Array
    a: Array
    torque: Array


def wrong_time_unit(step: float, speed: float) -> str | None:
    """The unit that a time with this median step seems to be in; None where it can be seconds.

    Args:
        step: as if it were in seconds.
        speed: largest joint speed that it implies [rad/s].
    """
    if step > SLOWEST_STEP or (step > ODD_STEP and speed < 5e-3):
        return "milliseconds" if step < 100 else "microseconds" if step < 1e5 else "nanoseconds"
    return None


def check_step(step: float, speed: float, file: Path, warn: Warn) -> None:
    """Refuse a time that is not in seconds: median step [s], largest joint speed it implies [rad/s]."""
    if unit := wrong_time_unit(step, speed):
        raise InputError(
            f"the median step is {step:g}: is time in {unit}? seconds would be right",
            file=file,
            place="column time",
        )
    if step > ODD_STEP:
        warn(f"the step is {step:g} s, slow for flexible joints: is time in seconds?")
    if step < 2e-5:
        warn(f"the step is {step:g} s, uncommonly short: is time in seconds?")


def check_units(
    robot: Robot,
    bodies: Sequence[PayloadBody],
    stiffness: Array | None,
    time: Array,
    theta: Array,
    tau: Array,
    file: Path,
    warn: Warn,
) -> None:
    """Refuse θ (N, n) that is not in rad and τ (N, n) that is not in Nm; warn where that is not certain."""
    motion = sample_motion(time, theta, tau)
    check_step(float(np.median(np.diff(time))), float(np.max(np.abs(motion.v))), file, warn)
    check_theta(robot, bodies, motion, np.ptp(theta, axis=0), file, warn)
    check_tau(robot, bodies, motion, stiffness, np.maximum(tau.max(axis=0), -tau.min(axis=0)), file, warn)


def check_theta(
    robot: Robot, bodies: Sequence[PayloadBody], motion: Motion, span: Array, file: Path, warn: Warn
) -> None:
    """Angles in degrees, or of the motor before the gear."""
    speed = np.max(np.abs(motion.v), axis=0)
    limits = np.where(
        robot.upper_limit - robot.lower_limit > 0.5, robot.upper_limit - robot.lower_limit, np.inf
    )
    speeds = np.where(robot.velocity_limit > 0.1, robot.velocity_limit, np.inf)
    excess = np.maximum(span / np.minimum(limits, 8 * np.pi), speed / np.minimum(speeds, 40.0))
    worst = int(np.argmax(excess))
    if excess[worst] < 2.0:
        return
    found = (
        f"spans {span[worst]:.3g} at up to {speed[worst]:.3g} /s; the joint's limits are "
        f"{limits[worst]:.3g} rad and {speeds[worst]:.3g} rad/s"
    )
    column = f"column theta_{robot.joints[worst]}"
    in_radians = agreement(robot, bodies, motion, 1.0)
    for unit in (DEGREE, np.where(excess > 2.0, DEGREE, 1.0)):  # all joints, or only the odd ones
        in_degrees = agreement(robot, bodies, motion, unit)
        if 0.05 < in_degrees.slope < 20.0 and in_degrees.share > max(0.1, 2 * in_radians.share):
            hint = "are these degrees? radians (after the gear) would be right"
            raise InputError(f"{found}: {hint}", file=file, place=column)
    impossible = (span > np.maximum(2.5 * limits, 4 * np.pi)) & (speed > np.maximum(6.0 * speeds, 15.0))
    if impossible[worst] or (excess[worst] > 20.0 and in_radians.share < 0.1):
        hint = "degrees, or the motor's angle before the gear? radians at the joint side would be right"
        raise InputError(f"{found}: {hint}", file=file, place=column)
    if excess[worst] > 3.0:
        warn(f"{column} {found}: radians at the joint side?")


def check_tau(
    robot: Robot,
    bodies: Sequence[PayloadBody],
    motion: Motion,
    stiffness: Array | None,
    largest: Array,
    file: Path,
    warn: Warn,
) -> None:
    """Torques in mNm or kNm, or of the motor before the gear."""
    rigid = agreement(robot, bodies, motion, 1.0)
    limits = robot.from_pin(robot.model.upperEffortLimit)
    strong = largest > 20.0 * np.where(limits > 0.0, limits, np.inf)
    deflection = largest / (np.inf if stiffness is None else stiffness)  # [rad]
    worst = int(np.argmax(largest))

    def refuse(joint: int, why: str, unit: str) -> None:
        message = f"reaches {largest[joint]:.4g}, {why}: is this {unit}? Nm at the joint side would be right"
        raise InputError(message, file=file, place=f"column tau_{robot.joints[joint]}")

    if rigid.share > 0.2 and rigid.slope > 100.0:
        refuse(worst, f"{rigid.slope:.0f} times what the robot's masses ask for", "mNm")
    if rigid.share > 0.2 and 0.0 < rigid.slope < 1 / 200:
        why = f"1/{1 / rigid.slope:.0f} of what the robot's masses ask for"
        refuse(worst, why, "kNm, or the motor's torque before the gear")
    for j in range(robot.n):
        if not strong[j] and deflection[j] <= 1.0:
            continue
        slope, share = rigid.slopes[j], rigid.shares[j]
        if share > 0.5 and slope > 200.0:
            refuse(j, f"{slope:.0f} times what the robot's masses ask for", "mNm")
        explained = share > 0.5 and slope < 20.0
        if strong[j] and deflection[j] > 0.3 and not explained:
            refuse(
                j,
                f"far above the effort limit, and the joint would deflect by {deflection[j]:.2g} rad",
                "mNm",
            )
    column = f"column tau_{robot.joints[worst]} reaches {largest[worst]:.4g}"
    if rigid.share > 0.2 and not 1 / 20 < abs(rigid.slope) < 20.0:
        warn(f"{column}, {rigid.slope:.3g} times what the robot's masses ask for: Nm at the joint side?")
    elif strong.any():
        warn(f"{column}, far above the joints' effort limits: Nm at the joint side?")
    elif np.any(deflection > 1.0):
        warn(f"{column}: with initial.stiffness a joint would deflect by more than 1 rad; Nm and Nm/rad?")


def check_companion(name: str, values: Array, reference: Array, file: Path, warn: Warn) -> None:
    """Refuse an optional column that is its measured one in another unit."""
    values, reference = values - np.mean(values), reference - np.mean(reference)
    power = float(reference @ reference)
    if power == 0.0 or not values.any():
        return
    slope = float(values @ reference) / power
    follows = float(values @ reference) ** 2 > 0.7 * power * float(values @ values)
    if follows and (abs(slope) > 20.0 or abs(slope) < 1 / 20):
        raise InputError(
            f"is {slope:.3g} times its measured column; rad and Nm at the joint side would be right",
            file=file,
            place=f"column {name}",
        )
    if not name.startswith("tau_") and not 0.5 < slope < 2.0:
        warn(f"column {name} hardly follows theta (slope {slope:.2g}): same sign, unit and joint?")


def agreement(robot: Robot, bodies: Sequence[PayloadBody], motion: Motion, unit: float | Array) -> Agreement:
    """Compare τ with the rigid CAD model along the motion, its angles being in `unit` [rad], (n,) or one."""
    n = robot.n
    nothing = Agreement(1.0, 0.0, np.ones(n), np.zeros(n))
    try:
        model = robot.model_with(robot.cad_parameters, bodies)
    except InputError:
        return nothing  # bodies without mass
    data = model.createData()
    state = [robot.to_pin(x * unit) for x in (motion.q, motion.v, motion.a)]
    rigid = robot.from_pin(np.array([pin.rnea(model, data, *row) for row in zip(*state, strict=True)]))
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
    return Agreement(slope, slope * float(cross.sum() / total.sum()), cross / own, cross**2 / (own * total))


def sample_motion(time: Array, theta: Array, tau: Array) -> Motion:
    """The motion at up to `INSTANTS` instants: local parabolas through θ (N, n), local means of τ (N, n)."""
    count = len(time)
    step = float(np.median(np.diff(time)))
    half = int(np.clip(round(WINDOW / step), 3, max(3, count // 20)))
    centres = np.linspace(half, count - 1 - half, min(INSTANTS, count - 2 * half)).astype(int)
    offsets = np.arange(-half, half + 1)
    # a gap inside the window would be taken for a fast motion
    regular = time[centres + half] - time[centres - half] < 2.5 * half * step
    centres = centres[regular] if regular.any() else centres
    x = offsets / half
    parabola = np.linalg.pinv(np.stack([np.ones_like(x), x, x**2 / 2], axis=1))  # (3, 2 half + 1)
    rows = centres[:, None] + offsets
    q, v, a = np.einsum("kw,mwn->kmn", parabola, theta[rows])
    width = half * step  # [s]
    return Motion(q, v / width, a / width**2, np.mean(tau[rows], axis=1))
