"""Where a law of no library acts: the joint, and the side of its transmission.

Every place is tried in turn: the model is fitted beside a torque of unknown course there (`UnknownInput`).
Beside an input at the law's own place all joints agree with the noise, whatever the law; at another they do
not. The residual of a fit without an input may be larger on a neighbouring joint.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.acceptance import excess
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.residual_location import Located, locate_residual
from flexviz.diagnosis.residuals import JointResiduals, joint_residuals, samples
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.diagnosis.vibration import vibration
from flexviz.estimation import SIDES, Covariance, Prior, Side, UnknownInput
from flexviz.identification import parameter_estimates
from flexviz.parallel import shared
from flexviz.results import Note
from flexviz.wording import interval, plain_name

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.unknown_place

PLACES: dict[Side, str] = {
    "motor": "on the motor side of {}",
    "transmission": "in the transmission of {}",
    "link": "on the link side of {}",
}
COMPARED = ("stiffness", "motor_inertia")  # parameters of which a note says how the unknown law biases them


@dataclass(frozen=True)
class UnknownPlace:
    """The place of a law of no library.

    Attributes:
        unknown: the input that explains what the model leaves.
        joint: name.
        sure: whether inputs on the other sides of the joint explain clearly less.
    """

    unknown: UnknownInput
    joint: str
    sure: bool

    @property
    def text(self) -> str:
        """The finding as a sentence."""
        where = PLACES[self.unknown.side].format(self.joint) if self.sure else f"at {self.joint}"
        return (
            f"what is missing acts {where}: beside a torque of unknown course there, the model explains "
            "every joint"
        )


@dataclass(frozen=True, eq=False)
class BesideUnknown:
    """A model whose parameters an unknown input does not bias.

    Attributes:
        place: of the input.
        fit: in units of the noise without the input.
        covariance: of the parameters.
    """

    place: UnknownPlace
    fit: Fit
    covariance: Covariance

    @staticmethod
    def of(context: FitContext, fit: Fit, place: UnknownPlace | None) -> BesideUnknown | None:
        """The model of a fit, fitted beside the input at a place; None without a place."""
        if place is None:
            return None
        beside = context.with_unknown_input(place.unknown)
        starts = (context.start(fit.layout).x, fit.x)
        iterations = LIMITS.iterations + LIMITS.more_iterations
        best = min((beside.fit(fit.layout, x, iterations=iterations) for x in starts), key=excess)
        again = replace(context.fit(fit.layout, best.x, iterations=0, near=fit), unbiased=True)
        return BesideUnknown(place, again, beside.covariance(best))

    def notes(
        self, context: FitContext, parts: list[JointResiduals], biased: Fit, prior: Prior
    ) -> Iterator[Note]:
        """The place, and parameters that are clearly different in a fit without the input."""
        unknown = self.place.unknown
        shaken = vibration(samples(context, self.fit, parts), unknown.joint)
        form = (
            "" if shaken is None else f"; it is a vibration of {shaken.hertz:.3g} Hz, whatever the robot does"
        )
        yield Note("place", self.place.text + form)
        layout, free = self.fit.layout, np.zeros(self.fit.layout.size, bool)
        here, without = (
            parameter_estimates(layout, x, prior.centre, self.covariance, free, prior)
            for x in (self.fit.x, biased.x)
        )
        told = {}
        for one, other in zip(here, without, strict=True):
            change = abs(one.value - other.value)
            clear = change > max(LIMITS.told_deviations * one.std, LIMITS.told_share * abs(one.value))
            # what acts on its motor or within it may pass for a property of the joint
            determined = one.joint != self.place.joint or unknown.side == "link"
            if one.name in COMPARED and determined and one.identifiable == "yes" and clear:
                value, half = interval(one.value, one.std)
                text = f"{plain_name(one.name)} of {one.joint} {value} ± {half} {one.unit}"
                told[f"{text} instead of {other.value:.4g}"] = change / abs(one.value)
        if told:
            largest = sorted(told, key=lambda text: -told[text])[: LIMITS.told]
            yield Note("unbiased", f"beside this torque of unknown course: {', '.join(largest)}")


@dataclass(frozen=True, eq=False)
class _Trial:
    """A model fitted beside an unknown input; `left` is its excess."""

    unknown: UnknownInput
    x: Array
    left: float
    converged: bool


def unknown_place(context: FitContext, fit: Fit, check: Callable[[], None]) -> UnknownPlace | None:
    """The only joint where a torque of unknown course explains what a model leaves; None if there is none.

    `check`: called between fits; may raise to stop.
    """
    n = fit.layout.n
    if n == 1:
        return None  # the input explains everything, whatever is missing

    # far from the noise, the parameters of the fit are a worse start than those of a rigid robot
    start = context.start(fit.layout).x

    def tried(unknown: UnknownInput, x: Array = start, iterations: int = LIMITS.iterations) -> _Trial:
        check()
        beside = context.with_unknown_input(unknown)
        found = beside.fit(fit.layout, x, iterations=iterations, check=check)
        return _Trial(unknown, found.x, excess(found), found.converged)

    rms = np.sqrt(np.mean(context.two_band.narrow.signals.tau[0] ** 2, axis=0))
    joints = _loudest(context, fit) if n > LIMITS.joints else range(n)
    first = shared(tried, [UnknownInput(j, side, float(rms[j])) for j in joints for side in SIDES])
    leaders = [_best(t for t in first if t.unknown.joint == j) for j in joints]
    unfinished = [t for t in leaders if t.left > LIMITS.reached]
    starts = [(t.unknown, x) for t in unfinished for x in ([fit.x] if t.converged else [fit.x, t.x])]
    leaders += shared(lambda at: tried(*at, LIMITS.more_iterations), starts)
    best = _best(leaders)
    least = LIMITS.lead * best.left + LIMITS.least_lead
    if best.left > max(LIMITS.reached, LIMITS.left_share * excess(fit)):
        return None
    if any(t.left < least for t in leaders if t.unknown.joint != best.unknown.joint):
        return None
    here = [t.left for t in first if t.unknown.joint == best.unknown.joint and t.unknown != best.unknown]
    return UnknownPlace(best.unknown, fit.layout.joints[best.unknown.joint], min(here) > least)


def _loudest(context: FitContext, fit: Fit) -> list[int]:
    """The joints whose own residual exceeds its noise most; that of others is not subtracted as in `chi`."""
    white = joint_residuals(context, fit)[0].white
    return [int(j) for j in np.argsort(-np.sum(white**2, axis=0))[: LIMITS.joints]]


def _best(trials: Iterable[_Trial]) -> _Trial:
    return min(trials, key=lambda t: t.left)


def locate_unknown(context: FitContext, fit: Fit, beside: BesideUnknown | None) -> Located:
    """Where the residual lies: with the parameters beside the input, and its joint first, if there is one."""
    if beside is None:
        return locate_residual(context, fit)
    found = locate_residual(context, beside.fit)
    return found._replace(places=tuple(sorted(found.places, key=lambda p: p.joint != beside.place.joint)))
