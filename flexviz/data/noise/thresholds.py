"""Physical sizes and tolerances of the checks of recorded signals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class NoiseThresholds:
    """What a sensor can resolve, what a joint can do, and how much noise a signal may have.

    `python -m benchmarks.signal_checks SET…` prints for each set what these are compared with.
    """

    # Resolution of a realistic sensor: a smaller noise is not believed
    torque_resolution: float = 2.0**-18  # share of the recorded range; registers have 12 to 16 bits
    position_resolution: float = 2 * np.pi * 2.0**-24  # [rad] encoders at the joint have up to 2^22 counts
    range_tail: float = 0.01  # share of the samples at either end of a range that do not count (single peaks)

    # Estimates
    rounding: float = 1e-12  # share of the largest value up to which a difference is rounding of floats
    held_regularly: float = 0.9  # share of the values that last a multiple of the same number of samples,
    held_steps: float = 3.0  # and steps in counts: an encoder at slow speed moves by single ones
    count_quantile: float = 0.05  # of the steps that are not 0: a count, whatever single values are between
    fewest_counts: float = 16.0  # different ones in a signal that is in counts: one of fewer is switched
    off_count: float = 0.01  # of a count, by which values that are counts may differ from a multiple
    counts_per_row: float = 4.0  # a column that moves by more and does not change repeats a value
    repeated: float = 1.1  # samples per new value from which a signal is one recorded more slowly
    stale: float = 0.05  # [s] a value that stands longer than this, and this many times as long as
    stale_runs: float = 10.0  # nearly all others, is stale where the joint moves
    outlier: float = 10.0  # times the median difference from which one is no noise

    # Filtered logs
    first_order: float = 2.5  # by which the level falls from 0.07 to 0.27 times the rate behind a first-order
    falling: float = 1.7  # filter (3.2 far above its cut-off); single joints of such a log fall by this
    steep: float = 50.0  # behind a filter of third order; the torque of friction falls by up to 15
    above_stop_band: float = 10.0  # times the level at a quarter of the rate that counts as content
    torque_content: float = 256.0  # times the finest resolution that counts as content: 2^-10 of the range
    position_content: float = 4.0  # the same of a position: a count of an encoder with 2^22 counts a turn

    # Jumps of a position: within one sample, by more than all of
    jump: float = 0.01  # [rad], [m] which no sensor errs by and a motor's turn behind a gear of 600 exceeds
    jump_speed: float = 2.0  # times the joint's speed limit
    jump_noise: float = 10.0  # times the noise
    jump_steps: float = 3.0  # times the usual step, as large as a count of a very coarse encoder;
    jump_beyond_noise: float = 0.1  # [rad], [m] which neither noise nor a count reaches

    # Dropped values: one number, at least this many times,
    dropped: int = 3
    dropped_seconds: float = 0.02  # [s] for no longer than this (torque steps on purpose last longer),
    dropped_steps: float = 10.0  # away from both neighbours by more than this many usual steps

    # Torques from outside: against masses, inertia and friction
    smoothed: float = 0.25  # [s] three means over it, one of the other, leave 6 % of a vibration of 2.5 Hz
    resting: float = 5e-3  # [rad/s], [m/s] a slower joint rests
    standing: float = 0.4  # [s] shorter rests and contacts tell nothing
    held: float = 0.5  # of the torque that would hold the joint, from which one at rest may not hold it
    static: float = 2.0  # times its Coulomb friction that a joint may have at rest
    off: float = 6.0  # times the usual error in motion from which a torque at rest does not hold the joint
    far_off: float = 10.0  # times the usual error, and
    push: float = 0.3  # this share of the torque's spread, from which a torque in motion comes from outside
    same_motion: float = 0.5  # of their spreads by which position and velocity may differ in the same motion
    contact_share: float = 0.25  # of the recording; more is no exception

    # Noise against the signal
    period: float = 0.1  # [s] means over it keep what is below 4 Hz, the narrowest band of an identification
    noise_only: float = 0.8  # share of the variance of such means from which a torque is nothing but noise
    noticeable: float = 0.1  # share of the noise in a joint's torque from which it is told
    noise_torque: float = 1.0  # torque that it takes to follow the noise of a position over the joint's own,
    least_torque: float = 0.01  # which counts as this share of the largest joint's at least: refused


THRESHOLDS = NoiseThresholds()
