"""The last fit once more, from nearly all that the data say.

What tells models apart is weighted so that a trace of a law that is only nearly right does no harm, and that
costs a fifth of the accuracy. A model that explains everything down to the noise need not pay it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.evidence import fit_covariance
from flexviz.diagnosis.fit_context import SEARCH_WEIGHTING, Fit, FitContext
from flexviz.estimation import Covariance
from flexviz.measurements import MeasurementSet

Array = NDArray[np.float64]

# chosen by the standard errors of planar arms with one effect; wider bands or more samples gain nothing
# of more joints, what can be paid for gains a fortieth (Panda, UR5) for half a minute
FINAL_WEIGHTING = replace(SEARCH_WEIGHTING, hertz=16.0, orders={1: 40, 2: 40, 3: 32}, ridge=1e-8)
ITERATIONS = 8
WORSE = 1.5  # times the mean square of the whitened residual, from which on traces weigh too much


@dataclass(frozen=True, eq=False)
class FinalRefit:
    """Values and their uncertainty.

    Attributes:
        x: shape (P,).
        covariance: of the parameters.
    """

    x: Array
    covariance: Covariance


def final_refit(measurements: MeasurementSet, fit: Fit, check: Callable[[], None]) -> FinalRefit | None:
    """The same model fitted with the closer weighting.

    None for robots with more joints than `SHARP` has orders for, and where it explains the data less well.

    Args:
        measurements: the set.
        fit: a model that explains everything.
        check: called before each step; may raise to stop.
    """
    if fit.layout.n not in FINAL_WEIGHTING.orders:
        return None
    context = FitContext(measurements, fit.layout, FINAL_WEIGHTING)
    closer = context.fit(fit.layout, fit.x, iterations=ITERATIONS, check=check)
    if not closer.converged or closer.chi.max() > WORSE * max(float(fit.chi.max()), 1.0):
        return None
    return FinalRefit(closer.x, fit_covariance(context, closer))
