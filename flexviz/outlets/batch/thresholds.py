"""Decision thresholds of the evaluation of a fleet."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FleetThresholds:
    """When a parameter drifts, when a set stands out; `pytest tests/outlets/test_batch_fleet.py` supports it.

    Attributes:
        false_alarms: probability that a fleet in which nothing changes has any drift, or any outlier, named,
            and that a robot whose stated errors are right has any value whose spread exceeds them: single
            probabilities are divided by the number of parameters or values that are judged.
        least_drift: change over the recorded time relative to the mean; a smaller one is not named however
            certain it is, because temperature and load alone change friction by more.
        least_recordings: of one robot, from which it is said what comes back: of two that differ, neither is
            the rule.
        least_dates: instants from which a slope has an uncertainty that can be estimated (two would always
            lie on a line).
        least_fleet: values from which their spread can be estimated robustly.
        robust_freedom: degrees of freedom of a spread from the median absolute deviation, per value: it is
            0.37 times as efficient as the standard deviation of normal values.
    """

    false_alarms: float = 0.01
    least_drift: float = 0.02
    least_recordings: int = 3
    least_dates: int = 4
    least_fleet: int = 6
    robust_freedom: float = 0.37


THRESHOLDS = FleetThresholds()
