"""Observer outputs of all groups, stacked, at the rate of the identification equation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.base.arrays import Array, Bools
from flexviz.base.errors import InputError
from flexviz.checks import SeenLimit, seen_limits
from flexviz.data.measurements import Group, MeasurementSet, Segment
from flexviz.model.equation.saturated import bridged_torque
from flexviz.model.observers import Observer

MIN_SAMPLES = 10  # of a segment without its transients
FINE_STEP = 2e-3  # [s] maximum step at which effects are evaluated
KNOWN = (1e-3, 1e-2, 0.1)  # share of plateaus in a filtered torque, from which on it is not known
LEAST_KNOWN = 0.1  # of the samples: a smaller share of plateaus is asked for only where this many are left


@dataclass(frozen=True)
class Block:
    """The samples of one segment."""

    group: int  # index into the signals' groups
    rows: slice  # where its samples are
    segment: Segment  # the raw segment
    stride: int  # raw samples per equation sample
    torque: Array  # (N_raw, n), the recorded torque, bridged where it saturates [Nm]


@dataclass(frozen=True)
class Signals:
    """Observer outputs of several groups, stacked along time."""

    groups: tuple[Group, ...]  # the trajectory–payload groups
    payload: Array  # (G, n, 10), the known payload's inertial parameters of each group
    blocks: tuple[Block, ...]  # which rows belong to which segment
    time: Array  # (N,) [s], each group's own time
    theta: Array  # (5, N, n) [rad/s^k]
    tau: Array  # (3, N, n) [Nm/s^k]
    observer: Observer  # what made them
    torque_hold: float  # [s]
    # (N, n), samples that count: not those with more than a little of a saturated torque in them
    known: Bools
    # effects see the transmission torque beyond the observer's band, too. A plain fit starts from values too
    # rough for that
    sharp: bool = False

    @property
    def count(self) -> int:
        """Number of samples N."""
        return len(self.time)

    @property
    def group(self) -> NDArray[np.int64]:
        """Index of each sample's group, shape (N,)."""
        return np.concatenate([np.full(b.rows.stop - b.rows.start, b.group) for b in self.blocks])

    @property
    def left_out(self) -> tuple[str, ...]:
        """Names of the groups of which no stretch is longer than the observer's transients."""
        seen = {block.group for block in self.blocks}
        return tuple(group.name for k, group in enumerate(self.groups) if k not in seen)

    def mean_square(self, residual: Array) -> Array:
        """Of a residual (N, n) over the samples of known torque, shape (n,)."""
        return np.sum(residual**2 * self.known, axis=0) / np.maximum(self.known.sum(axis=0), 1)

    def observer_of(self, joint: int) -> Observer:
        """The observer with that joint's bandwidth alone."""
        bandwidth = np.atleast_1d(self.observer.bandwidth)
        return self.observer if len(bandwidth) == 1 else self.observer.for_bandwidth(float(bandwidth[joint]))

    def kept(self, block: Block) -> slice:
        """Decimated samples of a stretch that are contained in the signals."""
        time = block.segment.time[:: block.stride]
        first = int(np.searchsorted(time, self.time[block.rows.start] - 1e-9))
        return slice(first, first + block.rows.stop - block.rows.start)


def equation_stride(
    segment: Segment, observer: Observer, sample_step: float, exact_step: bool = False
) -> int:
    """Raw samples per equation sample; unless exact, at least eight per cycle of the bandwidth.

    Where possible a multiple of those to the grid on which effects are evaluated.
    """
    if observer.zero_phase and not exact_step:
        sample_step = min(sample_step, 2 * np.pi / (8 * float(np.max(observer.bandwidth))))
    stride = max(1, int(np.floor(sample_step / segment.step + 1e-6)))
    fine = fine_samples(segment)
    return stride - stride % fine if fine <= stride else stride


def fine_samples(segment: Segment) -> int:
    """Raw samples per step of the grid on which effects are evaluated, at most `FINE_STEP`."""
    return max(1, int(FINE_STEP / segment.step + 1e-6))


