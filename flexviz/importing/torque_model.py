"""How well the robot's masses explain the torques under assumed units, signs and zero positions.

For each joint τ = s·(rigid inverse dynamics of the CAD model) + Bθ̈ + viscous and Coulomb friction + offset is
fitted within physical bounds: s near 1, B and friction not negative. A wrong sign or unit cannot be explained
so, whatever the masses and the friction really are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from flexviz._pinocchio import pin
from flexviz.errors import InputError
from flexviz.estimation import Bounds, bounded_step
from flexviz.importing.cross_checks import followed, joint_parts
from flexviz.importing.thresholds import LIMITS
from flexviz.measurements import Array, GroupTable, SampledMotion, likely_limits, sample_motion
from flexviz.robot import PayloadBody, Robot

TORQUE_UNITS = np.geomspace(1e-4, 1e4, 49)  # [Nm] scales of τ that are tried
LARGEST_SAMPLE = 600  # instants of all groups together

LoadedTable = tuple[Sequence[PayloadBody], GroupTable]  # a group and the payload that it carried


@dataclass(frozen=True)
class TorqueFit:
    """Fit of the torque of one joint."""

    share: float  # of its variance, at most 1; negative where the fit is worse than a constant
    slope: float  # s
    by_masses: float = 0.0  # part of `share` that friction and an offset alone do not explain


@dataclass(frozen=True, eq=False)
class Reading:
    """An assumed reading of the columns: θ·factor + zero and τ·sign, all (n,)."""

    factor: Array
    zero: Array
    sign: Array
    drive: Array | None = None  # (n, n) joint angles = drive · motor angles, where τ is that of the motors
    theta_too: bool = False  # whether θ is that of the motors, too
    converted: bool = False  # whether τ was converted to the joints already: only friction is the motors'

    @staticmethod
    def unchanged(n: int) -> Reading:
        """The columns as the mapping states them."""
        return Reading(np.ones(n), np.zeros(n), np.ones(n))


class TorqueModel:
    """The motion of all groups at a few instants, and fits of its torques."""

    def __init__(self, robot: Robot, groups: Sequence[LoadedTable]) -> None:
        self.robot = robot
        samples = [(bodies, sample_motion(table.time, table.theta, table.tau)) for bodies, table in groups]
        total = sum(len(motion.q) for _, motion in samples)
        every = max(1, -(-total // LARGEST_SAMPLE))
        self.samples = [
            (bodies, SampledMotion(*(x[::every] for x in (m.q, m.v, m.a, m.torque)))) for bodies, m in samples
        ]
        self.torque = np.concatenate([motion.torque for _, motion in self.samples])
        # (n,) span and largest speed of each joint's θ, and limits of both [rad], [rad/s]
        self.span = np.max([np.ptp(table.theta, axis=0) for _, table in groups], axis=0)
        self.speed = np.max([np.max(np.abs(motion.v), axis=0) for _, motion in samples], axis=0)
        self.width, self.fastest = likely_limits(robot)
        # (n,) θ per q; 0 where q is not recorded or shows another motion
        pairs = (followed(joint_parts([table for _, table in groups], j, "q")) for j in range(robot.n))
        self.q_ratio = np.array(
            [1.0 / slope if slope and share >= LIMITS.same_motion else 0.0 for share, slope in pairs]
        )
        self.inertia = largest_inertia(robot)
        seconds = sum(float(table.time[-1] - table.time[0]) for _, table in groups)
        try:
            rigid = self.rigid(Reading.unchanged(robot.n))[0]
        except InputError:
            rigid = np.zeros(0)
        has_masses = bool(np.isfinite(rigid).all() and rigid.any())
        self.usable = seconds >= LIMITS.shortest_motion and has_masses

    def changed(self, motion: Callable[[Array], Array], torque: Callable[[Array], Array]) -> TorqueModel:
        """The same with other angles (and their derivatives) and torques, (M, n) each."""
        model = copy(self)
        model.samples = [
            (bodies, SampledMotion(motion(m.q), motion(m.v), motion(m.a), torque(m.torque)))
            for bodies, m in self.samples
        ]
        model.torque = torque(self.torque)
        return model

    def rigid(self, reading: Reading) -> tuple[Array, Array, Array]:
        """(M, n) torques of the CAD model, velocities and accelerations, all at the side of τ."""
        turn = np.diag(reading.factor)
        if reading.drive is not None and reading.theta_too:
            turn = turn @ reading.drive.T
        read = [(bodies, m.q @ turn + reading.zero, m.v @ turn, m.a @ turn) for bodies, m in self.samples]
        torques = [self.robot.cad_torques(*motion) for motion in read]
        _, _, speeds, accelerations = zip(*read, strict=True)
        torque, v, a = (np.concatenate(parts) for parts in (torques, speeds, accelerations))
        if reading.drive is None:
            return torque, v, a
        back = np.linalg.inv(reading.drive).T
        return torque if reading.converted else torque @ reading.drive, v @ back, a @ back

    def fit(self, reading: Reading) -> list[TorqueFit]:
        """Fits of all joints, with a slope near 1."""
        rigid, v, a = self.rigid(reading)
        torque = self.torque * reading.sign
        acting = np.eye(self.robot.n)  # of motors (rows) on joints
        if reading.converted and reading.drive is not None:
            acting = np.linalg.inv(reading.drive)
        speeds = [v[:, row != 0.0] * row[row != 0.0] for row in acting.T]
        joints = zip(rigid.T, speeds, a.T, torque.T, self.inertia, strict=True)
        return [fit_joint(*joint, LIMITS.slopes) for joint in joints]

    def fit_any_scale(self, reading: Reading) -> list[TorqueFit]:
        """Fits of all joints with τ in any unit: the one that explains it best."""
        motion = self.rigid(reading)
        result = []
        for j, inertia in enumerate(self.inertia):
            torque = self.torque[:, j] * reading.sign[j]
            rigid, v, a = (x[:, j] for x in motion)
            fits = [fit_joint(rigid, v, a, torque / unit, inertia, LIMITS.slopes) for unit in TORQUE_UNITS]
            shares = np.array([fit.share for fit in fits])
            near = np.flatnonzero(shares >= np.max(shares) - 0.01)
            best = int(near[len(near) // 2])
            friction = friction_share(v, a, torque)
            slope = fits[best].slope * TORQUE_UNITS[best]
            result.append(TorqueFit(float(shares[best]), float(slope), float(shares[best]) - friction))
        return result

    def shares(self, reading: Reading, any_scale: bool) -> Array:
        """(n,) explained shares, at least −1; with any scale only the part that the masses explain counts."""
        if any_scale:
            shares = [min(fit.share, 3.0 * fit.by_masses) for fit in self.fit_any_scale(reading)]
        else:
            shares = [fit.share for fit in self.fit(reading)]
        return np.maximum(shares, -1.0)

    def by_masses(self, reading: Reading) -> Array:
        """(n,) the part of `shares` that friction and an offset alone do not explain."""
        _, v, a = self.rigid(reading)
        friction = map(friction_share, v.T, a.T, (self.torque * reading.sign).T)
        return self.shares(reading, any_scale=False) - np.array(list(friction))

    def best_share(self) -> float:
        """How well the torques are explained with any scale and sign; the sum over the joints."""
        if not self.usable:
            return 0.0
        start = Reading.unchanged(self.robot.n)
        fits = [self.fit_any_scale(replace(start, sign=sign * start.sign)) for sign in (1.0, -1.0)]
        return sum(max(plus.share, minus.share) for plus, minus in zip(*fits, strict=True))


def largest_inertia(robot: Robot) -> Array:
    """(n,) largest diagonal entry of M(q) over many poses, at least a wrist's share of the whole [kg m²]."""
    model, data = robot.model, robot.model.createData()
    poses = np.random.default_rng(0).uniform(-np.pi, np.pi, size=(32, robot.n))
    largest = np.max([np.diag(pin.crba(model, data, q)) for q in poses], axis=0)
    largest = robot.from_pin(np.asarray(largest, dtype=float))
    return np.maximum(largest, LIMITS.small_link * np.max(largest))


