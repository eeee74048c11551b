"""Where an unmodelled torque acts, joint and side of its transmission; the model that it does not bias.

Every place is tried in turn: the model is fitted with an arbitrary torque there (`UnknownInput`). With an
input at the law's own place all joints agree with the noise, whatever the law; at another they do not. The
residual of a fit without an input may be larger on a neighbouring joint.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.candidates import excess
from flexviz.analysis.diagnosis.fit_context import Fit, FitContext
from flexviz.analysis.diagnosis.residual_location import Located, locate_residual
from flexviz.analysis.diagnosis.residuals import JointResiduals, joint_residuals, samples
from flexviz.analysis.diagnosis.thresholds import THRESHOLDS
from flexviz.analysis.diagnosis.varying_size import ChangingSize
from flexviz.analysis.diagnosis.vibration import vibration
from flexviz.analysis.estimation import ESTIMATION, MAX_ITERATIONS, SIDES, Covariance, Side, UnknownInput
from flexviz.analysis.identification import parameter_estimates
from flexviz.analysis.motion import MOTION
from flexviz.base.parallel import shared
from flexviz.content.records import Note
from flexviz.content.wording import interval, number, plain_name
from flexviz.model.equation import Layout

Array = NDArray[np.float64]

COMPARED = ("stiffness", "motor_inertia")  # parameters of which a note says how the unknown law biases them
PLACES: dict[Side, str] = {
    "motor": "on the motor side of {}",
    "transmission": "in the transmission of {}",
    "link": "on the link side of {}",
}


@dataclass(frozen=True, eq=False)
class UnknownPlace:
    """The place of an unmodelled torque.

    Attributes:
        unknown: the input that explains what the model leaves.
        layout, x: the model, and its parameters given the input, shape (P,).
        sure: whether inputs on the other sides of the joint explain clearly less.
        left: excess given the input.
        converged: whether x is a minimum.
    """

    unknown: UnknownInput
    layout: Layout
    x: Array
    sure: bool
    left: float
    converged: bool

    @property
    def complete(self) -> bool:
        """Whether all joints agree with the noise given the input; otherwise it explains most."""
        return 1 + self.left <= ESTIMATION.consistent

    @property
    def joint(self) -> str:
        """Name of the joint."""
        return self.layout.joints[self.unknown.joint]

    @property
    def text(self) -> str:
        """The finding as a sentence."""
        where = PLACES[self.unknown.side].format(self.joint) if self.sure else f"at {self.joint}"
        given = f"acts {where}: with an arbitrary torque there,"
        if self.complete:
            return f"what is missing {given} all joints agree with the noise"
        return f"most of what is missing {given} little of the error is left"

    def beats(self, other: UnknownPlace) -> bool:
        """Whether the residual given another input is clearly larger, in units of what this one leaves."""
        return 1 + other.left > THRESHOLDS.evidence.apart**2 * (1 + self.left)


def unknown_place(
    context: FitContext, fit: Fit, check: Callable[[], None], likely: Sequence[int] = ()
) -> UnknownPlace | None:
    """The joint where an arbitrary torque explains what a model leaves, if on no other joint it does.

    A fit with an arbitrary torque at a place relies only on what that torque cannot change. At the right
    place all joints then agree with the noise, whatever the law is; elsewhere they do not, as in fault
    isolation by unknown-input observers.

    Of more than a few joints, the `likely` ones and those with the largest residual are tried. None for a
    single joint, where the input explains everything, whatever is missing. `check`: called between fits; may
    raise to stop.
    """
    layout, lacking = fit.layout, excess(fit)
    if layout.n == 1:
        return None
    # far from the noise, the parameters of the fit are a worse start than those of a rigid robot
    starts = (fit.x, context.start(layout).x)[: 1 + (1 + lacking > ESTIMATION.far_above_noise)]
    # their own residual, from which that of others is not subtracted as in `chi`
    loudest = np.argsort(-np.sum(joint_residuals(context, fit)[0].white ** 2, axis=0)).tolist()
    joints = [*dict.fromkeys((*likely, *loudest))][: THRESHOLDS.search.unknown_places]
    rms = np.sqrt(np.mean(context.two_band.narrow.signals.tau[0] ** 2, axis=0))

    def tried(place: tuple[int, Side]) -> UnknownPlace:
        joint, side = place
        unknown = UnknownInput(joint, side, float(rms[joint]))
        best = UnknownPlace(unknown, layout, fit.x, False, np.inf, True)
        check()
        beside = context.with_unknown_input(unknown)
        for start in starts:
            try:
                found = beside.fit(layout, start, iterations=MAX_ITERATIONS, check=check)
            except np.linalg.LinAlgError:  # far from the noise, weights may be ill-conditioned
                continue
            if excess(found) < best.left:
                best = replace(best, x=found.x, left=excess(found), converged=found.converged)
        return best

    places = list(shared(tried, [(j, side) for j in joints for side in SIDES]))
    best = min(places, key=lambda place: place.left)
    others = [p for p in places if p.unknown.joint != best.unknown.joint]
    few = best.complete or best.left <= THRESHOLDS.evidence.share * lacking
    if not few or not all(map(best.beats, others)):
        return None
    return replace(best, sure=all(best.beats(p) for p in places if p not in others and p is not best))


@dataclass(frozen=True, eq=False)
class UnknownInputFit:
    """A model whose parameters an unknown law does not bias; `fit`: in units of the noise without it."""

    place: UnknownPlace
    fit: Fit
    covariance: Covariance

    @staticmethod
    def of(context: FitContext, fit: Fit, place: UnknownPlace | None) -> UnknownInputFit | None:
        """The model of a fit given the input at a place; None if there is no place for this model."""
        if place is None or place.layout != fit.layout:
            return None
        beside = context.with_unknown_input(place.unknown)
        try:
            covariance, _ = beside.covariances(beside.fit(fit.layout, place.x, iterations=0))
            again = context.fit(fit.layout, place.x, iterations=0, near=fit)
        except np.linalg.LinAlgError:  # far from the noise, weights may be ill-conditioned
            return None
        return UnknownInputFit(place, replace(again, unbiased=True), covariance)

    def notes(self, context: FitContext, parts: list[JointResiduals], biased: Fit) -> Iterator[Note]:
        """The place, and parameters that are clearly different in a fit without the input."""
        hertz = vibration(samples(context, self.fit, parts), self.place.unknown.joint)
        shaken = f"; it is a vibration of {hertz:.3g} Hz, whatever the robot does" if hertz else ""
        yield Note("place", self.place.text + shaken)
        # an input on the motor side also changes the deflection
        sound = self.place.complete and self.place.converged and self.place.unknown.side != "motor"
        if values := ", ".join(self._unbiased(context, biased) if sound else ()):
            yield Note("unbiased", f"given this arbitrary torque: {values}")

    def _unbiased(self, context: FitContext, biased: Fit) -> Iterator[str]:
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
            clear = abs(one.value - other.value) > MOTION.outlier * one.std
            if apart and one.identifiable == "yes" and clear:
                shown = f"{plain_name(one.name)} of {one.joint} {' ± '.join(interval(one.value, one.std))}"
                yield f"{shown} {one.unit} instead of {number(other.value, 4)}"


def locate_unknown(
    context: FitContext, fit: Fit, beside: UnknownInputFit | None, changing: ChangingSize | None
) -> Located:
    """Where the residual lies: with the parameters given the input, if there is one.

    The joint of a size that changes comes first, or else that of the input.
    """
    found = locate_residual(context, fit if beside is None else beside.fit)
    named = None if changing is None else changing.named[1]
    first = named or (None if beside is None else beside.place.joint)
    return found._replace(places=tuple(sorted(found.places, key=lambda p: first not in (None, p.joint))))
