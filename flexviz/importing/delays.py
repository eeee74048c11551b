"""Whether torque and acceleration agree in time: a delay is fitted with the whole flexible-joint model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexviz.errors import FlexvizError
from flexviz.identification import identify
from flexviz.importing.log import SHORTEST
from flexviz.importing.offsets import low_pass
from flexviz.importing.suspicion import Suspicion
from flexviz.measurements import Group, MeasurementSet
from flexviz.progress import Progress, ProgressCallback, StopCallback

MOST_GROUPS, LONGEST = 4, 20.0  # groups, and [s] of each, that are enough for a delay common to all joints
SMALLEST = 1e-3  # [s] what friction that the model does not know can look like
STEPS = 0.75  # of sampling: a torque held for a step seems half a step early
CERTAIN = 5.0  # standard errors
EXPLAINED, ENOUGH = (
    0.99,
    0.9,
)  # shares of τ that the model explains: its delay is believed; where the delay is plain


@dataclass(frozen=True)
class DelayEstimate:
    """How recorded torque and motion agree in time.

    Attributes:
        seconds: the recorded torque acts so much later than it is stamped [s].
        std: standard error [s].
        share: of the torques' variance that the flexible model explains.
    """

    seconds: float
    std: float
    share: float


def torque_delay(
    measurements: MeasurementSet, progress: ProgressCallback, should_stop: StopCallback
) -> DelayEstimate | None:
    """The delay common to all joints; None where the model does not explain the torques well enough."""
    groups = tuple(shortened(group) for group in measurements.fit_groups[:MOST_GROUPS])
    if not groups:
        return None
    own = [name for name in ("coulomb_friction", "torque_delay") if name not in measurements.effects]
    progress(Progress("comparing torque and motion", 0.0))
    try:
        result = identify(replace(measurements, groups=groups), effects=own, should_stop=should_stop)
    except (FlexvizError, np.linalg.LinAlgError):
        return None
    found = [p for p in result.parameters if p.name == "torque_delay.delay" and p.identifiable != "no"]
    if result.stopped or not result.converged or not found or found[0].std is None:
        return None
    segments = [segment for group in groups for segment in group.segments]
    power = float(np.sum(np.mean([np.var(s.tau, axis=0) for s in segments], axis=0)))
    left = float(np.sum(np.square(result.residual.rms)))
    share = 1.0 - left / max(power, 1e-300)
    # what the delay itself moves must be more than what stays unexplained, unless nearly nothing does
    rates = [np.gradient(low_pass(s.tau.T, s.step), s.step, axis=1).T for s in segments]
    moved = found[0].value ** 2 * float(np.sum(np.mean([np.var(rate, axis=0) for rate in rates], axis=0)))
    if share < ENOUGH or (share < EXPLAINED and moved < left):
        return None
    return DelayEstimate(found[0].value, found[0].std, share)


def shortened(group: Group) -> Group:
    """A group's longest segment, and no more of it than is needed."""
    segment = max(group.segments, key=len)
    rows = slice(0, max(SHORTEST, int(LONGEST / segment.step)))
    short = replace(segment, time=segment.time[rows], theta=segment.theta[rows], tau=segment.tau[rows])
    return replace(group, segments=(short,))


def suspicious_delay(delay: DelayEstimate, measurements: MeasurementSet) -> list[Suspicion]:
    """A delay that is certain, and longer than sampling and friction explain."""
    step = max(segment.step for group in measurements.groups for segment in group.segments)
    if abs(delay.seconds) < max(SMALLEST, STEPS * step, CERTAIN * delay.std):
        return []
    when = "later" if delay.seconds > 0 else "earlier"
    message = (
        f"torque and acceleration disagree in time: the recorded torque acts "
        f"{1e3 * abs(delay.seconds):.3g} ± {1.96e3 * delay.std:.2g} ms {when} than it is stamped "
        f"({abs(delay.seconds) / step:.2g} samples); "
        'time.shift corrects it where tau has a clock of its own, the effect "torque_delay" fits it'
    )
    return [Suspicion("delay", "odd", measurements.joints, "tau", message)]
