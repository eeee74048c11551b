"""An episode: a torque on one joint during part of one group, found in closed form over all intervals.

A box in time is the difference of two steps. With the steps' weighted signatures at all candidate instants
(and what the model can do taken out of them), the gain of every pair follows from their Gram matrix.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import ChosenEffect, Guess
from flexviz.equation import Equation
from flexviz.identification.scoring import Scored, beside

Array = NDArray[np.float64]

EVERY = 0.1  # [s] between candidate instants
SHORTEST = 0.2  # [s]
LONGEST_SHARE = 0.6  # of the group: a torque that acts most of the time is no episode


def contacts(
    equation: Equation,
    weigh: Callable[[Array], Array],
    residual: Array,
    instruments: Array,
    hessian: Array,
) -> list[Scored]:
    """The best interval of every joint and group.

    Args:
        equation: prepared at the present parameters.
        weigh: (N, n, C) → (M, C), weighted as `residual`.
        residual: shape (M,).
        instruments: shape (M, P).
        hessian: shape (P, P).
    """
    sig, n = equation.signals, equation.layout.n
    rest = beside(instruments, hessian)
    out = []
    for index, block in enumerate(sig.blocks):
        group = sig.groups[block.group]
        time = sig.time[block.rows]
        instants = np.arange(time[0], time[-1], EVERY)
        fine = equation.context.motions(0)[index].time
        step = fine[1] - fine[0]
        steps = np.clip((fine - instants[:, None]) / step + 0.5, 0.0, 1.0)
        for joint in range(n):
            # −T on the link side of one joint: r gains the filtered step
            filtered = equation.context.filtered_block(index, steps, joint, 1)[:, 0]
            columns = np.zeros((sig.count, n, len(instants)))
            columns[block.rows, joint] = filtered.T
            weighed = rest(weigh(columns))
            gram, along = weighed.T @ weighed, weighed.T @ residual
            first, last = np.triu_indices(len(instants), 1)
            length = instants[last] - instants[first]
            fits = (length >= SHORTEST) & (length <= LONGEST_SHARE * (time[-1] - time[0]))
            first, last = first[fits], last[fits]
            if not len(first):
                continue
            norm = gram[first, first] + gram[last, last] - 2 * gram[first, last]
            share = along[first] - along[last]
            gain = share**2 / np.maximum(norm, 1e-9 * gram.max())
            best = int(np.argmax(gain))
            a, b = first[best], last[best]
            torque = -share[best] / norm[best]
            values = np.array([torque, instants[a], instants[b]])
            signature = (weighed[:, a] - weighed[:, b]) * torque
            effect = ChosenEffect("external_contact", joint, group.name)
            guess = Guess("residual", (joint,), np.zeros((1, 1, 1, 1)), lambda c: c, "interval")
            length_of = float(np.linalg.norm(signature))
            out.append(Scored(effect, guess, float(gain[best]), values, signature / max(length_of, 1e-300)))
    return out