def build_signals(
    measurements: MeasurementSet,
    groups: Sequence[Group],
    observer: Observer,
    *,
    sample_step: float = 0.025,
    exact_step: bool = False,
    strides: Callable[[Segment], int | None] = lambda segment: None,
    drop: tuple[float, float] | None = None,
    longest_edge: float = np.inf,
    watch: Callable[[], None] = lambda: None,
) -> Signals:
    """Run the observer over all groups and stack its outputs.

    Args:
        measurements: the set the groups belong to.
        groups: at least one.
        observer: made by `make_observer`.
        sample_step: longest step of the equation's samples [s].
        strides: raw samples per equation sample of a segment; None: as `sample_step` says.
        exact_step: never refine `sample_step`; otherwise refine it as the observer's bandwidth requires.
        drop: seconds to drop at the start and end of each segment; default: the observer's transients.
        longest_edge: share of the shortest segment that is dropped at either end at most.
        watch: called before each segment is filtered; may raise to stop.

    Raises:
        InputError: if no samples are left after the transients.
    """
    start, end = _dropped(groups, observer.settling() if drop is None else drop, longest_edge)
    delay, limits, row = measurements.torque_hold / 2, seen_limits(measurements), 0
    blocks, times, thetas, taus, shares = list[Block](), [], [], [], []
    for index, group in enumerate(groups):
        for segment in group.segments:
            stride = strides(segment) or equation_stride(segment, observer, sample_step, exact_step)
            time = segment.time[::stride]
            keep = (time >= time[0] + start - 1e-9) & (time <= segment.time[-1] - end + 1e-9)
            if (count := np.count_nonzero(keep)) < MIN_SAMPLES:
                continue
            watch()
            theta = observer.derivatives(segment.theta, segment.step, 5, position=True, stride=stride)
            torque, tau, spoilt = bridged(segment, limits, observer, stride, delay)
            times.append(time[keep])
            thetas.append(theta[:, keep])
            taus.append(tau[:, keep])
            shares.append(spoilt[keep])
            blocks.append(Block(index, slice(row, row + count), segment, stride, torque))
            row += count
    if not blocks:
        raise _nothing_left(groups, observer, start + end)
    return Signals(
        groups=tuple(groups),
        payload=_payloads(measurements, groups),
        blocks=tuple(blocks),
        time=np.concatenate(times),
        theta=np.concatenate(thetas, axis=1),
        tau=np.concatenate(taus, axis=1),
        observer=observer,
        torque_hold=measurements.torque_hold,
        known=_known(np.concatenate(shares)),
    )


def _dropped(groups: Sequence[Group], drop: tuple[float, float], longest: float) -> list[float]:
    """Seconds dropped at either end: at most a share, `longest`, of the shortest segment."""
    most = longest * min((float(np.ptp(s.time)) for g in groups for s in g.segments), default=0.0)
    return [min(seconds, most) for seconds in drop]


def _payloads(measurements: MeasurementSet, groups: Sequence[Group]) -> Array:
    """The known payload's inertial parameters of each group, shape (G, n, 10)."""
    payload = [measurements.robot.payload_parameters(g.bodies) for g in groups]
    return np.array(payload).reshape(-1, len(measurements.joints), 10)


def bridged(
    segment: Segment, limits: Sequence[SeenLimit], observer: Observer, stride: int, delay: float
) -> tuple[Array, Array, Array]:
    """A segment's torque without plateaus, (N_raw, n), filtered, (3, N, n), and their share in it, (N, n)."""
    torque, unknown = bridged_torque(segment.tau, limits)
    tau = observer.derivatives(torque, segment.step, 3, delay=delay, stride=stride)
    if unknown is None:
        return torque, tau, np.zeros(tau.shape[1:])
    share = observer.derivatives(unknown.astype(float), segment.step, 1, delay=delay, stride=stride)
    return torque, tau, np.abs(share[0])


def _known(spoilt: Array) -> Bools:
    """Samples that count, from the share of plateaus in each filtered torque, shape (N, n) each.

    A torque enters the equations of all joints, through the deflection of its own one: where that leaves
    enough samples, no equation counts while any torque is not known.
    """
    for share in KNOWN:
        rows = np.max(spoilt, axis=1) < share
        if np.mean(rows) >= LEAST_KNOWN:
            return np.repeat(rows[:, None], spoilt.shape[1], axis=1)
    return spoilt < KNOWN[-1]


def _nothing_left(groups: Sequence[Group], observer: Observer, transients: float) -> InputError:
    """All segments are shorter than the observer's transients [s]."""
    lengths = [s.time[-1] - s.time[0] for g in groups for s in g.segments]
    longest = max(lengths, default=0.0)
    band = f"{observer.name} at {np.min(observer.bandwidth):g} rad/s"
    needs = f"the observer {band} needs {transients:.3g} s to settle"
    if len(lengths) > len(groups):
        gaps = f"gaps cut {len(groups)} groups" if len(groups) > 1 else "gaps cut the group"
        cut = f"{gaps} into {len(lengths)} stretches of at most {longest:.3g} s"
        return InputError(
            f"no samples are left: {cut}, {needs}; expected a recording without gaps of this length"
        )
    return InputError(
        f"no samples are left: the longest group has {longest:.3g} s, {needs}; record longer, or take a "
        "higher bandwidth"
    )
