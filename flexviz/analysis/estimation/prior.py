"""Prior of the parameters.

Inertial parameters: the log-determinant divergence between a body's pseudo-inertia P and its CAD value P₀,
D = tr(P₀⁻¹P) − log det(P₀⁻¹P) − 4 (Lee, Wensing, Park: Geometric robot dynamic identification,
IEEE T-RO 36(2), 2020). It is frame-invariant, diverges towards physically inconsistent bodies (P not positive
definite), and near P₀ acts like a normal distribution of about 100 %, a few orders of magnitude weaker than
data that contain any information on a parameter. All other parameters: wide normal distributions around the
start values.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexviz.analysis.estimation.holds import HoldsTerm
from flexviz.base.arrays import Array
from flexviz.model.effects import EFFECTS
from flexviz.model.equation import Layout


def _basis() -> Array:
    """E_k with P = Σ_k φ_k E_k for φ = m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz: shape (10, 4, 4)."""
    e = np.zeros((10, 4, 4))
    e[0, 3, 3] = 1.0
    for k in range(3):
        e[1 + k, k, 3] = e[1 + k, 3, k] = 1.0
    for index, (i, j) in zip(
        (4, 5, 6, 7, 8, 9), ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)), strict=True
    ):
        if i == j:  # Σ = ½ tr(I) 1 − I
            e[index, :3, :3] += 0.5 * np.eye(3)
            e[index, i, i] -= 1.0
        else:
            e[index, i, j] = e[index, j, i] = -1.0
    return e


BASIS = _basis()


def pseudo_inertia(parameters: Array) -> Array:
    """P of bodies with inertial parameters (..., 10): shape (..., 4, 4)."""
    return np.tensordot(parameters, BASIS, axes=(-1, 0))


def physically_consistent(parameters: Array) -> Array:
    """Nearby parameters (…, 10) with a well-conditioned, positive definite pseudo-inertia.

    CAD values are often rounded or invented such that no real body has them; massless bodies get a small
    mass.
    """
    p = pseudo_inertia(parameters)
    total = np.max(parameters[..., 0]) if parameters.size else 1.0
    out = np.array(parameters, float)
    for index in np.ndindex(parameters.shape[:-1]):
        mass = max(parameters[index][0], 1e-3 * total, 1e-3)
        centre = parameters[index][1:4] / mass
        spread = p[index][:3, :3] - mass * np.outer(centre, centre)  # second moment about the centre of mass
        values, vectors = np.linalg.eigh(spread)
        # minimum radius of gyration: 2 % of the distance of the centre of mass, at least a centimetre
        size = max(0.01, 0.02 * float(np.linalg.norm(centre)))
        raised = (vectors * np.maximum(values, mass * size**2)) @ vectors.T + mass * np.outer(centre, centre)
        inertia = np.trace(raised) * np.eye(3) - raised
        out[index][0] = mass
        out[index][4:] = inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    return out


def torque_scale(layout: Layout, x: Array) -> Array:
    """Applied by recorded torque, 1 + g of each joint, shape (n,), of a model with parameters x, shape (P,).

    A residual divided by it is in units of the recorded torque: an error does not shrink with the gain.
    """
    scale = np.ones(layout.n)
    for effect, where in layout.effect_slices():
        if EFFECTS[effect.effect].scales_torque:
            joint = slice(None) if effect.joint is None else effect.joint
            scale[joint] *= max(1 + float(x[where.start]), 1e-9)
    return scale


@dataclass(frozen=True)
class Prior:
    """Negative log density of the parameters.

    Attributes:
        layout: layout of the parameter vector.
        cad: shape (n, 10), CAD inertial parameters, physically consistent.
        centre: shape (P,), mean of the normal part.
        spread: shape (P,), standard deviations of the normal part, infinite for no prior; inertial entries
            unused.
        weight: of the inertial part, one number or shape (n,).
        log_spread: shape (P,), standard deviations of ln(x / centre), infinite without; None: all infinite.
        holds: likelihood of static tests; None without any.
        scales: parameters g by which a joint's torque is scaled, 1 + g, and how many samples they scale.
        coupled: parameters and the inverse covariance of a further normal part around `centre`, of each
            effect that has one.
    """

    layout: Layout
    cad: Array
    centre: Array
    spread: Array
    weight: float | Array = 1.0
    log_spread: Array | None = None
    coupled: tuple[tuple[slice, Array], ...] = ()
    scales: tuple[tuple[int, float], ...] = ()
    holds: HoldsTerm | None = None

    def feasible(self, x: Array) -> bool:
        """Whether all bodies are physically consistent and the parameters of every effect admissible."""
        if not all(EFFECTS[e.effect].possible(x[where]) for e, where in self.layout.effect_slices()):
            return False
        p = pseudo_inertia(x[self.layout.inertial].reshape(-1, 10))
        try:
            np.linalg.cholesky(p)
        except np.linalg.LinAlgError:
            return False
        return True

    def value(self, x: Array) -> float:
        """−log density up to a constant; infinite if not feasible."""
        if not self.feasible(x):
            return np.inf
        p = pseudo_inertia(x[self.layout.inertial].reshape(-1, 10))
        relative = np.linalg.solve(pseudo_inertia(self.cad), p)
        divergence = np.trace(relative, axis1=1, axis2=2) - np.linalg.slogdet(relative)[1] - 4.0
        normal = ((x - self.centre) / self.spread)[self.layout.compliance.start :]
        ratio, precision = self._logs(x)
        relative_part = float(precision @ ratio**2)
        coupled = sum(float(d @ m @ d) for at, m in self.coupled for d in [(x - self.centre)[at]])
        total = (self.weight * divergence).sum() + 0.5 * (normal @ normal + relative_part + coupled)
        measured = 0.0 if self.holds is None else self.holds.value(x, self.layout)
        return float(total) + measured - self.volume(x)

    def volume(self, x: Array) -> float:
        """Log of the ratio of the volumes of applied and recorded torques.

        The residual of a torque scaled by 1 + g is scaled as well: the density of the recorded torque, in
        whose units errors are measured, has this factor. Without it any error becomes small as g falls to −1.
        """
        return sum(count * float(np.log(max(1 + x[k], 1e-9))) for k, count in self.scales)

    def gradient_and_hessian(self, x: Array) -> tuple[Array, Array]:
        """Derivatives of `value`, shapes (P,) and (P, P)."""
        size = self.layout.size
        gradient, hessian = np.zeros(size), np.zeros((size, size))
        inverse = np.linalg.inv(pseudo_inertia(x[self.layout.inertial].reshape(-1, 10)))
        inverse_cad = np.linalg.inv(pseudo_inertia(self.cad))
        weights = np.broadcast_to(self.weight, len(self.cad))
        for body, weight in enumerate(weights):
            rows = slice(10 * body, 10 * body + 10)
            gradient[rows] = weight * np.tensordot(BASIS, inverse_cad[body] - inverse[body], axes=2)
            moved = inverse[body] @ BASIS  # (10, 4, 4)
            hessian[rows, rows] = weight * np.einsum("kab,lba->kl", moved, moved)
        rest = slice(self.layout.compliance.start, size)
        precision = 1 / self.spread[rest] ** 2
        gradient[rest] = precision * (x - self.centre)[rest]
        index = np.arange(rest.start, size)
        hessian[index, index] = precision
        for at, matrix in self.coupled:
            gradient[at] += matrix @ (x - self.centre)[at]
            hessian[at, at] += matrix
        ratio, precision = self._logs(x)
        tight = precision > 0
        gradient[tight] += precision[tight] * ratio[tight] / x[tight]
        hessian[tight, tight] += precision[tight] / x[tight] ** 2
        for k, count in self.scales:
            gradient[k] -= count / max(1 + x[k], 1e-9)
            hessian[k, k] += count / max(1 + x[k], 1e-9) ** 2
        if self.holds is not None:
            slope, measured = self.holds.gradient_and_hessian(x, self.layout)
            gradient, hessian = gradient + slope, hessian + measured
        return gradient, hessian

    def measured(self, x: Array) -> Array:
        """The part of the Hessian that is no belief but that of static tests, shape (P, P)."""
        if self.holds is None:
            return np.zeros((self.layout.size, self.layout.size))
        return self.holds.gradient_and_hessian(x, self.layout)[1]

    def _logs(self, x: Array) -> tuple[Array, Array]:
        """ln(x / centre) where `log_spread` is finite, and its precision, shape (P,) each; zero elsewhere."""
        ratio, precision = np.zeros(len(x)), np.zeros(len(x))
        if self.log_spread is not None:
            tight = np.isfinite(self.log_spread) & (x > 0)
            ratio[tight] = np.log(x[tight] / self.centre[tight])
            precision[tight] = 1 / self.log_spread[tight] ** 2
        return ratio, precision
