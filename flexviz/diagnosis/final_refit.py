"""Final refit of a complete model, with weights closer to the noise spectrum.

The weights of the search tolerate the small errors of approximate effect models, which costs a fifth of the
accuracy. A model that explains the data down to the noise does not need this tolerance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.fit_context import SEARCH_WEIGHTING, Fit, FitContext
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.estimation import Covariance
from flexviz.measurements import MeasurementSet
from flexviz.results import Verdict

Array = NDArray[np.float64]

# chosen by the standard errors of planar arms with one effect; wider bands or more samples gain nothing;
# with more joints (Panda, UR5) affordable orders gain 2.5 % for half a minute
FINAL_WEIGHTING = replace(SEARCH_WEIGHTING, hertz=16.0, orders={1: 40, 2: 40, 3: 32}, ridge=1e-8)
MAX_ITERATIONS = 8


@dataclass(frozen=True, eq=False)
class FinalRefit:
    """Refitted parameters, shape (P,), and their covariance."""

    x: Array
    covariance: Covariance


@dataclass(frozen=True, eq=False)
class Conclusion:
    """Final model with verdict and covariance; `refined`: refitted with weights closer to the noise."""

    fit: Fit
    verdict: Verdict
    covariance: Covariance
    refined: bool = False


def final_refit(measurements: MeasurementSet, fit: Fit, check: Callable[[], None]) -> FinalRefit | None:
    """Refit of a complete model with the closer weighting.

    Returns:
        None for more joints than `FINAL_WEIGHTING` lists, or if the refit explains the data less well.
    """
    if fit.layout.n not in FINAL_WEIGHTING.orders:
        return None
    context = FitContext(measurements, fit.layout, FINAL_WEIGHTING)
    closer = context.fit(fit.layout, fit.x, iterations=MAX_ITERATIONS, check=check)
    worst = THRESHOLDS.evidence.final_refit_chi * max(float(fit.chi.max()), 1.0)
    if not closer.converged or closer.chi.max() > worst:
        return None
    return FinalRefit(closer.x, context.covariance(closer))
