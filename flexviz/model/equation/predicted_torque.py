"""The transmission torque of joints whose own torque is no signal, predicted from their motion.

s = Y(q, q̇, q̈) Γ + f_lv θ̇, where q = θ − c s follows by iteration. What the iteration adds is used up to half
the frequency at which the link swings on its spring: there, the motor's angle does not show the link's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexviz.base.arrays import Array
from flexviz.model.equation.layout import Layout
from flexviz.model.equation.link import LinkDynamics
from flexviz.model.equation.signals import Signals
from flexviz.model.equation.smoothing import derivatives, derivatives_below

PREDICTIONS = 3  # each lowers the error to a quarter, or less
POSES = 20  # at which inertias are computed


def predict_torques(
    s: Array,
    link: LinkDynamics,
    signals: Signals,
    layout: Layout,
    x: Array,
    bodies: Sequence[tuple[slice, Array]],
) -> None:
    """Write s and its derivatives, (3, N, n) [Nm/s^k], of the joints without a torque.

    `bodies`: rows and inertial parameters with payload, (n, 10), of each block.
    """
    left_out = list(layout.no_torque)
    straight = x[layout.link_viscous][left_out] * signals.theta[1:4, :, left_out]
    rigid = np.empty((signals.count, len(left_out)))
    swinging = 1 / np.sqrt(x[layout.compliance][left_out] * _moved(link, signals, layout, x))  # [rad/s]
    for k in range(PREDICTIONS):
        q = signals.theta[:3] - x[layout.compliance] * s * (k > 0)
        for block, (rows, inertial) in zip(signals.blocks, bodies, strict=True):
            torque = link.torque(inertial, *q[:, rows])[:, left_out]
            step = block.segment.step * block.stride
            if k == 0:
                straight[:, rows] += derivatives(torque, step)
                rigid[rows] = torque
                s[:, rows, left_out] = straight[:, rows]
                continue
            more = derivatives_below(torque - rigid[rows], step, 0.5 * swinging)
            s[:, rows, left_out] = straight[:, rows] + more


def _moved(link: LinkDynamics, signals: Signals, layout: Layout, x: Array) -> Array:
    """Largest inertia that each of these joints moves, of a few poses, shape (m,) [kg m²]."""
    joints = list(layout.no_torque)
    inertial = x[layout.inertial].reshape(layout.n, 10) + signals.payload.max(axis=0)
    q = signals.theta[0, :: max(1, signals.count // POSES)]
    still = np.zeros_like(q)
    rest = link.torque(inertial, q, still, still)
    pushed = (link.torque(inertial, q, still, still + one) for one in np.eye(layout.n)[joints])
    moved = [np.max((torque - rest)[:, j]) for j, torque in zip(joints, pushed, strict=True)]
    return np.maximum(moved, 1e-9)
