"""Physical sizes and tolerances of what is estimated from recorded signals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class NoiseThresholds:
    """What a sensor can resolve, and by which steps noise, counts and jumps are told apart."""

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
    outlier: float = 10.0  # times the median difference from which one is no noise

    # Jumps of a position: within one sample, by more than its
    # speed, and
    jump: float = 0.01  # [rad], [m] which no sensor errs by and a motor's turn behind a gear of 600 exceeds
    jump_noise: float = 10.0  # times the noise
    jump_steps: float = 3.0  # times the usual step, as large as a count of a very coarse encoder;
    jump_beyond_noise: float = 0.1  # [rad], [m] which neither noise nor a count reaches


THRESHOLDS = NoiseThresholds()
# a position that jumps away and comes back, or a number that stands for a missing one, lasts no longer than
SHORT = 0.02  # [s] torque steps on purpose do
