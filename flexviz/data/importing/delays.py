"""Delays in the data: of the link positions' clock against θ's, and of the torque against the motion.

The spring ties link and motor positions together: q = θ − (τ − Bθ̈ − f_mv θ̇)/K. So q read d seconds late is a
combination of θ, τ, θ̈ and, through d, of θ̇. The part f_mv/K from motor friction (a millisecond where K is
1000 f_mv) cannot be told from a delay and is counted as one. The delay of the torque is fitted with the whole
flexible-joint model.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from flexviz.analysis import identification
from flexviz.base._scipy import sp
from flexviz.base.errors import FlexvizError
from flexviz.base.progress import Progress, ProgressCallback, StopCallback
from flexviz.base.statistics import NORMAL_95
from flexviz.checks import Issue
from flexviz.data.logs import SHORTEST, Trace, Traces
from flexviz.data.measurements import Array, Group, MeasurementSet

BAND = 8.0  # [Hz] both sides are compared below this
LARGEST_GRID = 1 << 18  # of the uniform clock on which they are compared
DELAY_ROUNDS = 4  # of refining a delay
SAME_VELOCITY = 0.6  # correlation of the velocities of θ and q above which both show one motion
CLOCK_OFFSET = 2e-3  # [s] a smaller offset of the link clock is normal (driver latency)
SMALLEST_DELAY = 1e-3  # [s] friction unknown to the model can look like a shorter one
SIGMAS = 5.0  # standard errors by which a delay must differ from 0
EXPLAINED = 0.99  # share of τ that the model must explain; only then is a delay trusted
EXPLAINED_LOOSELY = 0.9  # the same if the delay changes the torque by more than is left unexplained
DELAY_GROUPS, DELAY_SECONDS = 4, 20.0  # groups, and [s] of each, enough for a delay common to all joints


@dataclass(frozen=True)
class ClockOffset:
    """Delay between two clocks, from the data."""

    group: str  # which group
    clock: str  # names of the clocks of the link positions and of θ
    base: str
    delay: float  # [s] how much later than θ the link positions are stamped
    std: float  # [s] its standard error, from the joints' disagreement too

    @property
    def text(self) -> str:
        """How the clocks differ; what the data exclude where they do not show it."""
        error = NORMAL_95 * self.std
        if abs(self.delay) < error:
            return f"within {1e3 * (abs(self.delay) + error):.2g} ms of that of theta"
        side = "behind" if self.delay > 0 else "ahead of"
        return f"{in_ms(self.delay, error)} {side} that of theta"

    @property
    def significant(self) -> bool:
        """Whether it is larger than drivers and the estimate's error explain."""
        return abs(self.delay) >= max(CLOCK_OFFSET, SIGMAS * self.std)


def in_ms(delay: float, error: float) -> str:
    """A delay's size with its 95 % interval, both in s."""
    return f"{1e3 * abs(delay):.3g} ± {1e3 * error:.2g} ms"


class JointTraces(NamedTuple):
    """θ, τ and q of one joint."""

    theta: Trace
    tau: Trace
    q: Trace


def clock_offsets(group: str, traces: Traces, joints: tuple[str, ...]) -> list[ClockOffset]:
    """The delay of every clock of link positions that is not θ's own."""
    clocks: dict[str, list[JointTraces]] = {}
    for j in (j for j in joints if (j, "q") in traces):
        members = JointTraces(traces[j, "theta"], traces[j, "tau"], traces[j, "q"])
        if members.q.clock != members.theta.clock:
            clocks.setdefault(members.q.clock, []).append(members)
    delays = {clock: delay_of(members) for clock, members in clocks.items()}
    return [
        ClockOffset(group, clock, clocks[clock][0].theta.clock, *delay)
        for clock, delay in delays.items()
        if delay is not None
    ]


