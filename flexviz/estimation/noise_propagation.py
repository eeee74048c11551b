"""Propagation of sensor noise through the equation into the residual."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import EFFECTS
from flexviz.equation import Layout, LinkTerms

Array = NDArray[np.float64]
Transfer = Callable[[Array, int], Array]  # (ω, k) → complex gain to the k-th derivative

THETA, TAU = 0, 1
DEPTH = (5, 3)  # derivatives of each that the equation uses


@dataclass(frozen=True)
class NoisePath:
    """Path of the white noise of some sensors through the equation.

    Attributes:
        sensor: THETA or TAU.
        joints: shape (m,), whose sensors.
        matrices: shape (D, N, n, m), ∂r over what the noise has become.
        orders: shape (D,), which derivative that is.
        lags: shape (D,), time constant of the low-pass that it passes besides the observer [s]; 0 for none.
        alone: nothing passes but through a damped joint's slope, 1/(1 + iω·lag)².
    """

    sensor: int
    joints: NDArray[np.intp]
    matrices: Array
    orders: tuple[int, ...]
    lags: tuple[float, ...]
    alone: bool = False

    def rows(self, rows: slice) -> NoisePath:
        """The same for some of the samples."""
        return replace(self, matrices=self.matrices[:, rows])

    def variance(self, noise: tuple[Array, Array]) -> Array:
        """Of its sensors' raw samples, shape (m,), from standard deviations of θ and τ, shape (n,) each."""
        return noise[self.sensor][self.joints] ** 2

    def gains(self, transfer: Transfer, omega: Array) -> Sequence[NDArray[np.inexact]]:
        """From the raw samples to each of its D derivatives, complex, shape (F,) each.

        What a damped joint lacks against its spring alone is computed from filtered signals and, as every
        law's, filtered once more.
        """
        passed = transfer(omega, 0)
        if self.alone:
            passes = [passed / (1 + 1j * omega * lag) ** 2 for lag in self.lags]
            return [transfer(omega, k) * share for k, share in zip(self.orders, passes, strict=True)]
        lacking = [passed * (1 - 1 / (1 + 1j * omega * lag)) for lag in self.lags]
        return [transfer(omega, k) * (1 - lost) for k, lost in zip(self.orders, lacking, strict=True)]


def signal_sensitivity(layout: Layout, x: Array, link: LinkTerms) -> tuple[Array, Array]:
    """∂r/∂θ^(k) and ∂r/∂τ^(k) at every sample.

    From s = τ − Bθ̈ − f_mv θ̇, q = θ − c s and r = s − YΓ − f_lv q̇, with L₀ = ∂(YΓ)/∂q, L₁ = ∂(YΓ)/∂q̇ +
    f_lv, L₂ = M: δr = δs − Σ_k L_k δq^(k). What the effects' own columns add is left out.

    Args:
        layout: of the vector.
        x: shape (P,).
        link: the rigid-body terms at N samples.

    Returns:
        shape (5, N, n, n) [Nm s^k/rad] and shape (3, N, n, n) [s^k].
    """
    direct, elastic = _parts(layout, x, link)
    return direct[THETA] + elastic[THETA], direct[TAU] + elastic[TAU]


def time_constants(layout: Layout, x: Array) -> Array:
    """D/K of the damped joints, 0 of the others, shape (n,) [s]."""
    out = np.zeros(layout.n)
    for effect, where in layout.effect_slices():
        law = EFFECTS[effect.effect]
        if law.damps_deflection and effect.joint is not None:
            out[effect.joint] = law.time_constant(x[where], x[layout.compliance][effect.joint])
    return out


def noise_paths(layout: Layout, x: Array, link: LinkTerms) -> list[NoisePath]:
    """All paths of the sensors' noise into the residual.

    A damped joint, K δ + D δ̇ = s, passes the noise of s on to its deflection through a low-pass with the time
    constant D/K: at the frequencies that two derivatives of it raise, hardly anything of it arrives.

    Args:
        layout: of the vector.
        x: shape (P,).
        link: the rigid-body terms at N samples.
    """
    direct, elastic = _parts(layout, x, link)
    lag = time_constants(layout, x)
    out = []
    for sensor, joints in _kinds(lag):
        orders = tuple(range(DEPTH[sensor]))
        mine, through = (part[sensor][..., joints] for part in (direct, elastic))
        delay = (float(lag[joints[0]]),) * len(orders)
        if lag[joints[0]] == 0.0:
            out.append(NoisePath(sensor, joints, mine + through, orders, delay))
        else:
            both, none = np.concatenate((mine, through)), (0.0,) * len(orders)
            out.append(NoisePath(sensor, joints, both, orders * 2, none + delay))
    return out


