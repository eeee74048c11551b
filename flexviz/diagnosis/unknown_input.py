"""Where an unmodelled torque acts: the joint, and the side of its transmission.

Every place is tried in turn: the model is fitted beside an arbitrary torque there (`UnknownInput`). Beside an
input at the law's own place all joints agree with the noise, whatever the law; at another they do not. The
residual of a fit without an input may be larger on a neighbouring joint.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.candidates import excess
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.residuals import joint_residuals
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.equation import Layout
from flexviz.estimation import SIDES, Side, UnknownInput
from flexviz.parallel import shared

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.evidence
JOINTS = 3  # number of joints, by residual, on which an input is tried
ITERATIONS = 10, 16  # of the first fits beside it, and of the most promising
FAR = 30.0  # excess from which a fit may be far off
REACHED = 1.0  # excess beside the input at the right place, at most

PLACES: dict[Side, str] = {
    "motor": "on the motor side of {}",
    "transmission": "in the transmission of {}",
    "link": "on the link side of {}",
}


@dataclass(frozen=True, eq=False)
class UnknownPlace:
    """The place of a law of no library.

    Attributes:
        unknown: the input that explains what the model leaves.
        layout, x: the model, and its parameters beside the input, shape (P,).
        sure: whether inputs on the other sides of the joint explain clearly less.
        left: excess beside the input.
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
        """Whether all joints agree with the noise beside the input; otherwise it explains most."""
        return self.left <= REACHED

    @property
    def joint(self) -> str:
        """Name of the joint."""
        return self.layout.joints[self.unknown.joint]

    @property
    def text(self) -> str:
        """The finding as a sentence."""
        where = PLACES[self.unknown.side].format(self.joint) if self.sure else f"at {self.joint}"
        beside = f"acts {where}: beside an arbitrary torque there,"
        if self.complete:
            return f"what is missing {beside} all joints agree with the noise"
        return f"most of what is missing {beside} little of the error stays"


@dataclass(frozen=True, eq=False)
class _Trial:
    """A model fitted beside an unknown input; `left` is its excess."""

    unknown: UnknownInput
    x: Array
    left: float
    converged: bool


def unknown_place(
    context: FitContext, fit: Fit, check: Callable[[], None], likely: Sequence[int] = ()
) -> UnknownPlace | None:
    """The joint where an arbitrary torque explains what a model leaves, if on no other joint it does.

    Of more than a few joints, the `likely` ones and those with the largest residual are tried. None for a
    single joint, where the input explains everything, whatever is missing. `check`: called between fits; may
    raise to stop.
    """
    n, lacking = fit.layout.n, excess(fit)
    if n == 1:
        return None
    # far from the noise, the parameters of the fit are a worse start than those of a rigid robot
    starts = (fit.x,) if lacking < FAR else (fit.x, context.start(fit.layout).x)

    def tried(unknown: UnknownInput, x: Array, iterations: int) -> _Trial:
        check()
        try:
            found = context.with_unknown_input(unknown).fit(fit.layout, x, iterations=iterations, check=check)
        except np.linalg.LinAlgError:  # far from the noise, weights may be ill-conditioned
            return _Trial(unknown, x, np.inf, True)
        left = excess(found)
        return _Trial(unknown, found.x, left if np.isfinite(left) else np.inf, found.converged)

    rms = np.sqrt(np.mean(context.two_band.narrow.signals.tau[0] ** 2, axis=0))
    joints = [*dict.fromkeys((*likely, *_loudest(context, fit)))][:JOINTS] if n > JOINTS else range(n)
    inputs = [UnknownInput(j, side, float(rms[j])) for j in joints for side in SIDES]
    trials = list(shared(lambda at: tried(*at, ITERATIONS[0]), [(u, x) for u in inputs for x in starts]))
    leaders = [_best(t for t in trials if t.unknown == unknown) for unknown in inputs]
    best = _best(leaders)
    more = [t for t in leaders if not t.converged and t.left < max(10 * _least(best), REACHED)]
    more += [
        replace(t, x=best.x) for t in leaders if t.left > lacking
    ]  # an input explains something at least
    trials += shared(lambda t: tried(t.unknown, t.x, ITERATIONS[1]), more)
    leaders = [_best(t for t in trials if t.unknown == unknown) for unknown in inputs]
    best = _best(leaders)
    least = _least(best)
    if best.left > max(REACHED, LIMITS.place_share * lacking):
        return None
    if any(t.left < least for t in leaders if t.unknown.joint != best.unknown.joint):
        return None
    others = (t for t in leaders if t.unknown.joint == best.unknown.joint and t is not best)
    sure = all(t.left > least for t in others)
    return UnknownPlace(best.unknown, fit.layout, best.x, sure, best.left, best.converged)


def _loudest(context: FitContext, fit: Fit) -> list[int]:
    """The joints by their own residual, from which that of others is not subtracted as in `chi`."""
    white = joint_residuals(context, fit)[0].white
    return [int(j) for j in np.argsort(-np.sum(white**2, axis=0))]


def _least(best: _Trial) -> float:
    """Excess that inputs elsewhere leave at least, if the best one is at the right place."""
    return LIMITS.lead * best.left + LIMITS.least_lead


def _best(trials: Iterable[_Trial]) -> _Trial:
    return min(trials, key=lambda t: t.left)
