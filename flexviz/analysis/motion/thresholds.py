"""What is known of a robot and its record before the fit: physical sizes and tolerances."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, init=False, repr=False, eq=False)
class MotionThresholds:
    """Physical sizes and tolerances of fits in the band of the motion."""

    tolerance: float = 0.003  # of a joint's torque spread: what laws leave that are right
    noise_known: float = 0.02  # relative error of the noise's standard deviation
    far: float = 5.0  # times tolerance and noise, from which reversals do not explain an error
    outlier: float = 2.5  # [standard deviations] from which a residual counts linearly
    computed_spread: float = 0.2  # relative standard deviation of CAD inertias, and of an even friction split
    rough_spread: float = 0.4  # that of the set's stiffness and motor inertia
    guessed_spread: float = 1.5  # of the log of both where the set does not give them
    hidden_torque: float = 0.005  # share of a joint's torque that stands for what these data do not show
    still: float = 0.01  # of a joint's 95 % speed or of its range of positions: within, it rests
    louder: float = 1.64  # times the error in motion from which rest is judged apart
    start_angle: float = 0.01  # [rad] after rest that counts as standstill


MOTION = MotionThresholds()
