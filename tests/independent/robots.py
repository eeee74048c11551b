"""What robots a case may have: ranges to draw from, what they carry, how they move and how hard they work."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from independent.arms import Array, Body
from independent.simulator import Motion, Setup

FIT_RUNS = 3  # one more is held out


@dataclass(frozen=True)
class Frame:
    """A robot's kind: ranges to draw from, one entry a joint [SI]; speeds in Hz, holds in s."""

    centre: tuple[float, ...]
    swing: tuple[float, ...]
    stiffness: tuple[float, ...]
    motor_inertia: tuple[float, ...]
    link_viscous: tuple[float, float]
    motor_viscous: tuple[float, float]
    payload: tuple[float, float]
    payload_com: tuple[float, float, float]
    noise: tuple[float, float]
    holds: tuple[float, ...]
    quickest: float
    duration: float


FRAMES = {
    "2r": Frame(
        (0.2, -0.2), (0.75, 0.9), (2500, 1800), (1.4, 0.7), (0.15, 0.45), (0.3, 0.9),
        (1.2, 2.6), (0.35, 0.0, 0.04), (2e-5, 2e-3), (0.0, 0.00025, 0.0005, 0.001), 1.3, 10.0,
    ),
    "panda": Frame(
        (0, -0.3, 0, -1.9, 0, 1.8, 0.5), (0.5, 0.45, 0.5, 0.45, 0.6, 0.5, 0.6),
        (11000, 11000, 8000, 8500, 4500, 3800, 3500), (0.65, 0.6, 0.55, 0.6, 0.2, 0.22, 0.18),
        (0.35, 0.9), (1.2, 3.3), (1.0, 2.2), (0.02, 0.02, 0.15), (1e-5, 1e-2), (0.00025, 0.0005), 1.5, 10.0,
    ),
    "ur5": Frame(
        (0, -1.2, 1.2, -0.5, 0.5, 0), (0.6, 0.4, 0.5, 0.6, 0.6, 0.7),
        (19000, 20000, 13000, 3400, 4200, 3200), (2.3, 3.0, 1.2, 0.3, 0.35, 0.3),
        (0.35, 0.9), (1.6, 3.5), (1.2, 2.6), (0.02, 0.02, 0.08), (1e-5, 1e-2), (0.00025, 0.0005), 1.3, 10.0,
    ),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Work:
    """How much the joints work, each (n,).

    Attributes:
        torque, peak: rms and largest torque [Nm].
        speed: rms [rad/s].
        range, middle: half the range of angles and its middle [rad].
    """

    torque: Array
    peak: Array
    speed: Array
    range: Array
    middle: Array


def payloads_of(frame: Frame, rng: np.random.Generator) -> tuple[tuple[Body, ...], ...]:
    def body() -> Body:
        mass = float(rng.uniform(*frame.payload))
        spread = rng.uniform(0.7, 1.3, 3) * rng.choice([-1, 1], 3)
        x, y, z = (float(v) for v in np.array(frame.payload_com) * spread)
        place = (abs(x), y, z) if frame.payload_com[0] > frame.payload_com[2] else (x, y, abs(z))
        i = 0.002 * mass
        return Body(mass, place, (i, i, i, 0.0, 0.0, 0.0))

    return (), (body(),), (body(),)


def motion_of(frame: Frame, rng: np.random.Generator) -> Motion:
    """Three trajectories, the first run twice (with another payload)."""
    n, terms = len(frame.centre), 6
    kinds = []
    for _ in range(FIT_RUNS):
        hertz = np.exp(rng.uniform(np.log(0.1), np.log(frame.quickest), (n, terms)))
        weight = rng.uniform(0.5, 1.0, (n, terms)) / (1 + 2.5 * hertz)
        amplitude = weight / weight.sum(axis=1, keepdims=True) * np.array(frame.swing)[:, None] * 1.6
        centre = np.array(frame.centre) + rng.uniform(-0.15, 0.15, n)
        kinds.append((centre, amplitude, 2 * np.pi * hertz, rng.uniform(0, 2 * np.pi, (n, terms))))
    kinds.append(kinds[0])
    return Motion(*(np.concatenate([k[i] for k in kinds]) for i in range(4)))


def gains_of(setup: Setup) -> dict[str, Array]:
    """A controller of about 4 Hz for the whole joint, well damped."""
    link = np.median(setup.links.lightest(setup.motion.centre).reshape(setup.runs, setup.n), axis=0)
    inertia = setup.motor_inertia + link
    return {"kp": 700.0 * inertia, "kd": 40.0 * inertia}


def work_of(setup: Setup) -> Work:
    times = np.linspace(0, setup.duration, 150)
    q, v, a = setup.motion.position(times), setup.motion.velocity(times), setup.motion.acceleration(times)
    torque = np.array([setup.links.torque(*x) for x in zip(q, v, a, strict=True)])
    torque = torque + np.tile(setup.motor_inertia, setup.runs) * a

    def by_joint(x: Array) -> Array:
        return x.reshape(-1, setup.n)

    angles = by_joint(q)
    return Work(
        np.sqrt(np.mean(by_joint(torque) ** 2, axis=0)),
        np.abs(by_joint(torque)).max(axis=0),
        np.sqrt(np.mean(by_joint(v) ** 2, axis=0)),
        (angles.max(axis=0) - angles.min(axis=0)) / 2,
        (angles.max(axis=0) + angles.min(axis=0)) / 2,
    )
