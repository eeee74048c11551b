"""Unknown friction torque at reversals as nuisance pulses in the residual.

For some milliseconds around a zero crossing of velocity or torque, the friction torque depends on noise and
on details of the reversal and is unknown. Each such interval is described by pulses of unknown size, which
cost a few samples per reversal instead of biasing the fit. The initial state of a law with memory is treated
likewise (`LawEffect.unknown`), as long as it lasts.

A stretch that is long or has many pulses is taken apart: all of them together would take memory with the
square and time with the cube of their number. What matters on both sides of a border is unknown in both.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from flexviz.base.arrays import Array, Bools
from flexviz.model.effects import EFFECTS, JointMotion, LawEffect
from flexviz.model.equation.chain import Chain, local_compliance, time_constants
from flexviz.model.equation.link import LinkTerms
from flexviz.model.equation.residual import OperatingPoint

PULSE_SPACING = 0.01  # [s]
# per interval: friction changes slowly in a long rest, but where a motor creeps around zero velocity, and on
# a link that sticks while the spring is wound up
MAX_PULSES = 30
UNKNOWN_SHARE = 0.15  # of the change of u that is unknown on average between two pulses
SETTLED_SHARE = 0.99  # of the full size of u on either side of a jump
# half-width of a jump in each signal: [rad/s], [rad/s], share of the rms torque
JUMP_WIDTHS = {"velocity": 0.02, "link_velocity": 0.02, "torque": 0.02}
# pulses whose columns share their samples: of about one reversal
TOGETHER = 0.3  # [s]
MOST_TOGETHER = 12
LONGEST = 30.0  # [s] longer stretches are taken apart
PART = 10.0  # [s] about the length of a part
MOST = 500  # pulses of a part
LEAD = 1.0  # [s] before a part, for whitening, which looks back
FADED = 1e-3  # share of an unknown initial state that no longer matters
BORDER = 0.4  # [s] beyond a part, from where a filtered pulse still matters


@dataclass(frozen=True)
class PulseGroup:
    """Unknown pulses of about one reversal; a pulse is short, and all of a stretch together mostly zeros."""

    first: int  # sample of the stretch with which they begin
    columns: Array  # (R, n, M), ∂r for a pulse of one standard deviation; zero in other samples


@dataclass(frozen=True)
class Pulses:
    """Unknown pulses of a stretch or of a part of it."""

    block: int  # which stretch
    rows: slice  # samples of the stretch in which they count; they may begin before
    groups: tuple[PulseGroup, ...]  # the pulses

    @property
    def count(self) -> int:
        """Number of pulses."""
        return sum(group.columns.shape[2] for group in self.groups)

    def dense(self, joint: int) -> Array:
        """The columns of one joint in `rows`, shape (N_rows, count)."""
        first = self.rows.start
        begun = [max(group.first, first) for group in self.groups]
        parts = [
            (begin - first, group.columns[begin - group.first :, joint])
            for begin, group in zip(begun, self.groups, strict=True)
        ]
        return side_by_side(parts, self.rows.stop - first)


def side_by_side(parts: Sequence[tuple[int, Array]], count: int) -> Array:
    """Columns of `count` samples, shape (count, M), from the first sample of some and their values (R, m)."""
    ends = np.cumsum([0, *(columns.shape[1] for _, columns in parts)])
    out = np.zeros((count, ends[-1]))
    for (first, columns), (begin, end) in zip(parts, pairwise(ends), strict=True):
        out[first : first + len(columns), begin:end] = columns
    return out


def pulses(point: OperatingPoint, x: Array, link: LinkTerms, products: bool = False) -> list[Pulses]:
    """The pulses of every stretch that has some, for given rigid-body terms.

    `products`: the residual's products of signals are formed before they are filtered.
    """
    compliance = local_compliance(point.layout, x, link.torque)
    chain, lags = Chain(compliance, x[point.layout.link_viscous], link), time_constants(point.layout, x)
    unknown = list(_unknown(point, x))
    counts = Counter[int]()
    for one in unknown:
        counts[one.index] += len(one.times)
    found: dict[tuple[int, int], list[Pulses]] = {}
    for one in unknown:
        lag = float(lags[one.joint])
        for part in _of_stretch(point, one, counts[one.index], chain, lag, products):
            found.setdefault((one.index, part.rows.start), []).append(part)
    return [
        replace(same[0], groups=tuple(group for one in same for group in one.groups))
        for _, same in sorted(found.items())
    ]


@dataclass(frozen=True)
class _Unknown:
    """What of an effect is unknown in a stretch."""

    index: int  # which stretch
    # law, joint: the effect
    law: LawEffect
    joint: int
    motion: JointMotion  # of the joint in the stretch
    # times, sizes: (M,), instants [s] and standard deviations of the pulses
    times: Array
    sizes: Array
    begun: Array  # unknown initial states (`LawEffect.unknown`)


def _unknown(point: OperatingPoint, x: Array) -> Iterator[_Unknown]:
    """What is unknown of every effect, stretch by stretch."""
    for effect, where in point.layout.effect_slices():
        law, joint, values = EFFECTS[effect.effect], effect.joint, x[where]
        if not isinstance(law, LawEffect) or joint is None or not np.any(values):
            continue
        for index, motion in enumerate(point.context.motions(joint)):
            nothing = np.zeros(0), np.zeros(0)
            times, sizes = nothing if law.smooth else undecided(law, motion, values)
            yield _Unknown(index, law, joint, motion, times, sizes, law.unknown(motion, values))


def _of_stretch(
    point: OperatingPoint, unknown: _Unknown, count: int, chain: Chain, lag: float, products: bool
) -> Iterator[Pulses]:
    """The pulses of one effect in each part of a stretch that has some.

    `count`: pulses of all effects in the stretch; `lag`: the joint's D/K [s].
    """
    index, law, joint, times = unknown.index, unknown.law, unknown.joint, unknown.times
    block, context = point.signals.blocks[index], point.context
    time = point.signals.time[block.rows]

    def part_of(seen: slice) -> Chain:
        return chain.rows(slice(block.rows.start + seen.start, block.rows.start + seen.stop))

    def group(inside: slice, chosen: slice) -> PulseGroup:
        at = np.searchsorted(unknown.motion.time, times[chosen])
        seen = context.pulse_rows(index, at, joint, inside)
        size = (unknown.sizes[chosen] / unknown.motion.step)[:, None, None]
        u = bends = context.pulses_block(index, at, joint, law.depth, seen) * size
        torque = law.entry == "torque"
        if lag and torque:  # a damped joint bends later
            bends = context.pulses_block(index, at, joint, law.depth, seen, lag) * size
        if products and law.entry != "residual":
            moved = u if torque else None
            columns = part_of(seen).pulses(moved, bends, joint, time[seen], times[chosen])
        else:
            columns = part_of(seen).columns(law.entry, (joint,), u[..., None], bends[..., None])
        return PulseGroup(seen.start, columns)

    begun = unknown.begun
    if len(begun):
        begun = context.filtered_block(index, begun, joint, law.depth)
    for rows in parts_of(time, count):
        begin, first, last = 0, 0, len(times)
        if rows.stop - rows.start < len(time):
            begin = max(rows.start - int(np.ceil(LEAD / (time[1] - time[0]))), 0)
            first = int(np.searchsorted(times, time[rows.start] - BORDER, side="right"))
            last = int(np.searchsorted(times, time[rows.stop - 1] + BORDER))
        inside = slice(begin, rows.stop)
        groups = [group(inside, chosen) for chosen in _together(times, first, last)]
        lasting = [s[:, inside] for s in begun if np.abs(s[:, rows]).max() >= FADED * np.abs(s).max()]
        if lasting:
            state = np.array(lasting)[..., None]
            groups.append(PulseGroup(begin, part_of(inside).columns(law.entry, (joint,), state)))
        if groups:
            yield Pulses(index, rows, tuple(groups))


def _together(times: Array, first: int, last: int) -> Iterator[slice]:
    """Pulses `first` to `last` of those at `times` [s], a few at a time that are near one another."""
    while first < last:
        near = int(np.searchsorted(times, times[first] + TOGETHER))
        end = min(first + MOST_TOGETHER, max(near, first + 1), last)
        yield slice(first, end)
        first = end


def parts_of(time: Array, pulses: int = 0) -> list[slice]:
    """Samples of the parts of a stretch with sample times (N,) [s]; one unless long or full of pulses."""
    length = float(time[-1] - time[0])
    count = max(1 if length <= LONGEST else round(length / PART), -(-pulses // MOST))
    ends = np.arange(count + 1) * len(time) // count
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]


def undecided(law: LawEffect, motion: JointMotion, values: Array) -> tuple[Array, Array]:
    """Instants of the pulses, shape (M,) [s], and their standard deviations (area of u), shape (M,)."""
    region, size = law.undecided(motion, values) or _jumps(law, motion, values)
    if not region.any():
        return np.zeros(0), np.zeros(0)
    step = motion.step
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


def _jumps(law: LawEffect, motion: JointMotion, values: Array) -> tuple[Bools, Array]:
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
        # a quick reversal lies between two samples, of which neither is near zero
        leap = np.abs(np.diff(u)) * (signal[1:] * signal[:-1] < 0)
        crossed = leap > 0.5 * full
        for side in (slice(None, -1), slice(1, None)):
            region[side] |= crossed
            size[side] = np.maximum(size[side], np.where(crossed, leap, 0.0))
    return region, size
