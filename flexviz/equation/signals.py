"""What enters the identification equation: all groups' observer outputs, stacked, at its rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.errors import InputError
from flexviz.measurements import Group, MeasurementSet, Segment
from flexviz.observers import Observer

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Block:
    """The samples of one segment.

    Attributes:
        group: index into the signals' groups.
        rows: where its samples are.
        segment: the raw segment.
        stride: raw samples per equation sample.
    """

    group: int
    rows: slice
    segment: Segment
    stride: int


@dataclass(frozen=True)
class Signals:
    """Observer outputs of several groups, stacked along time.

    Attributes:
        groups: the trajectory–payload groups.
        payload: shape (G, n, 10), the known payload's inertial parameters of each group.
        blocks: which rows belong to which segment.
        time: shape (N,) [s], each group's own time.
        theta: shape (5, N, n) [rad/s^k].
        tau: shape (3, N, n) [Nm/s^k].
        step: sampling step of the equation [s].
        observer: what made them.
        torque_hold: [s].
    """

    groups: tuple[Group, ...]
    payload: Array
    blocks: tuple[Block, ...]
    time: Array
    theta: Array
    tau: Array
    step: float
    observer: Observer
    torque_hold: float

    @property
    def count(self) -> int:
        """Number of samples N."""
        return len(self.time)

    def observer_of(self, joint: int) -> Observer:
        """The observer with that joint's bandwidth alone."""
        bandwidth = self.observer.bandwidth
        return (
            self.observer
            if isinstance(bandwidth, float)
            else type(self.observer)(float(np.atleast_1d(bandwidth)[joint]))
        )

    def kept(self, block: Block) -> slice:
        """Which of a stretch's decimated samples are in the signals."""
        time = block.segment.time[:: block.stride]
        first = int(np.searchsorted(time, self.time[block.rows.start] - 1e-9))
        return slice(first, first + block.rows.stop - block.rows.start)


def equation_stride(segment: Segment, observer: Observer, sample_step: float) -> int:
    """Raw samples per equation sample: `sample_step`, but at least eight samples a cycle of the bandwidth."""
    if observer.zero_phase:
        sample_step = min(sample_step, 2 * np.pi / (8 * float(np.max(observer.bandwidth))))
    return max(1, int(np.floor(sample_step / segment.step + 1e-6)))


def build_signals(
    measurements: MeasurementSet,
    groups: Sequence[Group],
    observer: Observer,
    *,
    sample_step: float = 0.025,
    exact_step: bool = False,
    drop: tuple[float, float] | None = None,
) -> Signals:
    """Run the observer over all groups and stack what it gives.

    Args:
        measurements: the set the groups belong to.
        groups: at least one.
        observer: made by `make_observer`.
        sample_step: longest step of the equation's samples [s].
        exact_step: take `sample_step` as it is; else finer where the observer's bandwidth asks for it.
        drop: seconds to drop at the start and end of each segment; the observer's own transients where None.

    Raises:
        InputError: when nothing is left after the transients.
    """
    n = len(measurements.joints)
    start, end = observer.settling() if drop is None else drop
    blocks: list[Block] = []
    parts = []
    row = 0
    strides: set[float] = set()
    for index, group in enumerate(groups):
        for segment in group.segments:
            stride = (
                max(1, int(sample_step / segment.step + 1e-6))
                if exact_step
                else equation_stride(segment, observer, sample_step)
            )
            strides.add(stride * segment.step)
            time = segment.time[::stride]
            keep = (time >= time[0] + start - 1e-9) & (time <= segment.time[-1] - end + 1e-9)
            if np.count_nonzero(keep) < 10:
                continue
            theta = observer.derivatives(segment.theta, segment.step, 5, position=True, stride=stride)[
                :, keep
            ]
            delay = measurements.torque_hold / 2
            tau = observer.derivatives(segment.tau, segment.step, 3, delay=delay, stride=stride)[:, keep]
            parts.append((time[keep], theta, tau))
            blocks.append(Block(index, slice(row, row + theta.shape[1]), segment, stride))
            row += theta.shape[1]
    if not blocks:
        longest = max((s.time[-1] - s.time[0] for g in groups for s in g.segments), default=0.0)
        raise InputError(
            f"no samples are left: the longest segment has {longest:.3g} s, the observer {observer.name} at "
            f"{np.min(observer.bandwidth):g} rad/s needs {start + end:.3g} s to settle; "
            "take a higher bandwidth"
        )
    payload = np.array([measurements.robot.payload_parameters(g.bodies) for g in groups]).reshape(-1, n, 10)
    return Signals(
        tuple(groups), payload, tuple(blocks),
        np.concatenate([p[0] for p in parts]),
        np.concatenate([p[1] for p in parts], axis=1),
        np.concatenate([p[2] for p in parts], axis=1),
        float(max(strides)), observer, measurements.torque_hold,
    )  # fmt: skip
