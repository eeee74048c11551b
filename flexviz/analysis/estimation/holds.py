"""What static tests add to the likelihood: holds against a clamp, and with weights.

Clamped: θ = q + c s, s = τ − d (F + μ |s|), with q, F and μ unknown and d the direction from which the motor
came to rest: linear in c, c F and c μ at known |s|, so that a joint's pushes amount to a normal distribution
of its compliance c. Their scatter, that of friction included, gives its width, by Student's t.

Free: τ = g(q) + d F + offset, where q = θ − c g(q): gravity shows the masses, and, by the change of g along
the deflection, a little of c.

A hold that a motor reached without moving says nothing of its joint: friction there is anything within its
dead band.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexviz.base._scipy import sp
from flexviz.base.arrays import Array
from flexviz.base.statistics import NORMAL_95, student_95
from flexviz.data.measurements import HoldGroup, MeasurementSet
from flexviz.model.equation import Layout, LinkDynamics
from flexviz.robot.robot import Robot

BY_LOAD = 4  # pushes beyond the parameters, from which friction may depend on the load
DEPENDENT = 1e-3  # share of τ that is not along the nuisances, below which pushes show no stiffness
LOADS = 5  # iterations of s
ITERATIONS = 4  # of q = θ − c g(q)
CAD_SPREAD = 0.5  # of the masses, to estimate the scatter of free holds


@dataclass(frozen=True, eq=False)
class Compliances:
    """What pushes against a clamp say of each joint's compliance, (n,) each.

    Attributes:
        value: [rad/Nm]; 0 without pushes.
        precision: inverse variance [Nm²/rad²]; 0 without pushes.
        holds: how many counted.
    """

    value: Array
    precision: Array
    holds: Array


def clamped_compliances(groups: Sequence[HoldGroup], n: int) -> Compliances:
    """Regression of θ on τ, with an offset and friction of its own for each group."""
    value, precision, counts = np.zeros(n), np.zeros(n), np.zeros(n, int)
    for j in range(n):
        parts = []
        for group in groups:
            used = group.holds.slid(j)
            if group.clamped[j] and used.any():
                holds = group.holds
                parts.append(_Pushes(holds.theta[used, j], holds.tau[used, j], holds.approach[used, j]))
        found = _slope(parts)
        if found is not None:
            value[j], deviation, counts[j] = found
            precision[j] = deviation**-2
    return Compliances(value, precision, counts)


@dataclass(frozen=True, eq=False)
class _Pushes:
    """One joint's pushes in one group, (H,) each: θ [rad], τ [Nm], direction of approach."""

    theta: Array
    tau: Array
    approach: Array

    @property
    def by_load(self) -> bool:
        """Whether they are enough to tell friction by load."""
        return len(self.tau) >= 4 + BY_LOAD

    def nuisance(self, load: Array) -> Array:
        """Columns of q, c F and c μ, (H, 3) or (H, 2), at transmitted torques `load` (H,) [Nm]."""
        own = [np.ones_like(self.tau), self.approach, self.approach * np.abs(load)]
        return np.stack(own if self.by_load else own[:2], axis=1)


def _slope(parts: Sequence[_Pushes]) -> tuple[float, float, int] | None:
    """Slope dθ/dτ, half a 95 % interval in normal standard errors, and the number of holds; None if unknown.

    Friction follows the transmitted torque, which is τ without friction: found by iteration.
    """
    if not parts:
        return None
    theta, tau = (np.concatenate([getattr(part, name) for part in parts]) for name in ("theta", "tau"))
    loads, free, rest, freedom, slope = [part.tau for part in parts], tau, theta, 0, 0.0
    for _ in range(LOADS):
        nuisance = sp.linalg.block_diag(
            *(part.nuisance(load) for part, load in zip(parts, loads, strict=True))
        )
        left, size, _ = np.linalg.svd(nuisance, full_matrices=False)
        left = left[:, size > 1e-9 * size[0]]
        free = tau - left @ (left.T @ tau)
        freedom = len(theta) - left.shape[1] - 1
        if freedom < 1 or free @ free < (DEPENDENT * np.linalg.norm(tau)) ** 2:
            return None
        slope = float(free @ theta / (free @ free))
        beside = np.linalg.lstsq(nuisance, theta - slope * tau, rcond=None)[0]
        rest = theta - slope * tau - nuisance @ beside
        place, load_of, loads = 0, loads, []
        for part in parts:
            columns = part.nuisance(load_of[len(loads)])[:, 1:]
            friction = columns @ beside[place + 1 : place + 1 + columns.shape[1]] / -slope
            loads.append(part.tau - friction)
            place += 1 + columns.shape[1]
    scatter = float(rest @ rest) / freedom
    deviation = np.sqrt(scatter / (free @ free)) * float(student_95(freedom)) / NORMAL_95
    return slope, max(float(deviation), 1e-9 * abs(slope) + 1e-300), len(theta)


@dataclass(frozen=True, eq=False)
class _Free:
    """Holds of one group that hang free: θ, τ, approach (H, n), known payload (n, 10), scatter (n,) [Nm]."""

    theta: Array
    tau: Array
    approach: Array
    payload: Array
    sigma: Array


