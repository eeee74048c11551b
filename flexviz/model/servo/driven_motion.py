"""What the masses do to each joint along a measured motion, cut into stretches that are simulated at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.data.measurements import Group
from flexviz.model.equation import LinkDynamics
from flexviz.robot.robot import Robot

BAND, ORDER = 8.0, 5  # [Hz] to which measured motion is smoothed for its accelerations
STRETCH, WARM_UP = 5.0, 1.0  # [s] simulated from a measured state; before that, what does not count
BEFORE = 0.5  # [s] of goals before a stretch, which a servo may still follow


@dataclass(frozen=True, eq=False)
class DrivenMotion:
    """Stretches of measured motion: T samples of C stretches of n joints.

    Attributes:
        step: (C,) [s].
        scale: (C,) of the servos' gain in that run.
        before: (L, n, C) goals of the samples before it [rad].
        goal, theta: (T, n, C) [rad].
        rest: torque of the masses but for the joint's own acceleration, at the measured motion [Nm].
        slope: of that torque, by the joint's own angle [Nm/rad].
        own: the masses' inertia about the joint [kg m²].
        load: torque that the joint transmits to the links [Nm].
        speed: (n, C) at the beginning [rad/s].
        used: (T, n, C) samples that count.
        group: (C,) to which a stretch belongs.
        first: (C,) its first sample there.
    """

    step: Array
    scale: Array
    before: Array
    goal: Array
    theta: Array
    rest: Array
    slope: Array
    own: Array
    load: Array
    speed: Array
    used: Bools
    group: Array
    first: Array

    def part(self, chosen: Bools) -> DrivenMotion:
        """Some of the stretches, (C,)."""
        arrays = (getattr(self, field.name) for field in fields(self))
        return DrivenMotion(*(np.ascontiguousarray(one[..., chosen]) for one in arrays))


def driven_motion(
    robot: Robot, groups: Sequence[Group], about: Array | None = None, *, whole: bool = False
) -> DrivenMotion:
    """The motion of groups with goals, cut.

    Args:
        robot, groups: of the set.
        about: (T, n, C) [rad], a free motion of the whole stretches: above `BAND` the masses' motion is that.
        whole: each stretch without a gap as it is.
    """
    pieces: list[tuple[Any, ...]] = []
    segments = 0
    link = LinkDynamics(robot)
    for g, group in enumerate(groups):
        parameters = robot.cad_parameters + robot.payload_parameters(group.bodies)
        for segment in group.segments:
            wanted = group.at("theta_ref", segment.time)
            count = len(segment)
            known = None if about is None else about[:count, :, segments]
            signals = _masses(link, parameters, segment.theta, segment.step, known)
            segments += 1
            warm, length = round(WARM_UP / segment.step), round(STRETCH / segment.step)
            for at in [0] if whole else range(0, max(count - warm, 1), length):
                stop = count if whole else min(at + warm + length, count)
                pieces.append((g, segment.step, at, stop, warm, wanted, segment.theta, signals))
    T = max(stop - start for _, _, start, stop, *_ in pieces)
    n, C = robot.n, len(pieces)
    out = {k: np.zeros((T, n, C)) for k in ("goal", "theta", "rest", "slope", "own", "load")}
    used, speed = np.zeros((T, n, C), bool), np.zeros((n, C))
    ahead = round(BEFORE / min(step for _, step, *_ in pieces))
    before = np.empty((ahead, n, C))
    for c, (_, _, a, b, warm, wanted, theta, (rest, slope, own, load, v)) in enumerate(pieces):
        for name, signal in zip(out, (wanted, theta, rest, slope, own, load), strict=True):
            out[name][: b - a, :, c] = signal[a:b]
            out[name][b - a :, :, c] = signal[b - 1]
        used[warm : b - a, :, c] = True
        speed[:, c] = v[a]
        before[:, :, c] = wanted[np.maximum(np.arange(a - ahead, a), 0)]
    return DrivenMotion(
        np.array([p[1] for p in pieces]),
        np.array([groups[p[0]].kp_scale for p in pieces]), before, **out, speed=speed, used=used,
        group=np.array([p[0] for p in pieces]), first=np.array([p[2] for p in pieces]),
    )  # fmt: skip


def _masses(
    link: LinkDynamics, parameters: Array, theta: Array, step: float, about: Array | None
) -> tuple[Array, ...]:
    """rest, slope, own, load and speed of `DrivenMotion` along measured angles (N, n), each (N, n)."""
    from scipy.interpolate import make_interp_spline  # late: other sets have no use for it
    from scipy.signal import butter, sosfiltfilt

    time = np.arange(len(theta)) * step
    low_pass = butter(ORDER, min(2 * BAND * step, 0.9), output="sos")
    known = np.zeros_like(theta) if about is None else about
    smooth = known + sosfiltfilt(low_pass, theta - known, axis=0)
    curve = make_interp_spline(time, smooth, k=5)
    q, v, acc = (curve(time, nu=k) for k in range(3))
    found = link.evaluate([(slice(0, len(q)), parameters)], q, v, acc)
    own = np.einsum("kii->ki", found.mass)
    load = link.torque(parameters, q, v, acc)
    return load - own * acc, np.einsum("kii->ki", found.dq), own, load, v
