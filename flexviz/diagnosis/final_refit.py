"""Final refit of a complete model, with weights closer to the noise spectrum.

Models are compared with weights under which a trace of an approximate law does no harm; that costs a fifth of
the accuracy. A model that explains everything down to the noise need not pay it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.evidence import fit_covariance
from flexviz.diagnosis.fit_context import SEARCH_WEIGHTING, Fit, FitContext
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.estimation import Covariance
from flexviz.measurements import MeasurementSet

Array = NDArray[np.float64]

# chosen by the standard errors of planar arms with one effect; wider bands or more samples gain nothing
# with more joints, what can be paid for gains a fortieth (Panda, UR5) for half a minute
FINAL_WEIGHTING = replace(SEARCH_WEIGHTING, hertz=16.0, orders={1: 40, 2: 40, 3: 32}, ridge=1e-8)
ITERATIONS = 8


@dataclass(frozen=True, eq=False)
class FinalRefit:
    """Values of all parameters, shape (P,), and their covariance."""

    x: Array
    covariance: Covariance


def final_refit(measurements: MeasurementSet, fit: Fit, check: Callable[[], None]) -> FinalRefit | None:
    """The same model fitted with the closer weighting.

    None for robots with more joints than `FINAL_WEIGHTING` has orders for, and where the refit explains the
    data less well.

    Args:
        measurements: the set.
        fit: a model that explains everything.
        check: called before each step; may raise to stop.
    """
    if fit.layout.n not in FINAL_WEIGHTING.orders:
        return None
    context = FitContext(measurements, fit.layout, FINAL_WEIGHTING)
    closer = context.fit(fit.layout, fit.x, iterations=ITERATIONS, check=check)
    worst = THRESHOLDS.evidence.final_refit_chi * max(float(fit.chi.max()), 1.0)
    if not closer.converged or closer.chi.max() > worst:
        return None
    return FinalRefit(closer.x, fit_covariance(context, closer))
