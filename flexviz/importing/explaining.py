"""How well the robot's masses explain the torques under what is assumed of units, signs and zero positions.

For each joint τ = s·(rigid inverse dynamics of the CAD model) + Bθ̈ + viscous and Coulomb friction + offset is
fitted with what physics demands: s near 1, B and friction not negative. A wrong sign or unit cannot be
explained so, whatever the masses and the friction really are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from flexviz._pinocchio import pin
from flexviz.errors import InputError
from flexviz.measurements import Array, GroupTable, SampledMotion, sample_motion
from flexviz.robot import PayloadBody, Robot

SLOPES = (0.4, 2.5)  # of τ against the CAD model, from masses that are known roughly
MOST_MOTOR = 4.0  # motor inertia at the joint side, in units of the joint's largest M_jj(q) of the CAD model
FASTEST, WIDEST = 40.0, 8 * np.pi  # [rad/s], [rad] where the robot description says nothing
SHORTEST_MOTION = 1.0  # [s] of all groups together, below which torques prove nothing
STANDS = 1e-3  # [rad/s] a joint that never moves faster does not move
SMALL_LINK = 0.05  # share of the largest diagonal entry that every joint is granted: wrists have large motors
SAME_MOTION = 0.95  # squared correlation of θ and q
UNITS = np.geomspace(1e-4, 1e4, 49)  # of τ, in Nm, that are tried
MOST_INSTANTS = 600  # of all groups together

Samples = Sequence[tuple[tuple[PayloadBody, ...], SampledMotion]]


@dataclass(frozen=True)
class Explained:
    """How τ of one joint is explained.

    Attributes:
        share: of its variance, at most 1; negative where it is worse than a constant.
        slope: s.
        by_masses: what of `share` friction and an offset alone do not explain.
    """

    share: float
    slope: float
    by_masses: float = 0.0


class Judge:
    """Holds the motion of all groups at a few instants and explains the torques of it.

    Attributes:
        span, speed: (n,) of each joint's θ [rad], [rad/s].
        width, fastest: (n,) what the joint can [rad], [rad/s].
        q_ratio: (n,) how many times as far as q θ turns; 0 where q is not recorded or another motion.
    """

    def __init__(self, robot: Robot, groups: Sequence[tuple[tuple[PayloadBody, ...], GroupTable]]) -> None:
        self.robot = robot
        samples = [(bodies, sample_motion(table.time, table.theta, table.tau)) for bodies, table in groups]
        total = sum(len(motion.q) for _, motion in samples)
        every = max(1, -(-total // MOST_INSTANTS))
        self.samples = [(bodies, thinned(motion, every)) for bodies, motion in samples]
        self.span = np.max([np.ptp(table.theta, axis=0) for _, table in groups], axis=0)
        self.speed = np.max([np.max(np.abs(motion.v), axis=0) for _, motion in samples], axis=0)
        self.width, self.fastest = limits(robot)
        self.q_ratio = np.array([ratio_to_q([table for _, table in groups], j) for j in range(robot.n)])
        self.torque = np.concatenate([motion.torque for _, motion in self.samples])
        self.inertia = largest_inertia(robot)
        self.seconds = sum(float(table.time[-1] - table.time[0]) for _, table in groups)
        self.usable = self._usable()

    def _usable(self) -> bool:
        """Whether there is motion for long enough, and the robot's description has masses to explain it."""
        if self.seconds < SHORTEST_MOTION:
            return False
        try:
            rigid = self.rigid(np.ones(self.robot.n), np.zeros(self.robot.n))[0]
        except InputError:
            return False
        return bool(np.isfinite(rigid).all() and rigid.any())

    def rigid(self, factor: Array, zero: Array) -> tuple[Array, Array, Array]:
        """(M, n) torques of the CAD model, velocities and accelerations, for θ·factor + zero, both (n,)."""
        torques, speeds, accelerations = [], [], []
        robot = self.robot
        for bodies, motion in self.samples:
            model = robot.model_with(robot.cad_parameters, bodies)
            data = model.createData()
            state = [
                robot.to_pin(x) for x in (motion.q * factor + zero, motion.v * factor, motion.a * factor)
            ]
            torques.append(
                robot.from_pin(np.array([pin.rnea(model, data, *row) for row in zip(*state, strict=True)]))
            )
            speeds.append(motion.v * factor)
            accelerations.append(motion.a * factor)
        return np.concatenate(torques), np.concatenate(speeds), np.concatenate(accelerations)

    def explain(self, factor: Array, zero: Array, sign: Array) -> list[Explained]:
        """Every joint, for θ·factor + zero and τ·sign, all (n,), with a slope near 1."""
        rigid, v, a = self.rigid(factor, zero)
        return [
            explained(rigid[:, j], v[:, j], a[:, j], self.torque[:, j] * sign[j], self.inertia[j], SLOPES)
            for j in range(self.robot.n)
        ]

    def explain_freely(self, factor: Array, zero: Array, sign: Array) -> list[Explained]:
        """As `explain`, with τ in any unit: the one in which it is explained best."""
        rigid, v, a = self.rigid(factor, zero)
        result = []
        for j in range(self.robot.n):
            torque = self.torque[:, j] * sign[j]
            columns = rigid[:, j], v[:, j], a[:, j]
            ways = [explained(*columns, torque / unit, self.inertia[j], SLOPES) for unit in UNITS]
            shares = np.array([way.share for way in ways])
            near = np.flatnonzero(shares >= np.max(shares) - 0.01)
            best = int(near[len(near) // 2])
            friction = explained(0.0 * rigid[:, j], v[:, j], a[:, j], torque, 0.0, (0.0, 0.0)).share
            slope = ways[best].slope * UNITS[best]
            result.append(Explained(float(shares[best]), float(slope), float(shares[best]) - friction))
        return result

    def explained_at_all(self) -> float:
        """How well the torques are explained with any scale and sign; the sum over the joints."""
        if not self.usable:
            return 0.0
        n = self.robot.n
        ways = [self.explain_freely(np.ones(n), np.zeros(n), sign * np.ones(n)) for sign in (1.0, -1.0)]
        return sum(max(one.share, other.share) for one, other in zip(*ways, strict=True))


def ratio_to_q(tables: Sequence[GroupTable], j: int) -> float:
    """How many times as far as q θ of joint j turns; 0 where q is not recorded or is another motion."""
    pairs = [(table.theta[:, j], table.q[:, j]) for table in tables if table.q is not None]
    pairs = [(theta - np.mean(theta), q - np.mean(q)) for theta, q in pairs if np.isfinite(q).all()]
    both = sum(float(theta @ q) for theta, q in pairs)
    powers = [sum(float(x @ x) for x in side) for side in zip(*pairs, strict=True)] if pairs else [0.0, 0.0]
    if both == 0.0 or both**2 < SAME_MOTION * powers[0] * powers[1]:
        return 0.0
    return powers[0] / both


def limits(robot: Robot) -> tuple[Array, Array]:
    """(n,) range [rad] and speed [rad/s] of the joints; wide ones where the robot's description has none."""
    width = robot.upper_limit - robot.lower_limit
    width = np.where(width > 0.5, np.minimum(width, WIDEST), WIDEST)
    return width, np.where(robot.velocity_limit > 0.1, np.minimum(robot.velocity_limit, FASTEST), FASTEST)


def thinned(motion: SampledMotion, every: int) -> SampledMotion:
    """Every so many-th instant."""
    return SampledMotion(motion.q[::every], motion.v[::every], motion.a[::every], motion.torque[::every])


def largest_inertia(robot: Robot) -> Array:
    """(n,) the largest value of each diagonal entry of M(q) over many poses, and a wrist's share [kg m²]."""
    model, data = robot.model, robot.model.createData()
    rng = np.random.default_rng(0)
    poses = rng.uniform(-np.pi, np.pi, size=(32, robot.n))
    largest = np.max([np.diag(pin.crba(model, data, q)) for q in poses], axis=0)
    largest = robot.from_pin(np.asarray(largest, dtype=float))
    return np.maximum(largest, SMALL_LINK * np.max(largest))


def explained(
    rigid: Array, v: Array, a: Array, torque: Array, inertia: float, slopes: tuple[float, float]
) -> Explained:
    """One joint: rigid torques, velocity, acceleration and τ, all (M,), at the same instants."""
    fastest = float(np.max(np.abs(v)))
    target = torque - np.mean(torque)
    total = float(target @ target)
    if fastest < STANDS or total == 0.0:
        return Explained(1.0, 1.0)  # a joint that stands says nothing
    matrix = np.stack([rigid, a, v, np.tanh(30.0 * v / fastest)], axis=1)
    matrix -= np.mean(matrix, axis=0)  # the offset is free
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0.0] = 1.0
    # a square problem with the same answer is all the solver has to see
    q, r = np.linalg.qr(matrix / scale)
    seen = q.T @ target
    lower = np.array([slopes[0], 0.0, 0.0, 0.0]) * scale
    upper = np.array([slopes[1], MOST_MOTOR * inertia, np.inf, np.inf]) * scale
    x = between(r, seen, lower, upper)
    unexplained = float(np.sum((r @ x - seen) ** 2)) + total - float(seen @ seen)
    return Explained(1.0 - unexplained / total, float(x[0] / scale[0]))


def between(matrix: Array, target: Array, lower: Array, upper: Array) -> Array:
    """(k,) least squares within bounds: first without the upper ones, then held at those that were passed."""
    x = lower + nnls(matrix, target - matrix @ lower)[0]
    held = x > upper
    while held.any():
        free = ~held
        x = np.where(held, upper, lower)
        x[free] += nnls(matrix[:, free], target - matrix @ x)[0]
        if not (x[free] > upper[free]).any():
            break
        held |= x > upper
    return x
