"""Propagation of sensor noise through the equation into the residual."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.base.arrays import Array, Indices
from flexviz.model.effects import EFFECTS
from flexviz.model.equation import Layout, LinkTerms, local_compliance, time_constants
from flexviz.model.observers import ButterworthZeroPhase, Observer

Transfer = Callable[[Array, int], Array]  # (ω, k) → complex gain to the k-th derivative

THETA, TAU = 0, 1
DEPTH = (5, 3)  # number of derivatives of θ and τ in the equation


@dataclass(frozen=True)
class NoiseDerivatives:
    """The derivatives of filtered noise that reach the residual.

    Attributes:
        orders: shape (D,), order of each derivative.
        lags: shape (D,), time constant of an additional low-pass [s]; 0 for none.
        seen: [rad/s], band in which effects see the transmission torque in addition to the observer's: what a
            damped joint lags behind a spring is filtered like that torque, and once more.
        alone: how many of them, the last ones, pass through an effect only, times 1/(1 + iω·lag)².
    """

    orders: tuple[int, ...]
    lags: tuple[float, ...]
    seen: float = np.inf
    alone: int = 0

    @classmethod
    def plain(cls, count: int) -> NoiseDerivatives:
        """Derivatives 0 … count−1 without an additional low-pass."""
        return cls(tuple(range(count)), (0.0,) * count)

    def gains(self, transfer: Transfer, omega: Array) -> Sequence[NDArray[np.inexact]]:
        """Complex gains from the raw samples to each of the D derivatives, shape (F,) each."""
        torque = self._seen_torque(transfer, omega)
        out, first_alone = [], len(self.orders) - self.alone
        for k, (order, lag) in enumerate(zip(self.orders, self.lags, strict=True)):
            gain = transfer(omega, order)
            if k >= first_alone:
                gain = gain * torque / (1 + 1j * omega * lag) ** 2
            elif lag:
                gain = gain * (1 - torque * (1 - 1 / (1 + 1j * omega * lag)))
            out.append(gain)
        return out

    def _seen_torque(self, transfer: Transfer, omega: Array) -> NDArray[np.inexact] | float:
        """Gain from the transmission torque to what effects see of it.

        That is the torque in its own band, where what it lacks in the observer's band is added
        (`flexviz.model.equation.motions`).
        """
        if not (any(self.lags) or self.alone) or self.seen == np.inf:
            return 1.0
        own = ButterworthZeroPhase(self.seen).transfer(omega, 0) if self.seen else 0.0
        return own + transfer(omega, 0) * (1 - own)


@dataclass(frozen=True)
class NoisePath:
    """Path of the white noise of some sensors through the equation.

    Attributes:
        sensor: THETA or TAU.
        joints: shape (m,), joints of the sensors.
        matrices: shape (D, N, n, m), sensitivity of r to each derivative of the noise.
        derivatives: which ones, and through which low-pass.
    """

    sensor: int
    joints: Indices
    matrices: Array
    derivatives: NoiseDerivatives

    def rows(self, rows: slice) -> NoisePath:
        """The path at some of the samples."""
        return replace(self, matrices=self.matrices[:, rows])

    def by_bandwidth(self, observer: Observer) -> Iterator[tuple[NoisePath, Observer]]:
        """The path of the sensors of each bandwidth, with the observer of these sensors' signals."""
        if isinstance(observer.bandwidth, float):  # the observer itself: kernels are kept by it
            yield self, observer.torque if self.sensor == TAU else observer
            return
        widths = observer.bandwidth_of(self.matrices.shape[2])[self.joints]
        for width in np.unique(widths):
            kept = widths == width
            one = observer.for_bandwidth(float(width))
            path = replace(self, joints=self.joints[kept], matrices=self.matrices[..., kept])
            yield path, one.torque if self.sensor == TAU else one

    def variance(self, noise: tuple[Array, Array]) -> Array:
        """Variance of the raw samples, shape (m,), from standard deviations of θ and τ, shape (n,) each."""
        return noise[self.sensor][self.joints] ** 2


