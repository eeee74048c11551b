"""Whether torque and acceleration agree in time: a delay is fitted with the whole flexible-joint model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexviz.errors import FlexvizError
from flexviz.identification import identify
from flexviz.importing.log import Stop
from flexviz.importing.suspicion import Suspicion
from flexviz.measurements.data import MeasurementSet

MOST_GROUPS = 4  # more are not needed for a delay that is common to all
SMALLEST = 1e-3  # [s] what friction that the model does not know can look like
STEPS = 0.75  # of sampling: a torque held for a step seems half a step early
CERTAIN = 5.0  # standard errors
EXPLAINED = 0.9  # share of τ that the model must explain before its delay is believed


@dataclass(frozen=True)
class TorqueDelay:
    """How recorded torque and motion agree in time.

    Attributes
    ----------
    seconds: the recorded torque acts so much later than it is stamped [s].
    std: standard error [s].
    share: of the torques' variance that the flexible model explains.
    """

    seconds: float
    std: float
    share: float


def torque_delay(
    measurements: MeasurementSet, progress: Callable[[str], None], should_stop: Stop
) -> TorqueDelay | None:
    """The delay common to all joints; None where the model does not explain the torques well enough."""
    groups = [group.name for group in measurements.fit_groups][:MOST_GROUPS]
    if not groups:
        return None
    own = [name for name in ("coulomb_friction", "torque_delay") if name not in measurements.effects]
    progress("comparing torque and motion")
    try:
        result = identify(measurements, groups=groups, effects=own, should_stop=should_stop)
    except (FlexvizError, np.linalg.LinAlgError):
        return None
    if result.stopped or not result.converged:
        return None
    chosen = [group for group in measurements.groups if group.name in groups]
    power = np.mean([np.var(s.tau, axis=0) for group in chosen for s in group.segments], axis=0)
    share = 1.0 - float(np.sum(np.square(result.residual.rms)) / max(float(np.sum(power)), 1e-300))
    found = [p for p in result.parameters if p.name == "torque_delay.delay" and p.identifiable != "no"]
    if share < EXPLAINED or not found or found[0].std is None:
        return None
    return TorqueDelay(found[0].value, found[0].std, share)


def suspicious_delay(delay: TorqueDelay, measurements: MeasurementSet) -> list[Suspicion]:
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
