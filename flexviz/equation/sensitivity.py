"""How noise in the observer's outputs moves the residual."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.equation.layout import Layout
from flexviz.equation.link import LinkTerms

Array = NDArray[np.float64]


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
    n = layout.n
    compliance, inertia, viscous = x[layout.compliance], x[layout.motor_inertia], x[layout.motor_viscous]
    levels = (link.dq, link.dv + np.diag(x[layout.link_viscous]), link.mass)
    theta = np.zeros((5, *link.mass.shape))
    tau = np.zeros((3, *link.mass.shape))
    tau[0] += np.eye(n)
    theta[1] -= np.diag(viscous)
    theta[2] -= np.diag(inertia)
    for k, level in enumerate(levels):
        tau[k] += level * compliance
        theta[k] -= level
        theta[k + 1] -= level * (compliance * viscous)
        theta[k + 2] -= level * (compliance * inertia)
    return theta, tau
