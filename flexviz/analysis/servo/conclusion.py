"""Where a search over servos ends: without what is less likely right than wrong."""

from __future__ import annotations

import numpy as np

from flexviz.analysis.diagnosis import LEAST_SURE, THRESHOLDS
from flexviz.analysis.servo.fits import REFINED, ServoModel
from flexviz.analysis.servo.problem import ServoProblem
from flexviz.base.search import Gain, Search
from flexviz.content.records import Tie
from flexviz.model.effects import EFFECTS, ChosenEffect

CLOSER = 0.9  # of a deviation, below which another search may find what it has hidden


def concluded(problem: ServoProblem, search: Search[ServoModel], model: ServoModel) -> ServoModel:
    """The end of a search, without effects that are less likely right than wrong."""
    first = True
    while True:
        model = search.run(model)
        if first:
            first = False
            before = problem.score(model).deviation
            model = again(problem, model)
            if np.any(problem.score(model).deviation < CLOSER * before):
                continue
        sure = {key: problem.certainty(model, need) for key, need in needs(problem, model).items()}
        weakest = min(sure, key=lambda key: sure[key], default=None)
        if weakest is None or sure[weakest] >= LEAST_SURE:
            return model
        problem.banned |= {weakest}
        less = reduced(problem, model, weakest)
        search.told("drop", model, less, True)
        model = less


def again(problem: ServoProblem, model: ServoModel) -> ServoModel:
    """A model, fitted once more with what its free motion says of the other joints."""
    values = model.values(problem.data.owner)
    problem.refresh(values)
    owners = sorted(model.states)
    problem.fitted([(o, problem.own(model.keys, o), values) for o in owners], REFINED)
    return problem.model(model.keys)


def reduced(problem: ServoProblem, model: ServoModel, key: ChosenEffect) -> ServoModel:
    """A model without an effect, and what only stands beside it."""
    owner = int(problem.data.owner[key.joint])
    rest = model.keys - {key}
    rest -= {k for k in problem.own(rest, owner) if EFFECTS[k.effect].beside == key.effect} - problem.given
    place = owner, problem.own(rest, owner)
    if place not in problem.known:
        problem.fitted([(*place, model.states[owner].values)], REFINED)
    return problem.model(rest)


def needs(problem: ServoProblem, model: ServoModel) -> dict[ChosenEffect, Gain]:
    """What each effect that was added gains given the others."""
    search = Search(problem)
    added = model.keys - problem.given
    return {key: search.gain(reduced(problem, model, key), model) for key in added}


def tied(problem: ServoProblem, model: ServoModel, key: ChosenEffect) -> list[Tie]:
    """Effects that explain the motion as well as one of a model in its place."""
    owner = int(problem.data.owner[key.joint])
    others = [one for one in problem.rivals(model, owner, key) if EFFECTS[one.effect].beside != key.effect]
    asked = [problem.in_place(model, owner, key, one) for one in others]
    fresh = [one for one in asked if one[:2] not in problem.known]
    problem.fitted(problem.placed(model, fresh), REFINED)
    out, mine = [], problem.data.owner == owner
    best = problem.nats(model.states[owner])[mine].sum()
    for other, (_, keys, _) in zip(others, asked, strict=True):
        loss = float(problem.nats(problem.known[owner, keys])[mine].sum() - best)
        if abs(loss) < THRESHOLDS.criterion.temperature:
            out.append(Tie(other.effect, problem.measurements.joints[key.joint or 0], 1.0))
    return out
