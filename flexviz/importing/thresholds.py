"""Thresholds of the checks of an import, with their reasons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ImportThresholds:
    """When imported data look wrong or odd.

    `python -m benchmarks.import_faults SET…` supports the thresholds of the torque checks: it counts how
    often good sets raise an issue and how often a fault put into them is named. `pytest -k test_import`
    supports the others.

    Clocks and columns:
        repeated_instants: share of repeated instants above which a clock is too coarse to be used.
        late_messages: [s] messages that come late by less are sorted; later ones are another run.
        held_ends: share of rows in which a column for comparison may repeat its first or last value.
        continued_steps: own steps by which a signal may be continued beyond its first and last sample.
        clock_offset: [s] a smaller offset of the link clock is normal (driver latency).
        clock_sigmas: standard errors by which an offset must differ from 0.
        same_velocity: correlation of the velocities of θ and q above which both show the same motion.

    Delay of the torque:
        smallest_delay: [s] friction unknown to the model can look like a shorter one.
        delay_steps: a torque held for a step seems half a step early.
        delay_sigmas: standard errors by which a delay must differ from 0.
        torque_explained: share of τ that the model must explain; delays are then believed.
        torque_explained_loosely: the same where the delay itself moves more torque than is left unexplained.

    Torques against the robot's masses:
        slopes: of τ against the CAD model; masses are known roughly.
        motor_inertia: largest motor inertia at the joint side, in units of the joint's largest M_jj(q).
        small_link: share of the largest diagonal entry granted to every joint: wrists have large motors.
        explained_well: share of every joint's torque above which no fault is searched.
        gain: sum of shares that a change must add, enough to exclude chance.
        free_gain: the same where τ may have any scale, which hides much of a wrong sign.
        stated_gear: gain granted to a gear that the mapping states and does not use.
        believed: share that the changed joints must reach.
        unexplained: share below which a joint is called unexplained.
        scale_gain: share that another scale of τ must add to be called a wrong unit.
        shortest_motion: [s] of all groups together; shorter ones prove nothing.
        resting: [rad/s] a joint that is never faster does not move.

    Motion against the joint's limits:
        fastest, widest: [rad/s], [rad] limits assumed where the robot description has none.
        beyond, far_beyond: times range or speed at which θ is odd, and certainly wrong.
        small_motion: [rad] a larger motion is in no smaller unit than stated.

    Columns against each other:
        same_motion: squared correlation of θ and q above which both are the same motion.
        follows: squared correlation above which a column is θ in another unit.
        near: largest ratio of a correct slope to 1.
        agrees: the same for a slope that a unit or a known gear explains.
        zero: [rad] a larger mean difference is no deflection of a spring.
        swapped: correlation of θ − q with τ below which both are swapped; a spring makes it positive.
        gear_motion: squared correlation of θ and q needed to find a gear.
        gears: smallest and largest ratio taken for a gear.
        whole_std: largest standard error with which a ratio near a whole number is taken for it.
        degrees: relative difference to 180/π within which a ratio is a unit, no gear.
    """

    repeated_instants: float = 0.2
    late_messages: float = 1.0
    held_ends: float = 0.05
    continued_steps: float = 1.5
    clock_offset: float = 2e-3
    clock_sigmas: float = 3.0
    same_velocity: float = 0.6

    smallest_delay: float = 1e-3
    delay_steps: float = 0.75
    delay_sigmas: float = 5.0
    torque_explained: float = 0.99
    torque_explained_loosely: float = 0.9

    slopes: tuple[float, float] = (0.4, 2.5)
    motor_inertia: float = 4.0
    small_link: float = 0.05
    explained_well: float = 0.7
    gain: float = 0.4
    free_gain: float = 0.2
    stated_gear: float = 0.1
    believed: float = 0.5
    unexplained: float = 0.2
    scale_gain: float = 0.2
    shortest_motion: float = 1.0
    resting: float = 1e-3

    fastest: float = 40.0
    widest: float = 8 * np.pi
    beyond: float = 1.3
    far_beyond: float = 3.0
    small_motion: float = 0.2

    same_motion: float = 0.95
    follows: float = 0.8
    near: float = 1.25
    agrees: float = 1.06
    zero: float = 0.1
    swapped: float = -0.7
    gear_motion: float = 0.98
    gears: tuple[float, float] = (5.0, 500.0)
    whole_std: float = 0.3
    degrees: float = 0.03


LIMITS = ImportThresholds()
