"""Linear recurrences of friction with memory."""

from __future__ import annotations

import numpy as np

from flexviz.effects.terms import Array


def chained(factor: Array, offset: Array) -> Array:
    """x_{k+1} = factor_k x_k + offset_k from x_0 = 0: shape (R,) → (R + 1,); maps composed by doubling."""
    factor, offset, reach = factor.copy(), offset.copy(), 1
    while reach < len(factor):
        offset[reach:] += factor[reach:] * offset[:-reach]
        factor[reach:] = factor[reach:] * factor[:-reach]
        reach *= 2
    return np.concatenate(([0.0], offset))