class HoldsTerm:
    """The negative log likelihood of all holds of a set, as a function of the solver's vector.

    Attributes:
        clamped: of the compliances.
        count: number of holds.
    """

    def __init__(self, measurements: MeasurementSet) -> None:
        groups, robot = measurements.holds, measurements.robot
        self.clamped = clamped_compliances(groups, measurements.n)
        self.count = sum(group.holds.count for group in groups)
        self._link = LinkDynamics(robot)
        self._free = [
            free_holds(self._link, robot, group)
            for group in groups
            if not group.clamped.any() and group.holds.count
        ]

    def rows(self, x: Array, layout: Layout) -> tuple[Array, Array]:
        """Residuals in standard deviations and their derivative, shapes (R,) and (R, P)."""
        at = layout.compliance.start + np.flatnonzero(
            (self.clamped.precision > 0) & ~layout.held[layout.compliance]
        )
        j = at - layout.compliance.start
        root = np.sqrt(self.clamped.precision[j])
        jacobian = np.zeros((len(at), layout.size))
        jacobian[np.arange(len(at)), at] = root
        residuals, jacobians = [root * (x[at] - self.clamped.value[j])], [jacobian]
        for free in self._free:
            residual, slopes = self._gravity(free, x, layout)
            residuals.append(residual)
            jacobians.append(slopes)
        return np.concatenate(residuals), np.concatenate(jacobians)

    def value(self, x: Array, layout: Layout) -> float:
        """−log likelihood up to a constant."""
        residual = self.rows(x, layout)[0]
        return 0.5 * float(residual @ residual)

    def gradient_and_hessian(self, x: Array, layout: Layout) -> tuple[Array, Array]:
        """Of `value`, by Gauss–Newton, shapes (P,) and (P, P)."""
        residual, jacobian = self.rows(x, layout)
        return jacobian.T @ residual, jacobian.T @ jacobian

    def _gravity(self, free: _Free, x: Array, layout: Layout) -> tuple[Array, Array]:
        n, count = layout.n, len(free.theta)
        inertial = x[layout.inertial].reshape(n, 10) + free.payload
        still, compliance = np.zeros_like(free.theta), x[layout.compliance]
        q = free.theta
        for _ in range(ITERATIONS):
            torque = self._link.torque(inertial, q, still, still)
            q = free.theta - compliance * torque
        regressor = np.empty((count, n, 10 * n))
        terms = self._link.evaluate([(slice(0, count), inertial)], q, still, still, regressor)
        torque = regressor @ inertial.ravel()
        jacobian = np.zeros((count, n, layout.size))
        jacobian[:, :, layout.inertial] = -regressor
        jacobian[:, :, layout.compliance] = terms.dq * torque[:, None, :]
        residual = free.tau - torque
        out, slopes = [], []
        for j in np.flatnonzero(layout.fitted):
            used = free.approach[:, j] != 0
            nuisance = np.stack([np.ones(count), free.approach[:, j]], axis=1)[used]
            if used.sum() <= nuisance.shape[1]:
                continue
            basis = np.linalg.svd(nuisance, full_matrices=False)[0]
            for target, part in ((out, residual[used, j, None]), (slopes, jacobian[used, j])):
                target.append((part - basis @ (basis.T @ part)) / free.sigma[j])
        empty = np.zeros((0, layout.size))
        return np.concatenate([np.zeros((0, 1)), *out])[:, 0], np.concatenate([empty, *slopes])


def free_holds(link: LinkDynamics, robot: Robot, group: HoldGroup) -> _Free:
    """A group's holds with the scatter that masses, offset and friction leave."""
    holds, n = group.holds, robot.n
    payload = np.array(robot.payload_parameters(group.bodies)).reshape(n, 10)
    still = np.zeros_like(holds.theta)
    regressor = link.regressor(holds.theta, still, still)
    cad = robot.cad_parameters.ravel()
    spread = CAD_SPREAD * np.maximum(np.abs(cad), 1e-3 * np.abs(cad).max())
    sigma = np.empty(n)
    for j in range(n):
        used = holds.approach[:, j] != 0
        y = regressor[used, j]
        target = holds.tau[used, j] - y @ (cad + payload.ravel())
        nuisance = np.stack([np.ones(len(target)), holds.approach[used, j]], axis=1)
        basis = np.linalg.svd(nuisance, full_matrices=False)[0] if len(target) else nuisance
        y, target = (v - basis @ (basis.T @ v) for v in (y * spread, target))
        # masses within their spread explain what they can; the scatter is what is left
        noise = float(np.mean(target**2)) if len(target) else 1.0
        for _ in range(20):
            covariance = y @ y.T + max(noise, 1e-12) * np.eye(len(target))
            gain = y @ y.T @ np.linalg.inv(covariance)
            freedom = max(len(target) - basis.shape[1] - float(np.trace(gain)), 1.0)
            noise = float(np.sum((target - gain @ target) ** 2)) / freedom
        sigma[j] = np.sqrt(max(noise, 1e-12))
    return _Free(holds.theta, holds.tau, holds.approach, payload, sigma)
