"""The stages of a diagnosis, and how much of it is usually done when each begins."""

from __future__ import annotations

from enum import StrEnum

from flexviz.base.facts import Fact


class SearchStage(StrEnum):
    """The stages of a diagnosis, in their order; from its model's error some are left out."""

    OWN_MODEL = "own-model"
    SURVEY = "survey"
    USUAL = "usual"
    SEARCH = "search"
    FOUND = "found"
    FINE = "fine"
    STAIRS = "stairs"
    LOCATION = "location"
    PLACE = "place"
    FREE_CURVE = "free-curve"
    BANDWIDTH = "bandwidth"

    @property
    def fact(self) -> Fact:
        """That it has begun."""
        return Fact("search-stage", values={"stage": str(self)})


STAGE_SHARES: dict[Fact, tuple[float, float, float]] = {
    SearchStage.SEARCH.fact: (0.07, 0.25, 0.55),
    SearchStage.FOUND.fact: (0.24, 0.6, 0.65),
    SearchStage.FINE.fact: (0.4, 0.63, 0.9),
    SearchStage.STAIRS.fact: (0.67, 0.9, 0.98),
    SearchStage.LOCATION.fact: (0.84, 0.98, 1.0),
    SearchStage.PLACE.fact: (0.84, 0.98, 1.0),
    SearchStage.FREE_CURVE.fact: (0.84, 0.98, 1.0),
    SearchStage.BANDWIDTH.fact: (0.9, 0.98, 1.0),
}
"""Stage → share of the processor time that is done when it begins, at least and at most, and when it ends.

The extremes of practice, robot-like and recorded sets of two to seven joints: `python -m benchmarks.pace`.
"""
