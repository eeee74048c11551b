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
from flexviz.parallel import Background
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


class EarlyRefit:
    """The final refit of a model that is probably the last, begun while the search looks for more.

    Args:
        measurements: the set.
        check: called before each step of a refit; may raise to stop.
    """

    def __init__(self, measurements: MeasurementSet, check: Callable[[], None]) -> None:
        self.measurements, self.check = measurements, check
        self._fit: Fit | None = None
        self._work: Background[FinalRefit | None] | None = None

    def begin(self, fit: Fit) -> None:
        """Begin with this model instead of an earlier one."""
        self.close()
        if fit.layout.n in FINAL_WEIGHTING.orders:
            self._fit, self._work = fit, Background(lambda: final_refit(self.measurements, fit, self.check))

    def of(self, fit: Fit) -> FinalRefit | None:
        """The refit of a model."""
        if self._work is None or self._fit is not fit:
            self.begin(fit)
        return self._work.result() if self._work is not None else None

    def close(self) -> None:
        """End what was begun."""
        if self._work is not None:
            self._work.close()
            self._work = None
