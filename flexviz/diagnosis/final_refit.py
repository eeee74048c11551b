"""Final refit of a complete model, with weights closer to the noise spectrum.

The weights of the search tolerate the small errors of approximate effect models, which costs a fifth of the
accuracy. A model that explains the data down to the noise does not need this tolerance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.candidates import ModelStart
from flexviz.diagnosis.fit_context import SEARCH_WEIGHTING, Fit, FitContext
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.equation import Layout
from flexviz.estimation import Covariance
from flexviz.measurements import MeasurementSet
from flexviz.parallel import Foreseen

Array = NDArray[np.float64]

# chosen by the standard errors of planar arms with one effect; wider bands or more samples gain nothing;
# with more joints (Panda, UR5) affordable orders gain 2.5 % for half a minute
FINAL_WEIGHTING = replace(SEARCH_WEIGHTING, hertz=16.0, orders={1: 40, 2: 40, 3: 32}, ridge=1e-8)
MAX_ITERATIONS = 8


@dataclass(frozen=True, eq=False)
class FinalRefit:
    """Refitted parameters, shape (P,), their covariance, and the largest χ of the joints."""

    x: Array
    covariance: Covariance
    chi: float


def final_refit(measurements: MeasurementSet, fit: Fit, check: Callable[[], None]) -> FinalRefit | None:
    """Refit of a complete model with the closer weighting.

    Returns:
        None for more joints than `FINAL_WEIGHTING` lists, or if the refit explains the data less well.
    """
    closer = _refit(measurements, ModelStart(fit.layout, fit.x), check)
    return closer if closer is not None and _as_well(closer, fit) else None


def _refit(measurements: MeasurementSet, start: ModelStart, check: Callable[[], None]) -> FinalRefit | None:
    """None for too many joints, or if it does not converge."""
    if start.layout.n not in FINAL_WEIGHTING.orders:
        return None
    context = FitContext(measurements, start.layout, FINAL_WEIGHTING)
    closer = context.fit(start.layout, start.x, iterations=MAX_ITERATIONS, check=check)
    if not closer.converged:
        return None
    return FinalRefit(closer.x, context.covariance(closer), float(closer.chi.max()))


def _as_well(closer: FinalRefit, fit: Fit) -> bool:
    return closer.chi <= THRESHOLDS.evidence.final_refit_chi * max(float(fit.chi.max()), 1.0)


def _agree(closer: FinalRefit, fit: Fit) -> bool:
    """Whether two fits of a model are in the same minimum."""
    std = closer.covariance.standard_errors
    known = std > 0
    apart = np.abs(closer.x - fit.x)[known] / std[known]
    return bool(np.all(apart < THRESHOLDS.evidence.other_minimum))


class EarlyRefit:
    """The final refit of a model that is probably the last, begun before the search has come to it.

    Args:
        measurements: the set.
        check: called before each step of a refit; may raise to stop.
    """

    def __init__(self, measurements: MeasurementSet, check: Callable[[], None]) -> None:
        self.measurements, self.check = measurements, check
        self.foreseen = Foreseen[Layout, FinalRefit | None]()

    def begin(self, start: ModelStart) -> None:
        """Begin with this model, instead of an earlier one."""
        if start.layout.n in FINAL_WEIGHTING.orders:
            self.foreseen.begin(start.layout, lambda: _refit(self.measurements, start, self.check))

    def of(self, fit: Fit) -> FinalRefit | None:
        """The refit of a model; None as for `final_refit`."""
        closer = self.foreseen.take(fit.layout)
        if closer is not None and _as_well(closer, fit) and _agree(closer, fit):
            return closer
        return final_refit(self.measurements, fit, self.check)