def delay_of(triples: list[JointTraces]) -> tuple[float, float] | None:
    """Delay of q behind θ and its standard error [s] from (θ, τ, q) of each joint; None where none shows."""
    longest = max(max(t.time[-1] - t.time[0] for t in triple) for triple in triples)
    step = max(*(trace.step for triple in triples for trace in triple), longest / LARGEST_GRID)
    if step > 0.25 / BAND:
        return None
    coarse = coarse_delay([(theta, q) for theta, _, q in triples], step)
    if coarse is None:
        return None
    fine = [fine_delay(*triple, coarse, step) for triple in triples]
    known = [result for result in fine if result is not None and result[1] > 0.0]
    if not known:
        return None
    d, std = np.array(known).T
    w = std**-2
    mean = float(d @ w / w.sum())
    formal = float(w.sum() ** -0.5)
    scatter = float(np.sqrt((d - mean) ** 2 @ w / w.sum() / max(1, len(d) - 1)))
    return mean, max(formal, scatter)


def coarse_delay(pairs: list[tuple[Trace, Trace]], step: float) -> float | None:
    """The delay at which the velocities agree best [s], to a step; None where they never agree well."""
    total: Array | float = 0.0
    powers = np.zeros(2)
    starts = max(theta.time[0] for theta, _ in pairs), max(q.time[0] for _, q in pairs)
    ends = min(theta.time[-1] for theta, _ in pairs), min(q.time[-1] for _, q in pairs)
    counts = [int((end - start) / step) for start, end in zip(starts, ends, strict=True)]
    if min(counts) < 64:
        return None
    for pair in pairs:
        speeds = [
            np.gradient(low_pass(np.interp(start + step * np.arange(count), trace.time, trace.values), step))
            for start, count, trace in zip(starts, counts, pair, strict=True)
        ]
        size = np.std(speeds[0]) + 1e-12
        both = (speed / size for speed in reversed(speeds))
        total = total + np.abs(sp.signal.correlate(*both, mode="full", method="fft"))
        powers += np.array([float(speed @ speed) / size**2 for speed in speeds])
    best = int(np.argmax(total))
    if not powers.all() or np.max(total) < SAME_VELOCITY * np.sqrt(np.prod(powers)):
        return None
    return float(sp.signal.correlation_lags(counts[1], counts[0])[best]) * step + starts[1] - starts[0]


def fine_delay(theta: Trace, tau: Trace, q: Trace, delay: float, step: float) -> tuple[float, float] | None:
    """Delay and standard error [s] of one joint, from a start within two steps of it."""
    std = np.inf
    for _ in range(DELAY_ROUNDS):
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
        fit = fit_filtered(matrix, target, len(target) * step)
        if not fit.unique or fit.slopes[1] == 0.0:
            return None
        delay -= float(fit.slopes[4] / fit.slopes[1])
        std = float(fit.std[4] / abs(fit.slopes[1]))
    return delay, std


@dataclass(frozen=True, eq=False)
class FilteredFit:
    """Least squares of low-passed signals: slopes (k,), standard errors (k,), whether they are unique."""

    slopes: Array
    std: Array
    unique: bool


def fit_filtered(matrix: Array, target: Array, seconds: float) -> FilteredFit:
    """Fit `target` (N,) by the columns of `matrix` (N, k), all low-passed to `BAND` and `seconds` long."""
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0.0] = 1.0
    q, r = np.linalg.qr(matrix / scale)
    inverse = np.linalg.pinv(r, rcond=1e-9)
    solution = inverse @ (q.T @ target)
    residual = matrix / scale @ solution - target
    samples = max(8.0, 2 * BAND * seconds)  # that are independent after the filter
    std = np.sqrt(float(residual @ residual) / samples * np.sum(inverse**2, axis=1))
    unique = bool(np.linalg.matrix_rank(r, rtol=1e-9) == len(scale))
    return FilteredFit(solution / scale, std / scale, unique)