def fit_joint(
    rigid: Array, v: Array, a: Array, torque: Array, inertia: float, slopes: tuple[float, float]
) -> TorqueFit:
    """One joint: rigid torques, acceleration and τ, all (M,), at the same instants.

    `v`: velocity, or (M, k) those of k motors whose friction acts on the joint.
    """
    speeds = v.reshape(len(v), -1)
    fastest = np.maximum(np.max(np.abs(speeds), axis=0), 1e-12)
    target = torque - np.mean(torque)
    total = float(target @ target)
    if np.max(fastest) < LIMITS.resting or total == 0.0:
        return TorqueFit(1.0, 1.0)  # a joint at rest is no evidence
    matrix = np.column_stack([rigid, a, speeds, np.tanh(30.0 * speeds / fastest)])
    matrix -= np.mean(matrix, axis=0)  # the offset is free
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0.0] = 1.0
    # a square problem with the same solution is cheaper
    q, r = np.linalg.qr(matrix / scale)
    projected = q.T @ target
    lower = np.array([slopes[0], *(0.0 for _ in scale[1:])]) * scale
    upper = np.array([slopes[1], LIMITS.motor_inertia * inertia, *(np.inf for _ in scale[2:])]) * scale
    x = lower + bounded_step(r.T @ (r @ lower - projected), r.T @ r, lower, Bounds(lower, upper))[0]
    unexplained = float(np.sum((r @ x - projected) ** 2)) + total - float(projected @ projected)
    return TorqueFit(1.0 - unexplained / total, float(x[0] / scale[0]))


def friction_share(v: Array, a: Array, torque: Array) -> float:
    """Share of a joint's torque that friction and an offset alone explain."""
    return fit_joint(0.0 * v, v, a, torque, 0.0, (0.0, 0.0)).share


def improvement(before: Array, after: Array) -> float:
    """By how much the unexplained parts of the torques shrink: Σ log of their ratios."""
    return float(np.sum(np.log((1 - before + LIMITS.model_error) / (1 - after + LIMITS.model_error))))
