"""Thresholds of the checks of an import, with their reasons."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ImportThresholds:
    """When imported data look wrong or odd.

    `python -m benchmarks.import_faults SET…` supports the thresholds of the torque checks: it counts how
    often good sets raise an issue and how often a fault put into them is named. `pytest -k test_import`
    supports the others.
    """

    # Clocks and columns
    repeated_instants: float = 0.2  # share of repeated instants above which a clock is too coarse to be used
    late_messages: float = 1.0  # [s] messages that come late by less are sorted; later ones are another run
    # share of rows in which a column for comparison may repeat its first or last value
    held_ends: float = 0.05
    # own steps by which a signal may be continued beyond its first and last sample
    continued_steps: float = 1.5
    clock_offset: float = 2e-3  # [s] a smaller offset of the link clock is normal (driver latency)
    clock_sigmas: float = 3.0  # standard errors by which an offset must differ from 0
    # correlation of the velocities of θ and q above which both show the same motion
    same_velocity: float = 0.6

    # Delay of the torque
    smallest_delay: float = 1e-3  # [s] friction unknown to the model can look like a shorter one
    delay_steps: float = 0.75  # a torque held for a step seems half a step early
    delay_sigmas: float = 5.0  # standard errors by which a delay must differ from 0
    torque_explained: float = 0.99  # share of τ that the model must explain; only then is a delay trusted
    # the same if the delay changes the torque by more than is left unexplained
    torque_explained_loosely: float = 0.9

    # Torques against the robot's masses
    slopes: tuple[float, float] = (0.4, 2.5)  # of τ against the CAD model; masses are known roughly
    # largest motor inertia at the joint side, in units of the joint's largest M_jj(q)
    motor_inertia: float = 4.0
    # share of the largest diagonal entry granted to every joint: wrists have large motors
    small_link: float = 0.05
    explained_well: float = 0.7  # share of every joint's torque above which no fault is searched
    gain: float = 0.4  # sum of shares that a change must add, enough to exclude chance
    free_gain: float = 0.2  # the same where τ may have any scale, which hides much of a wrong sign
    clear: float = 0.7  # improvement (log of the unexplained part) that is clear: it halves
    # the same that makes exchanged columns of two joints certain; at most 0.07 in eight good sets
    exchanged: float = 2.0
    order_checked: float = 0.9  # share of every torque above which no exchange is tried
    model_error: float = 3e-3  # unexplained share of a torque below which nothing is told
    stated_gear: float = 0.1  # gain granted to a gear that the mapping states and does not use
    same_share: float = 0.05  # difference of two shares that says nothing
    smallest_share: float = 0.5  # share that the changed joints must reach
    unexplained: float = 0.2  # share below which a joint is called unexplained
    scale_gain: float = 0.2  # share that another scale of τ must add to be called a wrong unit
    shortest_motion: float = 1.0  # [s] of all groups together; shorter ones prove nothing
    resting: float = 1e-3  # [rad/s] a joint that is never faster does not move

    # Motion against the joint's limits
    beyond: float = 1.3  # times range or speed at which θ is odd
    far_beyond: float = 3.0  # the same at which θ is certainly wrong
    small_motion: float = 0.2  # [rad] a larger motion is in no smaller unit than stated

    # Columns against each other
    same_motion: float = 0.95  # squared correlation of θ and q above which both are the same motion
    follows: float = 0.8  # squared correlation above which a column is θ in another unit
    near: float = 1.25  # largest ratio of a correct slope to 1
    agrees: float = 1.06  # the same for a slope that a unit or a known gear explains
    zero: float = 0.1  # [rad] a larger mean difference is no deflection of a spring
    # correlation of θ − q with τ below which both are swapped; a spring makes it positive
    swapped: float = -0.7
    gear_motion: float = 0.98  # squared correlation of θ and q needed to find a gear
    gears: tuple[float, float] = (5.0, 500.0)  # smallest and largest ratio taken for a gear
    whole_std: float = 0.3  # largest standard error with which a ratio near a whole number is taken for it
    degrees: float = 0.03  # relative difference to 180/π within which a ratio is a unit, no gear


LIMITS = ImportThresholds()
