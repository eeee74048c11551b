"""Constants of the checks of recordings: probabilities, spreads of what is known beforehand, tolerances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, init=False, repr=False, eq=False)
class CheckThresholds:
    """What is known before the data are seen, and when something is said.

    `python -m benchmarks.import_faults` shows what is named with them, and on how many good sets nothing is.
    """

    # Torques against the robot's masses: what is known before the data are seen
    shortest_motion: float = 1.0  # [s] of all groups together; shorter ones prove nothing
    fault: float = 0.02  # probability of each kind of fault
    rarer: float = 0.3  # how often the less usual of two faults of a kind occurs, against the usual one
    out_of_range: float = 0.01  # probability of a motion that the joint's limits, or q, do not allow
    mass_spread: float = 0.25  # standard deviation of ln(mass) of a robot description
    payload_spread: float = 0.15  # the same of a stated payload
    unit_spread: float = 5.0  # the same of a torque of unknown unit
    motor_inertia: float = 2.0  # standard deviation of B, in units of the joint's largest M_jj(q)
    small_link: float = 0.05  # share of the largest M_jj granted to every joint: wrists have large motors
    model_error: float = 3e-3  # share of a torque's variance that the rigid model never explains
    rigid_below: float = 1.0  # [Hz] elasticity of joints hardly shows below
    # when something is told
    sure: float = 0.9  # probability above which a fault is named
    alike: float = 20.0  # ratio of probabilities below which another cause is named with it
    explained: float = 0.5  # share of a joint's torque that a fault which is named must leave explained
    unexplained: float = 0.2  # share below which a joint is called unexplained

    # Motion against the joint's limits
    beyond: float = 1.3  # times range or speed at which θ is odd
    far_beyond: float = 3.0  # the same at which θ is certainly wrong
    smallest_motion: float = 0.02  # [rad] less is no motion that anybody records
    zero: float = (
        0.1  # [rad] by which a zero may be off; a larger mean difference is no deflection of a spring
    )

    # Columns against each other
    same_motion: float = 0.95  # squared correlation of two columns above which both are the same motion
    follows: float = 0.8  # the same below which they are of different joints
    near: float = 1.25  # largest ratio of a correct slope to 1
    agrees: float = 1.06  # the same for a slope that a unit or a known gear explains
    # correlation of θ − q with τ below which both are swapped; a spring makes it positive
    swapped: float = -0.7


LIMITS = CheckThresholds()
SURE = float(np.log(LIMITS.sure / (1 - LIMITS.sure)))  # [nats]