def low_pass(values: Array, step: float) -> Array:
    """(…, N) along the last axis without delay, below `BAND`."""
    sections = sp.signal.butter(3, min(0.9, BAND * 2 * step), output="sos")
    padding = min(values.shape[-1] - 1, int(2.0 / BAND / step) + 1)
    return sp.signal.sosfiltfilt(sections, values, axis=-1, padlen=padding)


@dataclass(frozen=True)
class DelayEstimate:
    """Delay between recorded torque and motion."""

    seconds: float  # the recorded torque acts so much later than it is stamped [s]
    std: float  # standard error [s]
    share: float  # of the torques' variance that the flexible model explains
    worst: tuple[str, float]  # the joint of whose torque it explains least, and the share of it

    @property
    def text(self) -> str:
        """When the torque acts; what the data exclude where no delay shows."""
        error = NORMAL_95 * self.std
        if abs(self.seconds) < error:
            most = 1e3 * (abs(self.seconds) + error)
            return f"torque and motion agree in time within {most:.2g} ms"
        when = "later" if self.seconds > 0 else "earlier"
        return f"the recorded torque acts {in_ms(self.seconds, error)} {when} than it is stamped"


def torque_delay(
    measurements: MeasurementSet, progress: ProgressCallback, should_stop: StopCallback
) -> DelayEstimate | None:
    """The delay common to all joints; None where the model does not explain the torques well enough."""
    groups = tuple(shortened(group) for group in measurements.fit_groups[:DELAY_GROUPS])
    if not groups:
        return None
    own = [name for name in ("coulomb_friction", "torque_delay") if name not in measurements.effects]
    progress(Progress("comparing torque and motion", 0.0))
    try:
        result = identification.identify(
            replace(measurements, groups=groups), effects=own, refine=False, should_stop=should_stop
        )
    except (FlexvizError, np.linalg.LinAlgError):
        return None
    found = [p for p in result.parameters if p.name == "torque_delay.delay" and p.identifiable != "no"]
    if result.stopped or not result.converged or not found or not np.isfinite(found[0].std):
        return None
    segments = [segment for group in groups for segment in group.segments]
    powers = np.maximum(np.mean([np.var(s.tau, axis=0) for s in segments], axis=0), 1e-300)
    squares = np.square(result.residual.rms)
    left = float(np.sum(squares))
    share = 1.0 - left / float(np.sum(powers))
    j = int(np.argmax(squares / powers))
    # what the delay itself moves must be more than what stays unexplained, unless nearly nothing does
    rates = [np.gradient(low_pass(s.tau.T, s.step), s.step, axis=1).T for s in segments]
    moved = found[0].value ** 2 * float(np.sum(np.mean([np.var(rate, axis=0) for rate in rates], axis=0)))
    if share < EXPLAINED_LOOSELY or (share < EXPLAINED and moved < left):
        return None
    worst = measurements.joints[j], 1.0 - float(squares[j] / powers[j])
    return DelayEstimate(found[0].value, found[0].std, share, worst)


def shortened(group: Group) -> Group:
    """A group's longest segment, cut to the length that is needed."""
    segment = max(group.segments, key=len)
    rows = slice(0, max(SHORTEST, int(DELAY_SECONDS / segment.step)))
    short = replace(segment, time=segment.time[rows], theta=segment.theta[rows], tau=segment.tau[rows])
    return replace(group, segments=(short,))


def delay_issues(delay: DelayEstimate, measurements: MeasurementSet) -> list[Issue]:
    """A delay that is certain, and longer than sampling and friction explain."""
    step = max(segment.step for group in measurements.groups for segment in group.segments)
    if abs(delay.seconds) < max(SMALLEST_DELAY, step, SIGMAS * delay.std):
        return []
    values = {"text": delay.text, "samples": abs(delay.seconds) / step, "delay": delay.seconds}
    return [Issue("delay", "odd", measurements.joints, "tau", values)]
