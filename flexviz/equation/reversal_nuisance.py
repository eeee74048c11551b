"""Unknown friction torque at reversals as nuisance pulses in the residual.

For some milliseconds around a zero crossing of velocity or torque, the friction torque depends on noise and
on details of the reversal and is unknown. Each such interval is described by pulses of unknown size, which
cost a few samples per reversal instead of biasing the fit. The initial state of a law with memory is treated
likewise (`LawEffect.unknown`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.effects import EFFECTS, JointMotion, LawEffect
from flexviz.equation.chain import Chain
from flexviz.equation.residual import OperatingPoint

Array = NDArray[np.float64]

PULSE_SPACING = 0.01  # [s]
MAX_PULSES = 12  # per interval: friction changes slowly during a long rest
UNKNOWN_SHARE = 0.15  # of the change of u that is unknown on average between two pulses
SETTLED_SHARE = 0.99  # of the full size of u on either side of a jump
# half-width of a jump in each signal: [rad/s], [rad/s], share of the rms torque
JUMP_WIDTHS = {"velocity": 0.02, "link_velocity": 0.02, "torque": 0.02}


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
        first = motion.time[a] - PULSE_SPACING / 2
        last = motion.time[min(b, len(size)) - 1] + PULSE_SPACING / 2
        count = min(max(2, int(np.ceil((last - first) / PULSE_SPACING)) + 1), MAX_PULSES)
        grid = np.linspace(first, last, count)
        inside = (grid > motion.time[0]) & (grid < motion.time[-1])
        times.append(grid[inside])
        sizes.append(np.full(inside.sum(), UNKNOWN_SHARE * size[a:b].max() * (grid[1] - grid[0])))
    instants, order = np.unique(np.round(np.concatenate(times) / step) * step, return_index=True)
    return instants, np.concatenate(sizes)[order]


def _jumps(law: LawEffect, motion: JointMotion, values: Array) -> tuple[NDArray[np.bool_], Array]:
    """Samples at which a law is between both sides of a jump, and the height of the jump, shape (N,)."""
    u = law.law(motion, values)[0]
    full = np.abs(u).max()
    region = np.zeros(len(u), bool)
    size = np.zeros(len(u))
    if full <= 0:
        return region, size
    for name, small in JUMP_WIDTHS.items():
        scale = motion.torque_scale if name == "torque" else 1.0
        signal = getattr(motion, name)
        up = law.law(replace(motion, **{name: signal + small * scale}), values)[0]
        down = law.law(replace(motion, **{name: signal - small * scale}), values)[0]
        swing = np.abs(up - down)
        steep = swing > 0.5 * full  # the law jumps within a small change of this signal
        # of those, the instants at which u has settled on neither side
        distance = np.minimum(np.abs(u - up), np.abs(u - down))
        between = distance > (1 - SETTLED_SHARE) * np.maximum(swing, 1e-12)
        region |= steep & between
        size = np.maximum(size, np.where(steep, swing, 0.0))
    return region, size
