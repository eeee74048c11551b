"""The interval of an episode, found in closed form over all pairs of instants.

A box in time is the difference of two steps. With the steps' weighted signatures at all candidate instants
(and what the model can do taken out of them), the gain of every pair follows from their Gram matrix.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.equation import Equation

Array = NDArray[np.float64]

INSTANTS = 100  # in a group
CLOSEST = 0.1  # [s] between candidate instants
SHORTEST = 0.2  # [s]


@dataclass(frozen=True)
class Interval:
    """A torque during part of a group.

    Attributes:
        torque: [Nm].
        start, end: in the group's own time [s].
        gain: fall of the weighted sum of squares.
    """

    torque: float
    start: float
    end: float
    gain: float


def best_interval(
    equation: Equation,
    joint: int,
    group: str,
    weigh: Callable[[Array], Array],
    rest: Callable[[Array], Array],
    residual: Array,
) -> Interval | None:
    """The interval in which a torque on a joint explains most; None where nothing of the group is there.

    Args:
        equation: prepared at the present parameters.
        joint: index in the set's joint order.
        group: the group's name.
        weigh: (N, n, C) → (M, C), weighted as `residual`.
        rest: takes out of (M, C) what the model's own parameters can do.
        residual: shape (M,).
    """
    sig = equation.signals
    blocks = [k for k, b in enumerate(sig.blocks) if sig.groups[b.group].name == group]
    if not blocks:
        return None
    time = np.concatenate([sig.time[sig.blocks[k].rows] for k in blocks])
    instants = np.arange(time.min(), time.max(), max(CLOSEST, float(np.ptp(time)) / INSTANTS))
    columns = np.zeros((sig.count, equation.layout.n, len(instants)))
    motions = equation.context.motions(joint)
    for k in blocks:
        fine = motions[k].time
        steps = np.clip((fine - instants[:, None]) / (fine[1] - fine[0]) + 0.5, 0.0, 1.0)
        # T on the link side: r gains the filtered step
        columns[sig.blocks[k].rows, joint] = equation.context.filtered_block(k, steps, joint, 1)[:, 0].T
    weighed = rest(weigh(columns))
    gram, along = weighed.T @ weighed, weighed.T @ residual
    first, last = np.triu_indices(len(instants), 1)
    long = instants[last] - instants[first] >= SHORTEST
    first, last = first[long], last[long]
    if not len(first):
        return None
    norm = np.maximum(gram[first, first] + gram[last, last] - 2 * gram[first, last], 1e-9 * gram.max())
    share = along[first] - along[last]
    best = int(np.argmax(share**2 / norm))
    return Interval(
        torque=float(-share[best] / norm[best]),
        start=float(instants[first[best]]),
        end=float(instants[last[best]]),
        gain=float(share[best] ** 2 / norm[best]),
    )
