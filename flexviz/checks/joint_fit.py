"""The fit of one joint's torque by the columns that the robot's masses, inertia and friction give it."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from flexviz.base.nonnegative import nonnegative_least_squares
from flexviz.checks.thresholds import LIMITS
from flexviz.data.measurements import Array

STEPS = 6  # of the fit
REVERSALS = 10.0, 100.0  # how steep friction reverses, per largest speed
SMALLEST_SCALE = 1e-6
UNKNOWN_SIZE = float(np.log(LIMITS.mass_spread / LIMITS.unit_spread))  # of a torque, costs so much


@dataclass(frozen=True)
class JointFit:
    """One joint's torque against the model's."""

    score: float  # logarithm of its probability, up to a constant of the torque
    share: float  # of the torque's variance that is explained
    slope: float  # of τ as it was read against the model, where its size is unknown
    parts: float  # variance of the largest part that masses explain, per that of the torque
    room: float  # by which the score would rise if the model left nothing but its usual error


@dataclass(frozen=True, eq=False)
class Band:
    """What a joint's torque is explained by, at some frequencies."""

    r: Array  # (≤ P + 1, P + 1) R of the columns and of τ, which has unit length
    power: float  # of τ [(Nm)²], summed over the instants

    @property
    def least_left_of_any(self) -> float:
        """The share of τ that no masses, inertia and friction of any sign explain."""
        rows, columns = self.r.shape
        return float(self.r[-1, -1] ** 2) if rows == columns else 0.0

    @cached_property
    def least_left(self) -> float:
        """The share of τ that no masses, inertia and friction explain, if they are not negative."""
        columns = self.r[:, :-1]
        size = np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
        return nonnegative_least_squares(columns / size, self.r[:, -1])[1] ** 2


@dataclass(frozen=True, eq=False)
class TorqueColumns:
    """What may explain one joint's torque at M instants.

    Attributes:
        masses: (M, 3) torque of gravity, of motion and of the payload [Nm].
        a: (M,) acceleration of its motor [rad/s²].
        speeds: (M, k) of the motors that act on it [rad/s].
        tau: (M,) its torque [Nm].
        drift: (M, d) of either sign, besides an offset; d is 0 but for a torque whose zero drifts.
    """

    masses: Array
    a: Array
    speeds: Array
    tau: Array
    drift: Array

    @cached_property
    def key(self) -> int:
        """What distinguishes them from others."""
        return hash(tuple(getattr(self, one.name).tobytes() for one in fields(self)))

    @cached_property
    def matrix(self) -> Array:
        """(M, P + 1) all of them, τ last, without offsets."""
        fastest = np.maximum(np.max(np.abs(self.speeds), axis=0), 1e-12)
        friction = [np.tanh(sharpness * self.speeds / fastest) for sharpness in REVERSALS]
        drift = self.drift, -self.drift
        matrix = np.column_stack([self.masses, self.a, self.speeds, *friction, *drift, self.tau])
        return matrix - np.mean(matrix, axis=0)

    @property
    def rests(self) -> bool:
        """Whether nothing moves or acts."""
        return not np.ptp(self.tau) or not (np.ptp(self.masses, axis=0).any() or np.any(self.speeds))


def reduced(columns: TorqueColumns, slow: Array) -> list[Band]:
    """The joint's columns at low and at high frequencies; nothing of a joint at rest.

    `slow` (M, k): basis of the low frequencies.
    """
    if columns.rests:
        return []
    matrix = columns.matrix
    low = slow.T @ matrix
    least = 1e-12 * float(np.sum(np.square(matrix[:, -1])))
    bands = []
    for rows in (low, matrix - slow @ low):
        power = max(float(np.sum(np.square(rows[:, -1]))), least)
        r: Any = np.linalg.qr(rows / np.sqrt(power), mode="r")
        bands.append(Band(r, power))
    return bands


def fit_joint(bands: list[Band], swings: Array, inertia: float, free: bool) -> JointFit:
    """Fit one joint's torque, from what `reduced` left of it.

    ln s is found by Gauss-Newton steps, all else by least squares within each. What the model leaves has a
    size of its own in each band: a soft joint follows the rigid model at low frequencies only.
    """
    if not bands:  # a joint at rest is no evidence
        return JointFit(0.0, 1.0, 1.0, 0.0, 0.0)
    whole = sum(band.power for band in bands)
    # (P + 1) columns of all bands, in units of the whole torque
    stacked = np.concatenate([band.r * np.sqrt(band.power / whole) for band in bands])
    share = np.array([band.power / whole for band in bands])
    rows = [len(band.r) for band in bands]
    masses, others, y = stacked[:, :3], stacked[:, 3:-1], stacked[:, -1]
    size = np.linalg.norm(others, axis=0)
    size[size == 0.0] = 1.0
    others = others / size  # B, d, c in units of their columns
    count = others.shape[1]
    spread = np.array([LIMITS.mass_spread, LIMITS.mass_spread, LIMITS.payload_spread])
    scale = 1.0
    if free:
        both = np.column_stack([masses.sum(axis=1), others])
        sizes = np.maximum(np.linalg.norm(both, axis=0), 1e-12)
        scale = max(float(nonnegative_least_squares(both / sizes, y)[0][0] / sizes[0]), SMALLEST_SCALE)
    u, x, left = np.zeros(3), np.zeros(count), np.ones(len(bands))
    largest = max(LIMITS.motor_inertia * inertia * scale * size[0], 1e-12)
    system, goal = np.zeros((len(y) + 4, 3 + count)), np.zeros(len(y) + 4)
    places, free_ones = np.arange(4), None
    for _ in range(STEPS):
        weight = np.repeat(np.sqrt(swings / ((left + LIMITS.model_error) * share)), rows)
        system[: len(y)] = weight[:, None] * np.column_stack([masses * (np.exp(u) * scale), others])
        goal[: len(y)] = weight * y
        system[len(y) + places, places] = 1.0 / np.append(spread, largest)
        goal[len(y) : -1] = (1.0 - u) / spread
        # s is multiplied by 1 + the step of ln s
        found = nonnegative_least_squares(system, goal, free_ones)[0]
        free_ones = found > 0.0
        step, x = np.minimum(found[:3] - 1.0, 1.0), found[3:]
        u = np.clip(u + step, -6.0, 6.0)
        rest = np.square(masses @ np.exp(u) * scale + others @ x - y)
        left = np.add.reduceat(rest, [0, rows[0]]) / share
        if np.max(np.abs(step)) < 1e-3:
            break
    score = -0.5 * float(
        swings @ np.log(left + LIMITS.model_error) + np.sum((u / spread) ** 2) + (x[0] / largest) ** 2
    )
    if free:
        score += UNKNOWN_SIZE
    room = -0.5 * float(np.sum(swings)) * np.log(LIMITS.model_error) - score
    weights = np.linalg.norm(masses, axis=0) ** 2
    slope = scale * float(np.exp(np.sum(weights * u) / max(np.sum(weights), 1e-300)))
    parts = float(np.max(weights * (np.exp(u) * scale) ** 2))
    return JointFit(score, 1.0 - float(np.sum(rest)), slope, parts, float(room))


def swings_of(values: Array) -> float:
    """How many independent observations a signal holds: from one change of its sign to the next."""
    changes = np.count_nonzero(np.diff(np.signbit(values - np.mean(values))))
    return max(4.0, min(float(changes), len(values) / 4))
