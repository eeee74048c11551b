"""What instruments and residual have in common: the noise that both contain.

The equations Zᵀ W r = 0 hold on average where the noise of Z has nothing to do with that of r. Of a
compliance that is not so: its column of the Jacobian, ∂r/∂c_j = Σ_k L_k e_j s_j^(k), holds the measured
torque and its derivatives. On a joint that carries much the motion outweighs their noise; on a light wrist it
does not, and the joint comes out several times too soft. The product's expectation follows from the noise as
the residual's own covariance does (`whitening`): what is solved is Zᵀ W r = b, b_j = E[z_jᵀ W r].
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.equation.sensitivity import NoiseWay
from flexviz.identification.whitening import Whitener

Array = NDArray[np.float64]

EVERY = 5  # samples: the expectation changes as slowly as the pose
MOST = 400  # samples of a stretch


def shared_noise(
    whitener: Whitener,
    instrument: NoiseWay,
    residual: NoiseWay,
    kernel: Array,
) -> Array:
    """Mean over a stretch of (W z_j)ᵀ W r from white noise of unit variance in the sensors of joints j.

    What is not known of reversals is left out: it concerns few samples. So is a stretch no longer than W's
    memory.

    Args:
        whitener: W of the stretch, N samples.
        instrument: way of the m sensors' noise into z, each into its own column, at the N samples.
        residual: of at least the same sensors into r.
        kernel: shape (2p + 1, D, E), covariance of what the ways' filters make of the noise
            (`shared_kernel`) at lags −p … p, p the samples that W looks back.

    Returns:
        shape (m,).
    """
    order, count = whitener.predictor.shape[:2]
    if count <= order:
        return np.zeros(len(instrument.joints))
    at = np.arange(order, count, max(EVERY, -(-(count - order) // MOST)))
    # W as one row of matrices: of the sample itself and of those before it
    weights = [whitener.scale[at]]
    weights += [-weights[0] @ matrix[at] for matrix in whitener.predictor]
    # E[z(t−l) r(t−m)] depends on m − l alone
    lags = order + np.arange(order + 1) - np.arange(order + 1)[:, None]
    size = (order + 1) * kernel.shape[1], (order + 1) * kernel.shape[2]
    toeplitz = kernel[lags].transpose(0, 2, 1, 3).reshape(size)
    same = np.searchsorted(residual.joints, instrument.joints)
    z, r = _weighted(weights, instrument.matrices, at), _weighted(weights, residual.matrices[..., same], at)
    product = np.einsum("ax,ax->x", z, toeplitz @ r)
    return product.reshape(-1, len(instrument.joints)).sum(axis=0) / len(at)


def _weighted(weights: list[Array], matrices: Array, at: NDArray[np.intp]) -> Array:
    """W times a way's matrices (D, N, n, m) at each sample and those before: shape ((p + 1)·D, T·n·m)."""
    passed = np.stack([weight @ matrices[:, at - k] for k, weight in enumerate(weights)])
    return passed.reshape(passed.shape[0] * passed.shape[1], -1)
