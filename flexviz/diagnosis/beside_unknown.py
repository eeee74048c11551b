"""What a model leaves, and its parameters, where a law of no library does not bias them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.residual_location import Located, locate_residual
from flexviz.diagnosis.residuals import JointResiduals, samples
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.unknown_input import UnknownPlace
from flexviz.diagnosis.varying_size import ChangingSize
from flexviz.diagnosis.vibration import vibration
from flexviz.estimation import Covariance
from flexviz.identification import parameter_estimates
from flexviz.results import Note
from flexviz.wording import interval, number, plain_name

Array = NDArray[np.float64]

COMPARED = ("stiffness", "motor_inertia")  # parameters of which a note says how the unknown law biases them


@dataclass(frozen=True, eq=False)
class BesideUnknown:
    """A model whose parameters an unknown law does not bias; `fit`: in units of the noise without it."""

    place: UnknownPlace
    fit: Fit
    covariance: Covariance

    @staticmethod
    def of(context: FitContext, fit: Fit, place: UnknownPlace | None) -> BesideUnknown | None:
        """The model of a fit beside the input at a place; None if there is no place for this model."""
        if place is None or place.layout != fit.layout:
            return None
        beside = context.with_unknown_input(place.unknown)
        try:
            covariance = beside.covariance(beside.fit(fit.layout, place.x, iterations=0))
            again = context.fit(fit.layout, place.x, iterations=0, near=fit)
        except np.linalg.LinAlgError:  # far from the noise, weights may be ill-conditioned
            return None
        return BesideUnknown(place, replace(again, unbiased=True), covariance)

    def notes(self, context: FitContext, parts: list[JointResiduals], biased: Fit) -> Iterator[Note]:
        """The place, and parameters that are clearly different in a fit without the input."""
        hertz = vibration(samples(context, self.fit, parts), self.place.unknown.joint)
        shaken = f"; it is a vibration of {hertz:.3g} Hz, whatever the robot does" if hertz else ""
        yield Note("place", self.place.text + shaken)
        # an input on the motor side also changes the deflection
        sound = self.place.complete and self.place.converged and self.place.unknown.side != "motor"
        if told := ", ".join(self._told(context, biased) if sound else ()):
            yield Note("unbiased", f"beside this arbitrary torque: {told}")

    def _told(self, context: FitContext, biased: Fit) -> Iterator[str]:
        """What is said of each parameter that differs clearly."""
        layout, start = self.fit.layout, context.start(self.fit.layout)
        at_bound = np.isclose(self.fit.x, start.bounds.lower) | np.isclose(self.fit.x, start.bounds.upper)
        here, without = (
            parameter_estimates(layout, x, start.prior.centre, self.covariance, at_bound, start.prior)
            for x in (self.fit.x, biased.x)
        )
        # what acts within a joint may pass for one of its properties
        on_link = self.place.sure and self.place.unknown.side == "link"
        for one, other in zip(here, without, strict=True):
            apart = one.name in COMPARED and (on_link or one.joint != self.place.joint)
            clear = abs(one.value - other.value) > THRESHOLDS.criterion.outlier * one.std
            if apart and one.identifiable == "yes" and clear:
                shown = f"{plain_name(one.name)} of {one.joint} {' ± '.join(interval(one.value, one.std))}"
                yield f"{shown} {one.unit} instead of {number(other.value, 4)}"


def locate_unknown(
    context: FitContext, fit: Fit, beside: BesideUnknown | None, changing: ChangingSize | None
) -> Located:
    """Where the residual lies: with the parameters beside the input, if there is one.

    The joint of a size that changes comes first, or else that of the input.
    """
    found = locate_residual(context, fit if beside is None else beside.fit)
    named = None if changing is None else changing.named[1]
    first = named or (None if beside is None else beside.place.joint)
    return found._replace(places=tuple(sorted(found.places, key=lambda p: first not in (None, p.joint))))
