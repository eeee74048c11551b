"""The best model so far, for whoever waits for a diagnosis or stops it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from flexviz.diagnosis.fit_context import Fitted
from flexviz.diagnosis.motion_samples import Phases
from flexviz.diagnosis.prediction_errors import Known, PredictionErrorBand
from flexviz.effects import ChosenEffect
from flexviz.equation import Layout
from flexviz.progress import BestSoFar
from flexviz.wording import by_share, left_text, listed, mean_nrms, percent, text_names

NAMED = 3  # families of effects


class Standing:
    """Tells how the search for the missing effects stands.

    Args:
        own: the set's own model.
        band: band in which errors are stated.
        tell: called with the best model so far; None if nobody listens.
    """

    def __init__(
        self, own: Layout, band: PredictionErrorBand, tell: Callable[[BestSoFar], None] | None
    ) -> None:
        self.own, self.band, self._tell = own, band, tell
        self.spread = band.measurements.torque_spread
        self._own_fit: Known | None = None
        self._own_errors: dict[bytes, Sequence[float]] = {}  # by what of the joints' standstill is apart
        self._best = np.inf  # its share of the torque

    def own_model(self, fit: Fitted) -> None:
        """The set's own model is fitted."""
        if self._tell is None:
            return
        self._own_fit, self._own_errors = Known(fit.layout, fit.x), {}  # the rest of a fit takes memory
        errors = self.band.errors(fit)
        rms, floor = errors.rms_validation or errors.rms, errors.noise_floor
        j = by_share(rms, self.spread)[0]
        only = slice(j, j + 1)
        worst = left_text(self.own.joints[only], rms[only], self.spread[only], floor[only])
        share = percent(mean_nrms(rms, self.spread))
        error = f"{self.band.stated} error of the present model {share} of the torque; most: {worst}"
        self._tell(BestSoFar("", error))

    def promising(self, effect: ChosenEffect) -> None:
        """This candidate scores best; none is fitted yet."""
        if self._tell is not None:
            self._tell(BestSoFar(self._names([effect]), "scores best of all candidates, not fitted yet"))

    def fitted(self, fit: Fitted, first_phase: Phases | None = None) -> None:
        """A larger model is fitted; `first_phase`, shape (n,): the first phase of each joint that counts."""
        added = [effect for effect in fit.layout.effects if effect not in self.own.effects]
        if self._tell is None or self._own_fit is None or not added:
            return
        rms = self.band.stated_rms(fit, first_phase)
        share = mean_nrms(rms, self.spread)
        if share < self._best:
            self._best = share
            before = mean_nrms(self._own_rms(first_phase), self.spread)
            error = f"{self.band.stated} error {percent(before)} → {percent(share)} of the torque"
            self._tell(BestSoFar(self._names(added), error))

    def _names(self, effects: Sequence[ChosenEffect]) -> str:
        names = text_names([effect.text(self.own.joints) for effect in effects], self.own.joints)
        more = len(names) - NAMED
        return listed([*names[:NAMED], f"{more} more"] if more > 1 else names)

    def _own_rms(self, first_phase: Phases | None) -> Sequence[float]:
        """Error of the set's own model per joint [Nm]."""
        assert self._own_fit is not None
        key = b"" if first_phase is None else first_phase.tobytes()
        if key not in self._own_errors:
            self._own_errors[key] = self.band.stated_rms(self._own_fit, first_phase)
        return self._own_errors[key]