def noise_paths(layout: Layout, x: Array, link: LinkTerms) -> list[NoisePath]:
    """All paths of the sensor noise into the residual, from the rigid-body terms at N samples.

    A damped joint, K δ + D δ̇ = s, low-passes the noise of s with the time constant D/K: hardly any noise
    reaches the deflection at the high frequencies that its second derivative amplifies. What a spring whose
    compliance changes with the load bends differently from a linear one follows from the torque that effects
    see.
    """
    compliance, lag = local_compliance(layout, x, link.torque), time_constants(layout, x)
    direct, elastic = signal_sensitivity(layout, x, link, compliance)
    share = compliance / x[layout.compliance] if compliance.ndim == 2 else None
    return [
        path_through(
            sensor, joints, direct[sensor], elastic[sensor], float(lag[joints[0]]), link.seen,
            None if share is None else share[:, joints[0]],
        )
        for sensor, joints in _kinds(layout)
    ]  # fmt: skip


def path_through(
    sensor: int,
    joints: Indices,
    direct: Array,
    elastic: Array,
    lag: float,
    seen: Array | None,
    share: Array | None = None,
) -> NoisePath:
    """Path of the sensors of joints that are linear springs, or of one that is damped or nonlinear.

    Args:
        sensor: THETA or TAU.
        joints: shape (m,).
        direct, elastic: parts of the sensitivity of this sensor (`signal_sensitivity`), shape (D, N, n, n).
        lag: time constant D/K [s]; 0 without damping.
        seen: as in `LinkTerms`.
        share: shape (N,), compliance under the load relative to that without; None or 1 if it is constant.
    """
    mine, through = direct[..., joints], elastic[..., joints]
    plain, depth = NoiseDerivatives.plain(len(direct)), len(direct)
    band = np.inf if seen is None else float(seen[joints[0]])
    if lag:
        derivatives = NoiseDerivatives(plain.orders * 2, plain.lags + (lag,) * depth, band)
    elif share is not None and np.any(share != 1.0):
        linear = through / share[:, None, None]
        mine, through = mine + linear, through - linear
        derivatives = NoiseDerivatives(plain.orders * 2, plain.lags * 2, band, depth)
    else:
        return NoisePath(sensor, joints, mine + through, plain)
    return NoisePath(sensor, joints, np.concatenate((mine, through)), derivatives)


def instrument_paths(layout: Layout, x: Array, link: LinkTerms) -> list[tuple[Indices, NoisePath]]:
    """Paths of the noise of joint j's sensors into ∂r/∂c_j and ∂r/∂D_j.

    c_j and D_j change r through the elasticity c/(1 + iωDc) of joint j only, so that no other sensors matter.
    As in the Jacobian, the column of c_j is that of the spring alone; the column of D_j contains −iωc²/(1 +
    iωDc)². The other parameters multiply signals with little noise.

    Returns:
        (index of the parameters, shape (m,); noise path of the sensors of their joints) each.
    """
    lag = time_constants(layout, x)
    _, elastic = signal_sensitivity(layout, x, link, np.ones(layout.n))
    damping = {e.joint: at.start for e, at in layout.effect_slices() if EFFECTS[e.effect].damps_deflection}
    out = []
    for sensor, joints in _kinds(layout):
        plain = NoiseDerivatives.plain(DEPTH[sensor])
        spring = NoisePath(sensor, joints, elastic[sensor][..., joints], plain)
        out.append((layout.compliance.start + joints, spring))
        for j in sorted(set(joints) & set(damping)):
            one, compliance = np.array([j]), x[layout.compliance][j]
            matrices = -(compliance**2) * elastic[sensor][..., one]
            higher, delay = tuple(k + 1 for k in plain.orders), (float(lag[j]),) * DEPTH[sensor]
            band = np.inf if link.seen is None else float(link.seen[j])
            path = NoisePath(sensor, one, matrices, NoiseDerivatives(higher, delay, band, len(higher)))
            out.append((np.array([damping[j]]), path))
    return out


