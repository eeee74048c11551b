"""Which motion or payload would tell two effects apart: where their signatures differ most per sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.effects import ChosenEffect

Array = NDArray[np.float64]

CLEAR = 1.5  # times the average density, or no kind of motion is better than another
FEWEST = 0.02  # of the samples


def breaking(context: FitContext, fit: Fit, effect: ChosenEffect, mine: Array, other: Array) -> str:
    """A sentence naming the motion or payload in which two signatures differ most; "" where none stands out.

    Args:
        context: the data.
        fit: at which the signatures were made.
        effect: whose joint is looked at.
        mine, other: shape (N·n,), unit signatures.
    """
    difference = mine - float(mine @ other) * other
    squares = difference.reshape(fit.point.r.shape) ** 2
    density = squares.sum(axis=1)
    used = fit.point.used
    if density[used].sum() <= 1e-12:
        return "The two look the same in every motion of this set; a motion of another kind would be needed."
    signals = context.two_band.narrow.signals
    joint = effect.joint if effect.joint is not None else int(np.argmax(squares.sum(axis=0)))
    name = fit.layout.joints[joint]
    velocity, load = signals.theta[1, :, joint], np.abs(signals.tau[0, :, joint])
    acceleration, position = np.abs(signals.theta[2, :, joint]), signals.theta[0, :, joint]
    speed = np.abs(velocity)
    low, high = np.quantile(position, [0.15, 0.85])
    kinds: dict[str, NDArray[np.bool_]] = {
        f"slow motion and reversals of {name}": speed < np.quantile(speed, 0.15),
        f"fast motion of {name}": speed > np.quantile(speed, 0.85),
        f"high torque on {name}": load > np.quantile(load, 0.85),
        f"torque near zero on {name}": load < np.quantile(load, 0.15),
        f"strong acceleration of {name}": acceleration > np.quantile(acceleration, 0.85),
        f"positions of {name} near {low:.2g} rad": position < low,
        f"positions of {name} near {high:.2g} rad": position > high,
    }
    for k, group in enumerate(signals.groups):
        rows = np.zeros(signals.count, bool)
        for block in signals.blocks:
            if block.group == k:
                rows[block.rows] = True
        kinds[f"motion and payload of group {group.name} (payload {group.payload})"] = rows
    average = density[used].mean()
    ranked = sorted(
        ((float(density[k & used].mean() / average), text) for text, k in kinds.items()
         if np.count_nonzero(k & used) > FEWEST * len(used)),
        reverse=True,
    )  # fmt: skip
    if not ranked or ranked[0][0] < CLEAR:
        return "They differ a little in every motion; more data of any kind would help."
    ratio, text = ranked[0]
    return f"They differ most in {text} ({ratio:.1f} times the average): record more of that."
