"""Derivative of the residual by transmission torque and link position."""

from __future__ import annotations

from copy import copy

import numpy as np

from flexviz.base.arrays import Array
from flexviz.model.effects import EFFECTS
from flexviz.model.equation.layout import Layout
from flexviz.model.equation.link import LinkTerms


def time_constants(layout: Layout, x: Array) -> Array:
    """D/K of the damped joints, 0 of the others, shape (n,) [s]."""
    out = np.zeros(layout.n)
    for effect, where in layout.effect_slices():
        law = EFFECTS[effect.effect]
        if law.damps_deflection and effect.joint is not None:
            out[effect.joint] = law.time_constant(x[where], x[layout.compliance][effect.joint])
    return out


def local_compliance(layout: Layout, x: Array, torque: Array | None) -> Array:
    """∂δ/∂s of the joints under a transmission torque (N, n) [Nm]: shape (N, n), or (n,) if it is constant.

    Where the torque is not known (None), joints count as linear.
    """
    own = x[layout.compliance]
    bent = None
    for effect, where in layout.effect_slices():
        j, law = effect.joint, EFFECTS[effect.effect]
        if torque is None or j is None:
            continue
        share = law.softness(x[where], torque[:, j], float(own[j]))
        if not isinstance(share, float):
            bent = np.tile(own, (len(torque), 1)) if bent is None else bent
            bent[:, j] *= share
    return own if bent is None else bent


class Chain:
    """Change of r with s or q at given rigid-body terms.

    Args:
        compliance: shape (n,), or (N, n) of joints whose compliance changes with the load [rad/Nm].
        link_viscous: shape (n,) [Nm s/rad].
        link: rigid-body terms at N samples.
    """

    def __init__(self, compliance: Array, link_viscous: Array, link: LinkTerms) -> None:
        self._compliance = compliance
        self._dq, self._mass = link.dq, link.mass
        self._damping = link.dv + np.diag(link_viscous)

    def rows(self, rows: slice) -> Chain:
        """The same for some of the samples."""
        part = copy(self)
        part._dq, part._mass, part._damping = self._dq[rows], self._mass[rows], self._damping[rows]
        if self._compliance.ndim == 2:
            part._compliance = self._compliance[rows]
        return part

    def of_pulses(self, time: Array, at: Array, j: int) -> tuple[Array, Array]:
        """Pulses of q of joint j whose products with the pose are formed before they are filtered.

        M(t) δ̈(t − t₀) = M(t₀) δ̈ − 2 Ṁ(t₀) δ̇ + M̈(t₀) δ, and so on, for samples at `time` (N,) [s] and t₀ in
        `at` (P,) [s]: factors of the filtered δ, δ̇ and δ̈ in −∂r, shape (3, P, n), and the compliance (P,).
        """
        nearest = np.clip(np.round((at - time[0]) / (time[1] - time[0])).astype(int), 0, len(time) - 1)
        past = at - time[nearest]
        past = np.where(np.abs(past) < time[1] - time[0], past, 0.0)[:, None]

        def there(values: Array) -> tuple[Array, Array, Array]:
            """Values (N, n) and two derivatives at the pulses."""
            rate = np.gradient(values, time, axis=0)
            bend = np.gradient(rate, time, axis=0)[nearest]
            rate = rate[nearest] + past * bend
            return values[nearest] + past * rate - 0.5 * past**2 * bend, rate, bend

        mass, mass_rate, mass_bend = there(self._mass[:, :, j])
        damping, damping_rate, _ = there(self._damping[:, :, j])
        dq = there(self._dq[:, :, j])[0]
        factors = np.stack((dq - damping_rate + mass_bend, damping - 2 * mass_rate, mass))
        compliance = self._compliance[..., j]
        return factors, compliance[nearest] if compliance.ndim else np.full(len(at), compliance)

    def pulses(self, u: Array | None, bends: Array, j: int, time: Array, at: Array) -> Array:
        """∂r for the pulses of `of_pulses`, shape (N, n, P).

        Args:
            u: shape (P, 3, N), subtracted from s of joint j; None: `bends` are added to its q.
            bends: shape (P, 3, N), what bends the joint.
            j, time, at: as in `of_pulses`.
        """
        factors, compliance = self.of_pulses(time, at, j)
        if u is not None:
            factors *= compliance[:, None]
        out: Array = -np.einsum("dpi,pdt->tip", factors, bends)
        if u is not None:
            out[:, j] -= u[:, 0].T
        return out

    def column(self, entry: str, joints: tuple[int, ...], u: Array) -> Array:
        """∂r for u, shape (D, N, m), that enters at the m joints: shape (N, n)."""
        return self.columns(entry, joints, u[None])[..., 0]

    def columns(self, entry: str, joints: tuple[int, ...], u: Array, bends: Array | None = None) -> Array:
        """∂r for several u, shape (P, D, N, m): shape (N, n, P).

        `bends`: likewise, what bends the joints where u is a torque; default: u itself.
        """
        out = np.zeros((*self._mass.shape[:2], len(u)))
        bends = u if bends is None else bends
        for k, j in enumerate(joints):
            if entry in ("torque", "deflection"):
                moved = self._compliance[..., j] * bends[..., k] if entry == "torque" else u[..., k]
                for d, factor in enumerate((self._dq, self._damping, self._mass)):
                    out -= factor[:, :, j, None] * moved[:, d].T[:, None]
            if entry != "deflection":
                out[:, j] -= u[:, 0, :, k].T
        return out
