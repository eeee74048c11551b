"""The stages of a diagnosis in words, and how much of it is usually done when each begins."""

from __future__ import annotations

from enum import StrEnum


class SearchStage(StrEnum):
    """The stages of a diagnosis, in their order; from its model's error some are left out."""

    OWN_MODEL = "fitting the set's own model to the noise"
    SURVEY = "estimating what each effect alone would remove"
    USUAL = "fitting all usual effects on all joints"
    SEARCH = "searching for what the usual effects leave"
    FOUND = "checking what was found"
    FINE = "refining the model in units of the sensors' noise"
    STAIRS = "fitting the models on the way"
    LOCATION = "locating the residual"
    PLACE = "looking for the place of an unmodelled torque"
    FREE_CURVE = "adding a free curve"
    BANDWIDTH = "checking parameters against the observer's bandwidth"


STAGE_SHARES: dict[str, tuple[float, float, float]] = {
    SearchStage.SEARCH: (0.07, 0.25, 0.55),
    SearchStage.FOUND: (0.24, 0.6, 0.65),
    SearchStage.FINE: (0.4, 0.63, 0.9),
    SearchStage.STAIRS: (0.67, 0.9, 0.98),
    SearchStage.LOCATION: (0.84, 0.98, 1.0),
    SearchStage.PLACE: (0.84, 0.98, 1.0),
    SearchStage.FREE_CURVE: (0.84, 0.98, 1.0),
    SearchStage.BANDWIDTH: (0.9, 0.98, 1.0),
}
"""Stage → share of the processor time that is done when it begins, at least and at most, and when it ends.

The extremes of practice, robot-like and recorded sets of two to seven joints: `python -m benchmarks.pace`.
"""