def noise_density(
    paths: Sequence[NoisePath],
    noise: tuple[Array, Array],
    transfer: Transfer,
    step: float,
    hertz: Array,
) -> Array:
    """One-sided spectral density of the residual due to white measurement noise, in closed form.

    The sensitivities vary slowly compared with the noise, so that their mean products weight each frequency.

    Args:
        paths: noise paths into the residual.
        noise: standard deviations of θ and τ per raw sample, shape (n,) each.
        transfer: (ω, k) → gain from the raw signal to its filtered k-th derivative.
        step: step of the raw samples [s].
        hertz: shape (F,).

    Returns:
        shape (F, n) [Nm²/Hz].
    """
    omega: Array = 2 * np.pi * hertz
    total = np.zeros((len(hertz), len(noise[0])))
    for path in paths:
        scaled = (path.matrices * np.sqrt(path.variance(noise))).transpose(2, 0, 1, 3)
        flat = scaled.reshape(*scaled.shape[:2], -1)  # (n, D, N m)
        products = flat @ flat.transpose(0, 2, 1) / path.matrices.shape[1]
        gain = np.array(path.derivatives.gains(transfer, omega))
        total += np.einsum("ijf,jf->fi", products @ gain, gain.conj()).real
    return 2 * step * total


def _kinds(layout: Layout) -> list[tuple[int, Indices]]:
    """(sensor, joints) with a common noise path: those that are linear springs together, each other alone."""
    elastic = (e.joint for e in layout.effects if EFFECTS[e.effect].absorbed_by_stiffness)
    other = {j for j in elastic if j is not None}
    plain = np.array([j for j in range(layout.n) if j not in other], int)
    kinds = [plain] if plain.size else []
    kinds += [np.array([j]) for j in sorted(other)]
    return [(sensor, joints) for sensor in range(len(DEPTH)) for joints in kinds]


Sensitivity = tuple[Array, Array]  # ∂r/∂θ^(k) (5, N, n, n) [Nm s^k/rad], ∂r/∂τ^(k) (3, N, n, n) [s^k]


def signal_sensitivity(
    layout: Layout, x: Array, link: LinkTerms, compliance: Array
) -> tuple[Sensitivity, Sensitivity]:
    """The direct part of the sensitivity to the signals, and the part through the elasticity of the joints.

    From s = τ − Bθ̈ − f_mv θ̇, q = θ − c s and r = s − YΓ − f_lv q̇, with L₀ = ∂(YΓ)/∂q, L₁ = ∂(YΓ)/∂q̇ +
    f_lv, L₂ = M: δr = δs − Σ_k L_k δq^(k), where c may change with the load (`compliance`, shape (N, n) or
    (n,)). Other sensitivities through the effects are neglected.
    """
    inertia, viscous = layout.motor_side(x)
    compliance = np.broadcast_to(compliance, (len(link.mass), layout.n))[:, None]
    levels = (link.dq, link.dv + np.diag(x[layout.link_viscous]), link.mass)
    theta, tau = (np.zeros((depth, *link.mass.shape)) for depth in DEPTH)
    through_theta, through_tau = np.zeros_like(theta), np.zeros_like(tau)
    tau[0] += np.eye(layout.n)
    theta[1] -= np.diag(viscous)
    theta[2] -= np.diag(inertia)
    # the torque of a joint without one is predicted from the motor's angle: the link's inertia times θ̈
    moved = np.where(layout.fitted, inertia, -link.mass.diagonal(axis1=1, axis2=2))[:, None]
    for k, level in enumerate(levels):
        theta[k] -= level
        through_tau[k] += level * compliance
        through_theta[k + 1] -= level * (compliance * viscous)
        through_theta[k + 2] -= level * (compliance * moved)
    return (theta, tau), (through_theta, through_tau)
