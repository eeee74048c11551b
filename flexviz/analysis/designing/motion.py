"""Motions as points of a unit cube, scaled to the limits of the joints."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexviz.analysis.designing.settings import DesignSettings, Limits
from flexviz.analysis.designing.subject import Planned
from flexviz.base.arrays import Array
from flexviz.data.measurements import Group
from flexviz.model.simulation import Fourier
from flexviz.robot.robot import Robot

SAMPLES = 400  # instants at which a reference is compared with the joint limits
LEAST_SHARE = 0.2  # of the largest amplitude within the joint limits
RAMP = 1.0  # [s] at both ends
SHARE_INSIDE = 0.97  # of a limit, used of the reference: the motor and the link deviate from it
TOOL_SAMPLES = 120  # instants at which the tool's position is checked


@dataclass(frozen=True)
class MotionSpace:
    """Maps a point of the unit cube to a reference and a payload.

    Coordinates: payload; per joint its centre and its share of the largest amplitude; the coefficients.
    """

    robot: Robot
    settings: DesignSettings
    limits: Limits
    payloads: tuple[str, ...]

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return 1 + 2 * self.robot.n * (1 + self.settings.harmonics)

    def planned(self, u: Array, name: str) -> Planned:
        """The group of a point u, shape (size,)."""
        n, harmonics, limits = self.robot.n, self.settings.harmonics, self.limits
        payload = self.payloads[min(int(u[0] * len(self.payloads)), len(self.payloads) - 1)]
        place, share, free = u[1 : n + 1], u[n + 1 : 2 * n + 1], u[2 * n + 1 :]
        room = limits.upper - limits.lower
        centre = limits.lower + (0.1 + 0.8 * place) * room
        sine, cosine = (2 * free.reshape(2, n, harmonics) - 1) / np.sqrt(np.arange(1, harmonics + 1))
        duration = self.settings.duration
        raw = Fourier(np.zeros(n), sine, cosine, self.settings.base, RAMP, duration)
        time = np.linspace(0.0, duration, SAMPLES)
        position, velocity = raw.sample(time)
        acceleration = np.gradient(velocity, time[1], axis=0)
        reach = [
            (limits.upper - centre) / np.maximum(position.max(axis=0), 1e-9),
            (centre - limits.lower) / np.maximum(-position.min(axis=0), 1e-9),
            limits.velocity / np.maximum(np.abs(velocity).max(axis=0), 1e-9),
            limits.acceleration / np.maximum(np.abs(acceleration).max(axis=0), 1e-9),
        ]
        scale = SHARE_INSIDE * np.min(reach, axis=0) * (LEAST_SHARE + (1 - LEAST_SHARE) * share)
        motion = replace(raw, centre=centre, sine=sine * scale[:, None], cosine=cosine * scale[:, None])
        return Planned(name, payload, motion, duration)

    def used(self, group: Group) -> list[Reached]:
        """What a predicted group, without noise, uses of every limit; the most used first."""
        limits, (segment,), q = self.limits, group.segments, group.q
        assert q is not None
        theta, step = segment.theta, segment.step
        velocity = np.gradient(theta, step, axis=0)
        acceleration = np.gradient(velocity, step, axis=0)
        middle, half = 0.5 * (limits.upper + limits.lower), 0.5 * (limits.upper - limits.lower)
        quantities = {
            "position": np.maximum(np.abs(theta - middle), np.abs(q - middle)) / half,
            "velocity": np.abs(velocity) / limits.velocity,
            "acceleration": np.abs(acceleration) / limits.acceleration,
            "torque": np.abs(segment.tau) / limits.torque,
        }
        out = [
            Reached(f"{name} of {joint}", float(share))
            for name, values in quantities.items()
            for joint, share in zip(self.robot.joints, values.max(axis=0), strict=True)
        ]
        if np.isfinite(limits.box).any():
            every = max(1, len(q) // TOOL_SAMPLES)
            poses = [self.robot.link_poses(row)[limits.tool] for row in q[::every]]
            points = np.array([pose[:3, 3] for pose in poses])
            beyond = np.maximum(limits.box[0] - points, points - limits.box[1])  # [m] negative inside
            out.append(Reached(f"workspace of {limits.tool}", 1.0 + float(beyond.max())))
        return sorted(out, key=lambda r: -r.share)


def shrunk(planned: Planned, share: float) -> Planned:
    """The same motion with `share` of its amplitude."""
    motion = planned.reference
    assert isinstance(motion, Fourier)
    return replace(planned, reference=replace(motion, sine=share * motion.sine, cosine=share * motion.cosine))


@dataclass(frozen=True)
class Reached:
    """How much of a limit a motion uses.

    Attributes:
        limit: which one, "torque of joint2".
        share: 1 at the limit.
    """

    limit: str
    share: float
