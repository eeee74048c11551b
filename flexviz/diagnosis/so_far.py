"""What is told during a diagnosis: its stages, how long they last, and the best model so far."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from flexviz.diagnosis.fit_context import Fitted
from flexviz.diagnosis.motion_samples import Phases
from flexviz.diagnosis.prediction_errors import Known, PredictionErrorBand
from flexviz.effects import ChosenEffect
from flexviz.equation import Layout
from flexviz.progress import BestSoFar, Pace
from flexviz.wording import by_share, left_text, listed, mean_nrms, percent, text_names

OWN_MODEL = "fitting the set's own model to the noise"
USUAL = "fitting all usual effects on all joints"
FINE = "refining the model in units of the sensors' noise"
STAIRS = "fitting the models on the way"
PLACE = "looking for the place of an unknown law"
FREE_CURVE = "adding a free curve"
LOCATION = "locating the residual"
BANDWIDTH = "checking parameters against the observer's bandwidth"

SHARES = {
    USUAL: 0.1, FINE: 0.6, STAIRS: 0.75, FREE_CURVE: 0.9, LOCATION: 0.85, PLACE: 0.9, BANDWIDTH: 0.95,
}  # fmt: skip
SECONDS = 9.0  # per joint: a first guess; the first stage then tells more
NAMED = 3  # names in a list, before "and more"


def pace(joints: int) -> Pace:
    """The pace of a diagnosis."""
    return Pace(SECONDS * joints, 1 / SHARES[USUAL], 1.0, SHARES)


class Standing:
    """Calls `tell` with the best model so far, from the set's `own` one on; errors are those of the band."""

    def __init__(
        self, own: Layout, band: PredictionErrorBand, tell: Callable[[BestSoFar], None] | None
    ) -> None:
        self.own, self.band, self._tell = own, band, tell
        self.spread = band.measurements.torque_spread
        self._own_fit: Known | None = None
        self._best = np.inf  # its share of the torque

    def own_model(self, fit: Fitted) -> None:
        """The set's own model is fitted."""
        if self._tell is None:
            return
        self._own_fit = Known(fit.layout, fit.x)  # the rest of a fit takes memory
        errors = self.band.errors(fit)
        rms, j = errors.stated, by_share(errors.stated, self.spread)[0]
        only, floor, share = slice(j, j + 1), errors.noise_floor, percent(mean_nrms(rms, self.spread))
        worst = left_text(self.own.joints[only], rms[only], self.spread[only], floor[only])
        error = f"{errors.stated_name} error of the present model {share} of the torque; most: {worst}"
        self._tell(BestSoFar("", error))

    def fitted(self, fit: Fitted, first_phase: Phases | None = None) -> None:
        """A larger model is fitted; `first_phase`, shape (n,): the first phase of each joint that counts."""
        added = [effect for effect in fit.layout.effects if effect not in self.own.effects]
        if self._tell is None or self._own_fit is None or not added:
            return
        errors = self.band.errors(fit, first_phase)
        share = mean_nrms(errors.stated, self.spread)
        if share < self._best:
            self._best = share
            before = mean_nrms(self.band.errors(self._own_fit, first_phase).stated, self.spread)
            error = f"{errors.stated_name} error {percent(before)} → {percent(share)} of the torque"
            self._tell(BestSoFar(self._names(added), error))

    def _names(self, effects: Sequence[ChosenEffect]) -> str:
        names = text_names([effect.text(self.own.joints) for effect in effects], self.own.joints)
        more = len(names) - NAMED
        return listed([*names[:NAMED], f"{more} more"] if more > 1 else names)
