"""How far the clock of the link positions is behind that of the motor positions, from the data.

The spring ties the two together: q = θ − (τ − Bθ̈ − f_mv θ̇)/K. So q read d seconds late is a combination of θ,
τ, θ̈ and, through d, of θ̇. The part f_mv/K of that, from motor friction (a millisecond where K is 1000 f_mv),
cannot be told from a delay and is counted as one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, correlate, correlation_lags, sosfiltfilt

from flexviz.importing.traces import Trace
from flexviz.measurements import Array

BAND = 8.0  # [Hz] both sides are compared below this
MOST_SAMPLES = 1 << 18  # of the uniform clock on which they are compared
CLEAR = 0.6  # correlation of the velocities from which the two belong together
ROUNDS = 4  # of correcting the delay


@dataclass(frozen=True)
class ClockOffset:
    """What the data say about two clocks.

    Attributes:
        group: which group.
        clock, base: what the clocks are called: of the link positions, of θ.
        delay: [s] how much later than θ the link positions are stamped.
        std: [s] its standard error, from the joints' disagreement too.
    """

    group: str
    clock: str
    base: str
    delay: float
    std: float


def clock_offsets(
    group: str, traces: dict[tuple[str, str], Trace], joints: tuple[str, ...]
) -> list[ClockOffset]:
    """The delay of every clock of link positions that is not θ's own."""
    found = []
    clocks: dict[str, list[str]] = {}
    for joint in joints:
        if (joint, "q") in traces and traces[joint, "q"].clock != traces[joint, "theta"].clock:
            clocks.setdefault(traces[joint, "q"].clock, []).append(joint)
    for clock, members in clocks.items():
        triples = [(traces[j, "theta"], traces[j, "tau"], traces[j, "q"]) for j in members]
        result = delay_of(triples)
        if result is not None:
            found.append(ClockOffset(group, clock, triples[0][0].clock, *result))
    return found


def delay_of(triples: list[tuple[Trace, Trace, Trace]]) -> tuple[float, float] | None:
    """Delay of q behind θ and its standard error [s] from (θ, τ, q) of each joint; None where none shows."""
    longest = max(max(t.time[-1] - t.time[0] for t in triple) for triple in triples)
    step = max(*(trace.step for triple in triples for trace in triple), longest / MOST_SAMPLES)
    if step > 0.25 / BAND:
        return None
    coarse = coarse_delay([(theta, q) for theta, _, q in triples], step)
    if coarse is None:
        return None
    delays, weights = [], []
    for theta, tau, q in triples:
        result = fine_delay(theta, tau, q, coarse, step)
        if result is not None and result[1] > 0.0:
            delays.append(result[0])
            weights.append(result[1] ** -2)
    if not delays:
        return None
    d, w = np.array(delays), np.array(weights)
    mean = float(d @ w / w.sum())
    formal = float(w.sum() ** -0.5)
    scatter = float(np.sqrt((d - mean) ** 2 @ w / w.sum() / max(1, len(d) - 1)))
    return mean, max(formal, scatter)


def coarse_delay(pairs: list[tuple[Trace, Trace]], step: float) -> float | None:
    """The delay at which the velocities agree best [s], to a step; None where they never agree well."""
    total: Array | float = 0.0
    own = [0.0, 0.0]
    lags: Array | None = None
    starts = max(theta.time[0] for theta, _ in pairs), max(q.time[0] for _, q in pairs)
    ends = min(theta.time[-1] for theta, _ in pairs), min(q.time[-1] for _, q in pairs)
    counts = [int((end - start) / step) for start, end in zip(starts, ends, strict=True)]
    if min(counts) < 64:
        return None
    for theta, q in pairs:
        grids = [start + step * np.arange(count) for start, count in zip(starts, counts, strict=True)]
        speeds = [
            np.gradient(low_pass(np.interp(grid, trace.time, trace.values), step))
            for grid, trace in zip(grids, (theta, q), strict=True)
        ]
        size = np.std(speeds[0]) + 1e-12
        total = total + np.abs(correlate(speeds[1] / size, speeds[0] / size, mode="full", method="fft"))
        own = [
            own[0] + float(speeds[0] @ speeds[0]) / size**2,
            own[1] + float(speeds[1] @ speeds[1]) / size**2,
        ]
        lags = correlation_lags(counts[1], counts[0])
    best = int(np.argmax(total))
    if lags is None or own[0] * own[1] == 0.0 or np.max(total) < CLEAR * np.sqrt(own[0] * own[1]):
        return None
    return float(lags[best]) * step + starts[1] - starts[0]


def fine_delay(theta: Trace, tau: Trace, q: Trace, delay: float, step: float) -> tuple[float, float] | None:
    """Delay and standard error [s] of one joint, from a start that is right to a step or two."""
    for round_ in range(ROUNDS):
        start = max(theta.time[0], tau.time[0], q.time[0] - delay)
        end = min(theta.time[-1], tau.time[-1], q.time[-1] - delay)
        count = int((end - start) / step)
        if count < 64:
            return None
        grid = start + step * np.arange(count)
        angle = low_pass(theta.at(grid)[0], step)
        speed = np.gradient(angle, step)
        columns = [np.ones(count), angle, low_pass(tau.at(grid)[0], step), np.gradient(speed, step), speed]
        edge = min(count // 4, int(1.0 / BAND / step) + 2)
        matrix = np.stack(columns, axis=1)[edge:-edge]
        target = low_pass(q.at(grid + delay)[0], step)[edge:-edge]
        scale = np.linalg.norm(matrix, axis=0)
        if not (scale > 0.0).all():
            return None
        solution, _, rank, _ = np.linalg.lstsq(matrix / scale, target, rcond=1e-9)
        if rank < matrix.shape[1] or solution[1] == 0.0:
            return None
        residual = matrix / scale @ solution - target
        correction = -float(solution[4] / scale[4] / (solution[1] / scale[1]))
        delay += correction
        if round_ == ROUNDS - 1:
            samples = max(8.0, len(target) * step * 2 * BAND)  # that are independent after the filter
            inverse = np.linalg.pinv((matrix / scale).T @ (matrix / scale))
            variance = float(residual @ residual) / len(target) * inverse[4, 4] * len(target) / samples
            return delay, float(np.sqrt(variance)) / scale[4] / abs(solution[1] / scale[1])
    return None


def low_pass(values: Array, step: float) -> Array:
    """(…, N) along the last axis without delay, below `BAND`."""
    sections = butter(3, min(0.9, BAND * 2 * step), output="sos")
    padding = min(values.shape[-1] - 1, int(2.0 / BAND / step) + 1)
    return sosfiltfilt(sections, values, axis=-1, padlen=padding)
