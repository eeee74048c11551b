"""The present model from the values of a larger one: does it fit as well without the effect?

A fit in a distant local minimum is improved by any effect that happens to lead out of it. Near the noise, the
gain is then much more than the square of the effect's size in standard errors, about which a real one gains.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.acceptance import Gained, excess, needed_gain, size_in_errors
from flexviz.diagnosis.comparison import RefittedCandidate
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.parallel import Foreseen

Array = NDArray[np.float64]


class Restart:
    """Refits of the present model from a candidate's values, begun while the candidate meets its rivals.

    Args:
        context: the data.
        check: called before each step of a refit; may raise to stop.
    """

    def __init__(self, context: FitContext, check: Callable[[], None]) -> None:
        self.context, self.check = context, check
        self.foreseen = Foreseen[RefittedCandidate, bool]()

    def advisable(self, fit: Fit, best: RefittedCandidate) -> bool:
        """Whether the effect may have led out of a local minimum only."""
        if excess(fit) >= THRESHOLDS.search.far_off:
            return True
        size = size_in_errors(self.context, best.fit, best.effect)
        return fit.objective - best.fit.objective > THRESHOLDS.search.more_than_its_size * size**2

    def begin(self, fit: Fit, best: RefittedCandidate, gained: Gained) -> None:
        """Begin with this candidate; earlier effects gained `gained`."""
        self.foreseen.begin(best, lambda: self._refit(fit, best, gained) is None)

    def of(self, fit: Fit, best: RefittedCandidate, gained: Gained) -> Fit | None:
        """The present model if it fits as well; else None."""
        needed = self.foreseen.take(best)
        return None if needed else self._refit(fit, best, gained)

    def _refit(self, fit: Fit, best: RefittedCandidate, gained: Gained) -> Fit | None:
        needed = needed_gain(best.effect, gained)
        again = self.context.fit(
            fit.layout, common_values(best.fit, fit), iterations=THRESHOLDS.search.full_refit,
            check=self.check, near=best.fit, beat=best.fit.point.objective + needed,
        )  # fmt: skip
        return again if again.objective < best.fit.objective + needed else None


def common_values(leader: Fit, before: Fit) -> Array:
    """Parameters of `before` with the leader's values; effects that the leader lacks keep their own."""
    x = before.layout.vector(leader.layout.model(leader.x))
    for effect, where in before.layout.effect_slices():
        if effect not in leader.layout.effects:
            x[where] = before.x[where]
    return x
