"""Unknown course of friction at reversals, as nuisance pulses in the residual.

While a velocity or torque passes zero, noise and the finest details of a reversal decide how friction changes
its side: for some milliseconds its torque is unknown. Each such stretch is described by pulses of unknown
size; fitted along with everything else, they cost a few samples at each reversal instead of spoiling the
whole fit. The initial state of a law with memory is unknown in the same way (`LawEffect.unknown`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import EFFECTS, JointMotion, LawEffect
from flexviz.equation.chain import Chain
from flexviz.equation.residual import OperatingPoint

Array = NDArray[np.float64]

SPACING = 0.01  # [s] between pulses
MAX_PULSES = 12  # in one stretch: what friction does at a long rest changes slowly
SHARE = 0.15  # of the change of u that is unknown on average between two pulses
SETTLED = 0.99  # u has reached this share of its full size on either side
SOURCES = {
    "velocity": 0.02,
    "link_velocity": 0.02,
    "torque": 0.02,
}  # [rad/s], [rad/s], share of the torque's rms


@dataclass(frozen=True)
class Pulses:
    """Unknown pulses of one stretch.

    Attributes:
        block: which stretch.
        columns: shape (N_block, n, M), ∂r for a pulse of one standard deviation.
    """

    block: int
    columns: Array


def pulses(point: OperatingPoint, x: Array, chain: Chain) -> list[Pulses]:
    """The pulses of every stretch that has some, for the rigid-body terms in `chain`."""
    sig, lay, context = point.signals, point.layout, point.context
    found: dict[int, list[Array]] = {}
    for effect, where in lay.effect_slices():
        law = EFFECTS[effect.effect]
        if not isinstance(law, LawEffect) or effect.joint is None or not np.any(x[where]):
            continue
        joint, values = effect.joint, x[where]
        depth = law.depth
        motions = context.motions(joint)
        for index, motion in enumerate(motions):
            times, sizes = (np.zeros(0), np.zeros(0)) if law.smooth else undecided(law, motion, values)
            step = motion.time[1] - motion.time[0]
            at = np.searchsorted(motion.time, times)
            filtered = context.pulses_block(index, at, joint, depth) * (sizes / step)[:, None, None]
            begun = law.unknown(motion, values)
            if len(begun):
                filtered = np.concatenate((filtered, context.filtered_block(index, begun, joint, depth)))
            if not len(filtered):
                continue
            rows = sig.blocks[index].rows
            columns = [chain.rows(rows).column(law.entry, (joint,), one[:, :, None]) for one in filtered]
            found.setdefault(index, []).append(np.stack(columns, axis=2))
    return [Pulses(index, np.concatenate(parts, axis=2)) for index, parts in sorted(found.items())]


def undecided(law: LawEffect, motion: JointMotion, values: Array) -> tuple[Array, Array]:
    """Instants of the pulses, shape (M,) [s], and their standard deviations (area of u), shape (M,)."""
    region, size = law.undecided(motion, values) or _jumps(law, motion, values)
    if not region.any():
        return np.zeros(0), np.zeros(0)
    step = motion.time[1] - motion.time[0]
    edges = np.flatnonzero(np.diff(np.r_[0, region.astype(int), 0]))
    times, sizes = [], []
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        first, last = motion.time[a] - SPACING / 2, motion.time[min(b, len(size)) - 1] + SPACING / 2
        count = min(max(2, int(np.ceil((last - first) / SPACING)) + 1), MAX_PULSES)
        grid = np.linspace(first, last, count)
        inside = (grid > motion.time[0]) & (grid < motion.time[-1])
        times.append(grid[inside])
        sizes.append(np.full(inside.sum(), SHARE * size[a:b].max() * (grid[1] - grid[0])))
    instants, order = np.unique(np.round(np.concatenate(times) / step) * step, return_index=True)
    return instants, np.concatenate(sizes)[order]


def _jumps(law: LawEffect, motion: JointMotion, values: Array) -> tuple[NDArray[np.bool_], Array]:
    """Where a law is between the two sides of a jump, and how high that is, shape (N,) each."""
    u = law.law(motion, values)[0]
    full = np.abs(u).max()
    region = np.zeros(len(u), bool)
    size = np.zeros(len(u))
    if full <= 0:
        return region, size
    for name, small in SOURCES.items():
        scale = motion.torque_scale if name == "torque" else 1.0
        signal = getattr(motion, name)
        up = law.law(replace(motion, **{name: signal + small * scale}), values)[0]
        down = law.law(replace(motion, **{name: signal - small * scale}), values)[0]
        swing = np.abs(up - down)
        steep = swing > 0.5 * full  # the law jumps within a small change of this signal
        # of those, the instants at which u is not on either side yet
        between = np.minimum(np.abs(u - up), np.abs(u - down)) > (1 - SETTLED) * np.maximum(swing, 1e-12)
        region |= steep & between
        size = np.maximum(size, np.where(steep, swing, 0.0))
    return region, size
