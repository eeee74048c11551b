"""What effects make of a joint's linear spring: its compliance under load, and what damping delays."""

from __future__ import annotations

import numpy as np

from flexviz.arrays import Array
from flexviz.effects import EFFECTS
from flexviz.equation.layout import Layout


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
