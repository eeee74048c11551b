"""The paper's way: its equation 6 minimised by an interior-point method with finite differences.

SciPy's trust-constr over base inertial parameters, K, B and friction on both sides, samples every 25 ms as in
the paper; derivatives by a zero-phase filter in place of the paper's causal observer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from scipy.optimize import Bounds, minimize

from benchmarks.peers.derivatives import differences, inner, smooth, torque_at_samples
from benchmarks.peers.problem import COULOMB, Array, Group, Indices, Problem, answer
from benchmarks.peers.rigid import SMOOTH, RigidModel, pin

HERTZ = 8.0
SIGN_HERTZ = 100.0  # the velocity in sign(v) needs a wider band
EVERY = 0.025  # [s]
ERROR = 1e-3  # of the torque's spread, scales the cost
ITERATIONS = 2000


@dataclass(frozen=True, eq=False)
class Samples:
    """θ with four derivatives, τ and sign(θ̇) with two, (k, N, n) each, at the samples of one group."""

    theta: Array
    tau: Array
    sign: Array
    payload: Array


def samples(group: Group, hold: float) -> Samples:
    """Smooth signals of one group."""
    step, kept = group.step, inner(group, EVERY)
    rate = np.gradient(smooth(group.theta, SIGN_HERTZ, step), step, axis=0)
    signals = (group.theta, 4), (torque_at_samples(group, hold), 2), (np.tanh(rate / SMOOTH), 2)
    parts = [np.array(differences(smooth(y, HERTZ, step), k, step))[:, kept] for y, k in signals]
    return Samples(parts[0], parts[1], parts[2], group.payload)


class Equation6:
    """r = s − Y(q, q̇, q̈) (Γ + Γ_payload) − f_l q̇ with q = θ − s/K, from x in units of its start values."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self.n, self.evaluations = problem, problem.n, 0
        model = RigidModel(problem)
        self.model, self.data = model.pin, model.data
        self.base: Indices = model.base[model.base < 10 * self.n]
        self.groups = [samples(group, problem.hold) for group in problem.fitted]
        inertial = problem.inertial.ravel()
        largest = np.abs(problem.inertial).max(axis=0)[self.base % 10]
        coulomb = np.full(self.n * (COULOMB in problem.effects), 0.5)
        self.scale = np.concatenate([
            np.maximum(np.abs(inertial[self.base]), 0.1 * largest + 1e-3),
            problem.stiffness, problem.motor_inertia, np.full(2 * self.n, 0.5), np.ones_like(coulomb),
        ])  # fmt: skip
        self.start = np.concatenate([inertial[self.base], *np.split(self.scale[len(self.base) :], 1)])
        torque = np.concatenate([group.tau[0] for group in self.groups])
        self.spread = ERROR * torque.std(axis=0)

    def split(self, x: Array) -> tuple[Array, ...]:
        """Γ (10n), K, B, f_l, f_m, f_c, (n,) each."""
        inertial = self.problem.inertial.ravel().copy()
        inertial[self.base] = x[: len(self.base)]
        rest = x[len(self.base) :].reshape(-1, self.n)
        return inertial, *rest, *([np.zeros(self.n)] if len(rest) == 4 else [])

    def cost(self, z: Array) -> float:
        """½ Σ (r/σ)²."""
        self.evaluations += 1
        inertial, k, b, link, motor, coulomb = self.split(z * self.scale)
        total = 0.0
        for g in self.groups:
            s = g.tau - b * g.theta[2:] - motor * g.theta[1:4] - coulomb * g.sign
            q, v, a = g.theta[:3] - s / k
            for i, row in enumerate(inertial.reshape(self.n, 10) + g.payload):
                self.model.inertias[1 + i] = pin.Inertia.FromDynamicParameters(row)
            links = np.array([pin.rnea(self.model, self.data, *row) for row in zip(q, v, a, strict=True)])
            total += 0.5 * float((((s[0] - links - link * v) / self.spread) ** 2).sum())
        return total


def estimate(problem: Problem) -> dict[str, Any]:
    """From the same start values as all others."""
    equation = Equation6(problem)
    free, n = len(equation.base), problem.n
    start = equation.start / equation.scale
    lower = np.concatenate([np.full(free, -np.inf), np.full(2 * n, 0.1), np.zeros(len(start) - free - 2 * n)])
    upper = np.concatenate(
        [np.full(free, np.inf), np.full(2 * n, 10.0), np.full(len(start) - free - 2 * n, 100)]
    )
    bounds = Bounds(cast(Any, lower), cast(Any, upper), keep_feasible=cast(Any, True))
    result = minimize(
        equation.cost, start, method="trust-constr", jac="2-point",
        bounds=bounds, options={"maxiter": ITERATIONS},
    )  # fmt: skip
    inertial, k, b, link, motor, coulomb = equation.split(result.x * equation.scale)
    return answer(
        problem,
        stiffness=k,
        motor_inertia=b,
        viscous=(link, motor),
        inertial=inertial.reshape(n, 10),
        coulomb=coulomb if COULOMB in problem.effects else None,
        evaluations=equation.evaluations,
        converged=result.status in (1, 2),
    )
