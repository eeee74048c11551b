"""What the results of an analysis belong to: all texts on fit, verdict and next step follow from this."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

from flexviz.analysis.identification import FitSettings
from flexviz.content.results import at_bounds
from flexviz.content.session.state import Analysis

Belongs = Literal["none", "earlier", "present"]


@dataclass(frozen=True)
class ResultStanding:
    """Whether fit and verdict are those of the present model, observer and data.

    Attributes:
        fit: of the identification.
        verdict: of the diagnosis.
        errors: the result whose error the pages state; "" without one. A diagnosis of the present model
            knows which samples to judge apart, but it does not judge a fit with another observer.
        bounds: what values at their bounds say about the fit; "" if there are none.
    """

    fit: Belongs
    verdict: Belongs
    errors: Literal["", "fit", "verdict"]
    bounds: str = ""


@lru_cache(maxsize=4)  # every text of the page asks
def standing(analysis: Analysis) -> ResultStanding:
    """The standing of the results of an analysis."""
    result, diagnosis = analysis.identification, analysis.diagnosis
    fit: Belongs = "none" if result is None else "present" if analysis.up_to_date else "earlier"
    verdict: Belongs = "present" if analysis.diagnosis_up_to_date else "earlier"
    if diagnosis is None:
        verdict = "none"
    bounds = " ".join(at_bounds(result.parameters)) if result is not None else ""
    if diagnosis is not None and verdict == "present" and diagnosis.steps and not _own_fit(analysis):
        return ResultStanding(fit, verdict, "verdict", bounds)
    return ResultStanding(fit, verdict, "" if result is None else "fit", bounds)


def _own_fit(analysis: Analysis) -> bool:
    """Whether the fit is not the diagnosis's own, nor one with the observer and stages of a new session."""
    result, fitted = analysis.identification, analysis.fitted
    if result is None or fitted is None or not result.iterations:
        return False
    return replace(fitted.fit, effects=()) != FitSettings()
