"""Refits of several candidates on all cores."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from flexviz.diagnosis.acceptance import excess
from flexviz.diagnosis.candidates import ModelStart
from flexviz.diagnosis.comparison import RefittedCandidate
from flexviz.diagnosis.fit_context import Fit
from flexviz.effects import ChosenEffect
from flexviz.estimation import ScoredCandidate
from flexviz.parallel import shared

Trial = TypeVar("Trial")


@dataclass(frozen=True)
class _Refit:
    """What is known of a refit by another process: with all its arrays, a fit is too large to be sent."""

    model: ModelStart
    left: float
    objective: float
    converged: bool


def best_refits(
    trials: Sequence[tuple[ScoredCandidate, Trial]],
    refit: Callable[[Trial], Fit],
    evaluate: Callable[[ModelStart], Fit],
    most: float = np.inf,
) -> list[RefittedCandidate]:
    """The best refit of each effect.

    Args:
        trials: the effect and what to refit, for one effect perhaps several.
        refit: called by any process; it must not report progress.
        evaluate: a fit without steps.
        most: excess from which a refit is of no use.
    """

    if len(trials) == 1 and most == np.inf:  # nothing is shared: it need not be evaluated again
        ((scored, trial),) = trials
        return [RefittedCandidate(scored, refit(trial))]

    def known(trial: Trial) -> _Refit:
        found = refit(trial)
        return _Refit(ModelStart(found.layout, found.x), excess(found), found.objective, found.converged)

    best: dict[ChosenEffect, tuple[ScoredCandidate, _Refit]] = {}
    for (scored, _), found in zip(trials, shared(known, [trial for _, trial in trials]), strict=True):
        before = best.get(scored.effect)
        if found.left < most and (before is None or found.objective < before[1].objective):
            best[scored.effect] = scored, found
    return [
        RefittedCandidate(scored, replace(evaluate(found.model), converged=found.converged))
        for scored, found in best.values()
    ]
