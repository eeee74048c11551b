"""The interval of an episode, found in closed form over all pairs of instants.

A box in time is the difference of two steps. With the steps' weighted signatures at all candidate instants
(and what the model can do taken out of them), the gain of every pair follows from their Gram matrix.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import EFFECTS, ChosenEffect
from flexviz.equation import OperatingPoint
from flexviz.estimation.projection import Projection, Weigh
from flexviz.estimation.scoring import Scored

Array = NDArray[np.float64]

INSTANTS = 100  # in a group
CLOSEST = 0.1  # [s] between candidate instants
SHORTEST = 0.2  # [s]


def best_intervals(
    point: OperatingPoint,
    joint: int,
    weigh: Weigh,
    projection: Projection,
    *,
    group: str | None = None,
    longest: float = 1.0,
) -> list[Scored]:
    """The interval of every stretch in which a torque on a joint explains most, the best stretch first.

    Args:
        point: at the present parameters.
        joint: index in the set's joint order.
        weigh: weights columns as the projection's residual.
        projection: takes out what the model can do by itself.
        group: only in this one.
        longest: share of the stretch that an episode may fill.
    """
    episodes = [name for name, effect in EFFECTS.items() if effect.scope == "episode"]
    sig, n = point.signals, point.layout.n
    out = []
    for index, block in enumerate(sig.blocks):
        name = sig.groups[block.group].name
        if group is not None and name != group:
            continue
        time = sig.time[block.rows]
        length = float(np.ptp(time))
        instants = np.arange(time.min(), time.max(), max(CLOSEST, length / INSTANTS))
        # T on the link side: r gains the filtered step
        columns = np.zeros((len(time), n, len(instants)))
        columns[:, joint] = point.context.steps_block(index, instants, joint).T
        weighed = weigh(columns, index)
        rows = slice(block.rows.start * n, block.rows.stop * n)
        gram, along = projection.normal(weighed, rows)
        first, last = np.triu_indices(len(instants), 1)
        duration = instants[last] - instants[first]
        fits = (duration >= SHORTEST) & (duration <= longest * length + 1e-9)
        first, last = first[fits], last[fits]
        if not len(first):
            continue
        diagonal = np.diag(gram)
        norm = np.maximum(diagonal[first] + diagonal[last] - 2 * gram[first, last], 1e-9 * gram.max())
        share = along[first] - along[last]
        gain = share**2 / np.maximum(norm, 1e-300)
        best = int(np.argmax(gain))
        a, b = first[best], last[best]
        torque = -share[best] / max(float(norm[best]), 1e-300)
        values = np.array([torque, instants[a], instants[b]])
        signature = (weighed[:, a] - weighed[:, b]) * torque
        for episode in episodes:
            effect = ChosenEffect(episode, joint, name)
            out.append(Scored(effect, float(gain[best]), values, signature, rows))
    return sorted(out, key=lambda s: -s.gain)
