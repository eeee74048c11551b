"""Decision thresholds of the identification report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

# relative standard error up to which a parameter is identifiable ("yes"), and up to which weakly
Grades = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class IdentificationThresholds:
    """Thresholds between the grades "yes", "weak" and "no".

    `python -m benchmarks.thresholds` shows what the two floors decide, on a simulated two-joint arm. Without
    `effect_floor`, a torque offset known to be zero within 1e-4 Nm is graded "no"; with 0.002 to 0.06 it is
    "yes", and the other grades do not change. `viscous_floor` changes no grade there between 0 and 0.2; it
    matters where one side has no friction at all. The other values are experience: no study supports them
    yet.

    Attributes:
        grades: kind of parameter → relative standard errors up to which it is "yes" and "weak".
        prior_share: share of the prior in a variance from which a parameter is at most "weak".
        tied: |correlation| from which two parameters count as tied.
        viscous_floor: a joint's viscous friction on one side is judged on no smaller scale than this share of
            both sides' sum.
        effect_floor: an effect's parameter is judged on no smaller scale than this share of its prior spread.
        far_above_noise: times the noise floor from which an error is not that of the sensors; that of a
            lagging observer caps all grades at "weak".
        unrest: share of the remaining step from which a joint keeps a fit from converging.
        bad_share: error relative to a joint's torque that is named as the reason.
        undisturbed_share: share of the samples from which those without a reversal judge the model.
        nothing_explained: error relative to a joint's torque from which the joint counts as not fitted.
    """

    grades: Grades = field(
        default_factory=lambda: MappingProxyType(
            {
                "inertial": (0.05, 0.3),
                "stiffness": (0.025, 0.25),
                "motor_inertia": (0.025, 0.25),
                "friction": (0.05, 0.3),
                "effect": (0.1, 0.5),
            }
        )
    )
    prior_share: float = 0.5
    tied: float = 0.9
    viscous_floor: float = 0.05
    effect_floor: float = 0.007
    far_above_noise: float = 3.0
    unrest: float = 0.3
    bad_share: float = 0.1
    undisturbed_share: float = 0.05
    nothing_explained: float = 1.0


IDENTIFICATION = IdentificationThresholds()
