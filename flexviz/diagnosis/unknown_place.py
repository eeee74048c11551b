"""Where a law of no library acts: the joint, and the side of its transmission.

Every place is tried in turn: the model is fitted beside an arbitrary torque there (`UnknownInput`). Beside an
input at the law's own place all joints agree with the noise, whatever the law; at another they do not. The
residual of a fit without an input may be larger on a neighbouring joint.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexviz.diagnosis.acceptance import excess
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.residuals import joint_residuals
from flexviz.diagnosis.thresholds import THRESHOLDS
from flexviz.effects import Entry
from flexviz.equation import Layout
from flexviz.estimation import SIDES, Side, UnknownInput
from flexviz.parallel import shared

Array = NDArray[np.float64]

LIMITS = THRESHOLDS.unknown_place

PLACES: dict[Side, str] = {
    "motor": "on the motor side of {}",
    "transmission": "in the transmission of {}",
    "link": "on the link side of {}",
}
ENTRIES: dict[Side, Entry] = {"motor": "torque", "transmission": "deflection", "link": "residual"}


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
        return self.left <= LIMITS.reached

    def entry(self, lacking: float) -> Entry | None:
        """How nearly all that is missing enters the equation; None if that is not sure.

        `lacking`: the excess of a model that lacks it.
        """
        nearly_all = self.left < LIMITS.left_of_side * lacking
        return ENTRIES[self.unknown.side] if self.sure and nearly_all else None

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


def unknown_place(context: FitContext, fit: Fit, check: Callable[[], None]) -> UnknownPlace | None:
    """The joint where an arbitrary torque explains what a model leaves, if on no other joint it does.

    Of more than a few joints, those with the largest residual are tried. None for a single joint, where the
    input explains everything, whatever is missing. `check`: called between fits; may raise to stop.
    """
    n = fit.layout.n
    if n == 1:
        return None
    lacking = excess(fit)
    near_noise = lacking < LIMITS.from_present
    # far from it, the parameters of the fit are a worse start than those of a rigid robot
    start = fit.x if near_noise else context.start(fit.layout).x

    def tried(unknown: UnknownInput, x: Array = start, iterations: int = LIMITS.iterations) -> _Trial:
        check()
        beside = context.with_unknown_input(unknown)
        try:
            found = beside.fit(fit.layout, x, iterations=iterations, check=check)
        except np.linalg.LinAlgError:  # far from the noise, weights may be ill-conditioned
            return _Trial(unknown, x, np.inf, True)
        left = excess(found)
        return _Trial(unknown, found.x, left if np.isfinite(left) else np.inf, found.converged)

    rms = np.sqrt(np.mean(context.two_band.narrow.signals.tau[0] ** 2, axis=0))
    joints = _loudest(context, fit) if n > LIMITS.joints else range(n)
    first = shared(tried, [UnknownInput(j, side, float(rms[j])) for j in joints for side in SIDES])
    leaders = [_best(t for t in first if t.unknown.joint == j) for j in joints]
    leading, most = _best(first), np.inf
    if near_noise:  # more steps of what leaves much would not explain all, or not as much as another
        most = LIMITS.idle_share * lacking
        if leading.left <= LIMITS.reached:
            most = min(most, LIMITS.far_more * _least(leading))
    more = [(t.unknown, t.x) for t in first if not (t.converged or t.left > most or _decided(t, first))]
    if not near_noise:
        more += [(t.unknown, fit.x) for t in leaders if t.left > LIMITS.reached]
    trials = [*first, *shared(lambda at: tried(*at, LIMITS.more_iterations), more)]
    best = _best(trials)
    least = _least(best)
    if best.left > max(LIMITS.reached, LIMITS.left_share * lacking):
        return None
    if any(t.left < least for t in trials if t.unknown.joint != best.unknown.joint):
        return None
    sides = [UnknownInput(best.unknown.joint, side, best.unknown.deviation) for side in SIDES]
    others = [_best(t for t in trials if t.unknown == side) for side in sides if side != best.unknown]
    astray = [t.unknown for t in others if t.left > lacking]  # an input explains something at least
    others += shared(lambda side: tried(side, best.x, LIMITS.more_iterations), astray)
    sure = all(t.left > least for t in others)
    return UnknownPlace(best.unknown, fit.layout, best.x, sure, best.left, best.converged)


def _loudest(context: FitContext, fit: Fit) -> list[int]:
    """The joints whose own residual exceeds its noise most; that of others is not subtracted as in `chi`."""
    white = joint_residuals(context, fit)[0].white
    return [int(j) for j in np.argsort(-np.sum(white**2, axis=0))[: LIMITS.joints]]


def _decided(trial: _Trial, trials: list[_Trial]) -> bool:
    """Whether another trial explains all, and on two other sides of this one's joint as little is left."""
    best = _best(trials)
    least = _least(best)
    sides = sum(t.left <= least for t in trials if t.unknown.joint == trial.unknown.joint)
    return best.left <= LIMITS.reached and trial.left > least and sides > 1


def _least(best: _Trial) -> float:
    """Excess that inputs elsewhere leave at least, if the best one is at the right place."""
    return LIMITS.lead * best.left + LIMITS.least_lead


def _best(trials: Iterable[_Trial]) -> _Trial:
    return min(trials, key=lambda t: t.left)
