"""What is told during a diagnosis: its stages, how long they last, and the best model so far."""

from __future__ import annotations

import numpy as np

from flexviz.diagnosis.fit_context import Fitted
from flexviz.diagnosis.motion_samples import Phases
from flexviz.diagnosis.prediction_errors import Known, PredictionErrorBand
from flexviz.equation import Layout
from flexviz.progress import BestSoFar
from flexviz.wording import MOST_NAMED, JointErrors, listed, stated_errors, text_names

OWN_MODEL = "fitting the set's own model to the noise"
USUAL = "fitting all usual effects on all joints"
FINE = "refining the model in units of the sensors' noise"
STAIRS = "fitting the models on the way"
PLACE = "looking for the place of an unknown law"
FREE_CURVE = "adding a free curve"
LOCATION = "locating the residual"
BANDWIDTH = "checking parameters against the observer's bandwidth"

# of the whole that is done when a stage begins
SHARES = {USUAL: 0.1, FINE: 0.6, STAIRS: 0.75, LOCATION: 0.85, PLACE: 0.9, FREE_CURVE: 0.9, BANDWIDTH: 0.95}


class Standing:
    """The best model so far, from the set's `own` one on; errors are those of the band."""

    def __init__(self, own: Layout, band: PredictionErrorBand) -> None:
        self.own, self.band = own, band
        self._own_fit: Known | None = None
        self._own_errors: dict[bytes, JointErrors] = {}  # its own, by which samples count
        self._best = np.inf  # its error

    def news(self, fit: Fitted, first_phase: Phases | None = None) -> BestSoFar | None:
        """What is told of a fit, if it is better; `first_phase`, shape (n,): as in `PredictionErrorBand`."""
        added = [effect for effect in fit.layout.effects if effect not in self.own.effects]
        if self._own_fit is not None and not added:
            return None
        errors, spread = self.band.errors(fit, first_phase), self.band.measurements.torque_spread
        now, told = stated_errors(errors, spread), f"{errors.stated_name} error"
        if self._own_fit is None:
            self._own_fit = Known(fit.layout, fit.x)  # the rest of a fit takes memory
            worst = f"{self.own.joints[now.order[0]]} {now.text(now.order[0])}"
            return BestSoFar("", f"{told} of the present model {now.whole()}; most: {worst}")
        if now.mean >= self._best:
            return None
        self._best = now.mean
        counted = b"" if first_phase is None else first_phase.tobytes()
        if counted not in self._own_errors:
            own = self.band.errors(self._own_fit, first_phase)
            self._own_errors[counted] = stated_errors(own, spread)
        before = self._own_errors[counted]
        names = text_names([effect.text(self.own.joints) for effect in added], self.own.joints)
        more = len(names) - MOST_NAMED
        model = listed([*names[:MOST_NAMED], f"{more} more"] if more > 0 else names)
        return BestSoFar(model, f"{told} {before.short()} → {now.text()}")
