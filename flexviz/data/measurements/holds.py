"""Static tests: an arm that is held at poses, with weights, or pushed against a clamp, motor side only.

At rest only the spring, gravity and static friction act: τ = s + f and θ = q + s/K. Where the link cannot
move, q is constant, and θ follows the pushes along 1/K; f lies within ± the breakaway torque, at the side
from which the motor came to rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexviz.robot.robot import PayloadBody

Array = NDArray[Any]

SHORTEST_HOLD = 0.3  # [s] of rest that counts as a hold
SETTLING = 0.1  # [s] at its begin that do not count
ONE_ROW = 0.2  # [s] between rows, from which every row is a hold, averaged already
STILL = 8.0  # standard deviations of θ within which a joint rests
LEAST_STEP = 0.05  # of a joint's largest step between holds, below which it has not moved


@dataclass(frozen=True, eq=False)
class Holds:
    """The holds of one table, H of them, n joints.

    Attributes:
        time: (H,) when each began [s].
        theta, tau: (H, n) means over each hold [rad], [Nm].
        approach: (H, n) direction in which each motor came to rest, 1 or −1; 0 where it has not moved since
            the hold before, or swung back, so that friction may be anything within its dead band.
    """

    time: Array
    theta: Array
    tau: Array
    approach: Array

    @property
    def count(self) -> int:
        """Number of holds."""
        return len(self.time)

    @property
    def steps(self) -> Array:
        """Direction of each motor's way from the hold before, 1 or −1; 0 where it has not moved; (H, n)."""
        way = np.diff(self.theta, axis=0, prepend=self.theta[:1])
        return np.sign(way) * (np.abs(way) > LEAST_STEP * np.abs(way).max(axis=0, initial=0.0))

    def slid(self, joint: int) -> NDArray[np.bool_]:
        """Holds before which a motor has gone two ways in the direction from which it came, (H,).

        On the first way after a turn, friction may not have turned round altogether.
        """
        steps, out, last = self.steps[:, joint], np.zeros(self.count, bool), 0.0
        for k in np.flatnonzero(steps):
            out[k], last = self.approach[k, joint] == steps[k] == last, steps[k]
        return out


@dataclass(frozen=True, eq=False)
class HoldGroup:
    """One static test with one known payload.

    Attributes:
        name, payload, bodies, file: as of a group.
        holds: what was held.
        clamped: (n,) joints whose link cannot move.
    """

    name: str
    payload: str
    bodies: tuple[PayloadBody, ...]
    file: Path
    holds: Holds
    clamped: NDArray[np.bool_]


def find_holds(time: Array, theta: Array, tau: Array, approach: Array | None = None) -> Holds:
    """Holds of a table, (N,), (N, n), (N, n): the means over its rests, or its rows if they are that already.

    `approach`: (N, n), where it is stated; else it is the direction in which a motor moved last.
    """
    if len(time) < 2 or float(np.median(np.diff(time))) >= ONE_ROW:
        found = Holds(time, theta, tau, np.zeros_like(theta))
    else:
        found = _averaged(time, theta, tau)
    if approach is not None:
        rows = np.searchsorted(time, found.time)
        return Holds(found.time, found.theta, found.tau, np.sign(approach[rows]))
    steps = found.steps
    own = np.where(found.approach == steps, steps, 0.0) if found.approach.any() else steps
    return Holds(found.time, found.theta, found.tau, own)


def _averaged(time: Array, theta: Array, tau: Array) -> Holds:
    """Means over the rests of a recording."""
    step = float(np.median(np.diff(time)))
    width = max(3, round(SHORTEST_HOLD / step))
    rough = np.median(np.abs(np.diff(theta, axis=0)), axis=0) / 0.6745 / np.sqrt(2)
    resolution = [np.diff(np.unique(column)).min(initial=np.inf) for column in theta.T]
    sigma = np.maximum(rough, np.where(np.isfinite(resolution), resolution, 0.0) / np.sqrt(12))
    windows = np.lib.stride_tricks.sliding_window_view(theta, width, axis=0)
    calm = np.all(np.ptp(windows, axis=2) <= STILL * np.maximum(sigma, 1e-12), axis=1)
    rests, k = [], 0
    while k < len(calm):
        if calm[k]:
            end = k + int(np.argmin(calm[k:])) if not calm[k:].all() else len(calm)
            rests.append((k, end - 1 + width))
            k = end - 1 + width
        else:
            k += 1
    skipped = round(SETTLING / step)
    parts = [slice(a + min(skipped, (b - a) // 3), b) for a, b in rests]
    means = [np.array([x[p].mean(axis=0) for p in parts]).reshape(-1, theta.shape[1]) for x in (theta, tau)]
    approach = np.zeros((len(parts), theta.shape[1]))
    for k, part in enumerate(parts):
        since = 0 if k == 0 else parts[k - 1].stop
        before = theta[since : part.start]
        for j in range(theta.shape[1]):
            away = np.flatnonzero(np.abs(means[0][k, j] - before[:, j]) > STILL * sigma[j])
            if away.size:
                approach[k, j] = np.sign(means[0][k, j] - before[away[-1], j])
    return Holds(time[[p.start for p in parts]], means[0], means[1], approach)
