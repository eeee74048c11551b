"""Effects of the first movement after a standstill, where that is left out of the search."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexviz.analysis.diagnosis.candidates import candidates, with_candidates
from flexviz.analysis.diagnosis.coarse import Coarse, CoarseModel
from flexviz.analysis.diagnosis.criterion import Gain
from flexviz.analysis.motion import Phase
from flexviz.model.effects import EFFECTS, ChosenEffect

Array = NDArray[np.float64]


def with_first_movements(view: Coarse, model: CoarseModel) -> CoarseModel:
    """The model with effects of the first movement after a standstill, which then counts.

    What happens a few times in a record is an outlier to the search: here those movements alone count,
    in units of what the model leaves in motion.
    """
    context, before = view.context, view.context.first_phase
    found = any(EFFECTS[effect.effect].after_rest for effect in model.layout.effects)
    if found or not np.any(before == Phase.MOTION):
        return model
    context.first_phase = np.minimum(before, np.int8(Phase.START))
    there = view.fit(model.layout, model.fit.x, iterations=0)
    wanted = candidates(there.layout, view.measurements.groups, view.many)
    starts = [e for e in wanted if EFFECTS[e.effect].after_rest and before[e.place.own_joint] == Phase.MOTION]
    scored = view.scores(there.fit, starts)
    start = with_candidates(there.fit, scored)
    larger = view.fit(start.layout, start.x)
    sigma = model.score.deviation
    gains = {s.effect: gain_in_start(view, there, larger, s.effect, sigma) for s in scored}
    kept = [s for s in scored if gains[s.effect].accepted]
    view.in_start = {s.effect: gains[s.effect] for s in kept}
    joints = [s.effect.place.own_joint for s in kept]
    context.first_phase = np.where(np.isin(np.arange(view.own.n), joints), context.first_phase, before)
    if not kept:
        return model
    start = with_candidates(there.fit, kept)
    return view.fit(start.layout, start.x)


def gain_in_start(
    view: Coarse, before: CoarseModel, after: CoarseModel, effect: ChosenEffect, sigma: Array
) -> Gain:
    """What a larger model gains in the first movements of a joint, in units of what is left in motion."""
    joint, falls = effect.place.own_joint, []
    count = np.sum([part.used.sum(axis=0) for part in view.residuals(before.fit)], axis=0)
    for old, new, phase in zip(
        view.residuals(before.fit), view.residuals(after.fit), view.context.phases, strict=True
    ):
        here = phase[:, joint] == Phase.START
        squares = old.values[here, joint] ** 2 - new.values[here, joint] ** 2
        falls.append(0.5 * float(squares.sum()) / sigma[joint] ** 2)
    nats = sum(falls) * float(view.criterion.samples[joint] / count[joint])
    by_joint = np.where(np.arange(view.own.n) == joint, nats, 0.0)
    return Gain(nats - view.cost_of(effect), by_joint, falls[-1])
