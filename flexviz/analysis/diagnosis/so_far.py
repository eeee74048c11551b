"""The best model so far of a diagnosis that goes on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.fit_context import Fitted
from flexviz.analysis.diagnosis.prediction_errors import Known, PredictionErrorBand
from flexviz.analysis.motion import Phases
from flexviz.base.progress import BestSoFar
from flexviz.content.wording import MOST_NAMED, JointErrors, listed, stated_errors, text_names
from flexviz.model.equation import Layout
from flexviz.robot.model import FlexibleModel

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class BestModel(BestSoFar):
    """The best model so far, to be drawn: its effects without the set's own, its values and residuals."""

    effects: tuple[str, ...]  # as texts
    parameters: FlexibleModel
    residuals: Mapping[str, tuple[Floats, Floats]]  # group → time (M,) [s], residual (M, n) [Nm]


class BestModelTracker:
    """The best model so far, from the set's `own` one on; errors are those of the band."""

    def __init__(self, own: Layout, band: PredictionErrorBand) -> None:
        self.own, self.band = own, band
        self._own_fit: Known | None = None
        self._own_errors: dict[bytes, JointErrors] = {}  # its own, by which samples count
        self._best = np.inf  # its error

    def news(self, fit: Fitted, first_phase: Phases | None = None) -> BestModel | None:
        """The news of a fit, if it is better; `first_phase`, shape (n,): as in `PredictionErrorBand`."""
        added = [effect for effect in fit.layout.effects if effect not in self.own.effects]
        if self._own_fit is not None and not added:
            return None
        errors, spread = self.band.errors(fit, first_phase), self.band.measurements.torque_spread
        now, kind = stated_errors(errors, spread), f"{errors.stated_name} error"
        texts = tuple(effect.text(self.own.joints) for effect in added)
        time, residual = (a.astype(np.float32) for a in (self.band.signals.time, errors.residual))
        over_time = {group: (time[at], residual[at]) for group, at in self.band.rows.items()}
        drawn = texts, fit.layout.model(fit.x), over_time
        if self._own_fit is None:
            self._own_fit = Known(fit.layout, fit.x)  # the rest of a fit takes memory
            worst = f"{self.own.joints[now.order[0]]} {now.text(now.order[0])}"
            return BestModel("", f"{kind} of the present model {now.whole()}; most: {worst}", *drawn)
        if now.mean >= self._best:
            return None
        self._best = now.mean
        counted = b"" if first_phase is None else first_phase.tobytes()
        if counted not in self._own_errors:
            own = self.band.errors(self._own_fit, first_phase)
            self._own_errors[counted] = stated_errors(own, spread)
        before = self._own_errors[counted]
        names = text_names(texts, self.own.joints)
        more = len(names) - MOST_NAMED
        model = listed([*names[:MOST_NAMED], f"{more} more"] if more > 0 else names)
        return BestModel(model, f"{kind} {before.short()} → {now.whole()}", *drawn)