def instrument_paths(layout: Layout, x: Array, link: LinkTerms) -> list[tuple[NDArray[np.intp], NoisePath]]:
    """The paths of the sensors' noise into ∂r/∂c_j and ∂r/∂D_j, of joint j's sensors into its own columns.

    c_j and D_j move r by what goes through joint j's elasticity: no other joint's sensors matter. That is
    c/(1 + iωDc) times what its torque is multiplied by. The column of c_j is that of the spring alone, as the
    Jacobian has it; that of D_j has −iωc²/(1 + iωDc)². Other parameters multiply what is measured well, or
    nothing measured.

    Args:
        layout: of the vector.
        x: shape (P,).
        link: the rigid-body terms at N samples.

    Returns:
        (which parameters, shape (m,), the path of their joints' sensors).
    """
    lag, unit = time_constants(layout, x), x.copy()
    unit[layout.compliance] = 1.0
    _, elastic = _parts(layout, unit, link)
    damping = {e.joint: at.start for e, at in layout.effect_slices() if EFFECTS[e.effect].damps_deflection}
    out = []
    for sensor, joints in _kinds(lag):
        orders, none = tuple(range(DEPTH[sensor])), (0.0,) * DEPTH[sensor]
        spring = NoisePath(sensor, joints, elastic[sensor][..., joints], orders, none)
        out.append((layout.compliance.start + joints, spring))
        for j in sorted(set(joints) & set(damping)):
            one, compliance = np.array([j]), x[layout.compliance][j]
            matrices = -(compliance**2) * elastic[sensor][..., one]
            higher, delay = tuple(k + 1 for k in orders), (float(lag[j]),) * len(orders)
            out.append((np.array([damping[j]]), NoisePath(sensor, one, matrices, higher, delay, True)))
    return out


def noise_density(
    paths: Sequence[NoisePath],
    noise: tuple[Array, Array],
    transfer: Transfer,
    step: float,
    hertz: Array,
) -> Array:
    """One-sided spectral density that white measurement noise leaves in the residual.

    The noise path is known in closed form, so that the floor is computed rather than estimated from one more
    noise replicate: it has no scatter of its own. The sensitivities change slowly against the noise, so
    that their mean products weigh each frequency.

    Args:
        paths: of the noise into the residual.
        noise: standard deviations of θ and τ a raw sample, shape (n,) each.
        transfer: (ω, k) → gain from the raw signals to what stands for their k-th derivative.
        step: of the raw samples [s].
        hertz: shape (F,).

    Returns:
        shape (F, n) [Nm²/Hz].
    """
    omega: Array = 2 * np.pi * hertz
    total = np.zeros((len(hertz), len(noise[0])))
    for path in paths:
        products = np.einsum("jtim,ktim,m->jki", path.matrices, path.matrices, path.variance(noise))
        products /= path.matrices.shape[1]
        gain = np.array(path.gains(transfer, omega))
        total += np.einsum("jf,kf,jki->fi", gain, gain.conj(), products).real
    return 2 * step * total


def _kinds(lag: Array) -> list[tuple[int, NDArray[np.intp]]]:
    """(sensor, joints) with a common noise path: all plain joints together, each damped one alone."""
    plain = np.flatnonzero(lag == 0.0)
    kinds = [plain] if plain.size else []
    kinds += [np.array([j]) for j in np.flatnonzero(lag)]
    return [(sensor, joints) for sensor in range(len(DEPTH)) for joints in kinds]


def _parts(layout: Layout, x: Array, link: LinkTerms) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """(∂r/∂θ^(k), ∂r/∂τ^(k)) without what goes through the joints' elasticity, and that."""
    compliance, inertia, viscous = x[layout.compliance], x[layout.motor_inertia], x[layout.motor_viscous]
    levels = (link.dq, link.dv + np.diag(x[layout.link_viscous]), link.mass)
    theta, tau = (np.zeros((depth, *link.mass.shape)) for depth in DEPTH)
    through_theta, through_tau = np.zeros_like(theta), np.zeros_like(tau)
    tau[0] += np.eye(layout.n)
    theta[1] -= np.diag(viscous)
    theta[2] -= np.diag(inertia)
    for k, level in enumerate(levels):
        theta[k] -= level
        through_tau[k] += level * compliance
        through_theta[k + 1] -= level * (compliance * viscous)
        through_theta[k + 2] -= level * (compliance * inertia)
    return (theta, tau), (through_theta, through_tau)
