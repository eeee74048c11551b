"""Elastic effects that the scores hide are refitted all the same."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flexviz.diagnosis.comparison import CandidateScores, RefittedCandidate
from flexviz.diagnosis.hidden_starts import doubtful_joints, loudest

from flexviz.diagnosis import search as search_module
from flexviz.diagnosis.acceptance import Gained
from flexviz.diagnosis.candidates import ModelStart
from flexviz.diagnosis.fit_context import Fit, FitContext
from flexviz.diagnosis.search import Search
from flexviz.effects import ChosenEffect
from flexviz.equation import Layout
from flexviz.estimation.score_test import ScoredCandidate
from flexviz.identification import identify


@pytest.fixture(scope="module")
def base(demo: Any) -> tuple[FitContext, Fit]:
    layout = Layout(demo.joints)
    fit_context = FitContext(demo, layout)
    return fit_context, fit_context.fit(layout, layout.vector(identify(demo).model), iterations=12)


def test_elastic_effects_are_refitted_where_their_scores_mean_little(
    base: tuple[FitContext, Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On the joint with the largest residual, from several starts; on others where the sign is wrong."""
    fit_context, fit = base
    search = Search(fit_context, lambda _: None)
    loud = replace(fit, chi=np.array([1.0, 1000.0]))
    fitted: list[ChosenEffect] = []

    def recorded(start: ModelStart, iterations: int, **_: object) -> Fit:
        if iterations:
            fitted.append(start.layout.effects[-1])
        return replace(fit, layout=start.layout, x=start.x)

    monkeypatch.setattr(search, "fit_from", recorded)
    damping, backlash = (ChosenEffect(name, 0) for name in ("joint_damping", "backlash"))
    scored = ScoredCandidate(damping, 5.0, np.array([1.0]), np.zeros(fit.point.r.size))
    scores = CandidateScores([scored], fit_context.projection(fit))
    refitted = {r.effect for r in search.underrated(loud, loudest(loud, 2), scores)}
    assert damping not in refitted and backlash in refitted
    assert {e.joint for e in refitted} == {0, 1}
    assert fitted.count(backlash) == 1 and fitted.count(ChosenEffect("backlash", 1)) > 1


@pytest.mark.parametrize("last, tried", [(1.1, []), (1.4, [([6], False)]), (2.0, [([6], True)])])
def test_one_joint_of_an_arm_that_stands_out_is_enough(
    last: float,
    tried: list[tuple[list[int], bool]],
    base: tuple[FitContext, Fit],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Joint damping of a Panda's wrist left 1.4 of the noise's variance there and scored nothing.

    The scores of other joints matter only where the mean is above the noise.
    """
    fit_context, fit = base
    search = Search(fit_context, lambda _: None)
    chi = np.array([1.0] * 6 + [last])
    fit = replace(fit, chi=chi, chi_held_out=chi)
    found = []

    def recorded(_: Fit, loud: list[int], scores: CandidateScores | None) -> list[RefittedCandidate]:
        found.append((loud, scores is not None))
        return []

    monkeypatch.setattr(search, "underrated", recorded)
    search.refits(fit, CandidateScores([], fit_context.projection(fit)), Gained(0.0, np.zeros(7)))
    assert found == tried


HIDDEN = {"backlash", "stiffness_hardening", "joint_damping", "load_dependent_friction"}


@pytest.mark.parametrize("left, tried", [(1.05, set()), (1.5, HIDDEN)])
def test_what_scores_hide_is_compared_with_a_leader_that_leaves_more_than_noise(
    left: float, tried: set[str], base: tuple[FitContext, Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A small backlash was called a base tilt, which explained 96 % of the excess: its score was zero."""
    fit_context, fit = base
    search = Search(fit_context, lambda _: None)
    tilt = ScoredCandidate(ChosenEffect("base_tilt"), 5.0, np.zeros(2), np.zeros(fit.point.r.size))
    chi = np.array([left, 1.0])
    leader = replace(search.refit(fit, tilt, 0).fit, chi=chi, chi_held_out=chi)

    def unmoved(start: ModelStart, *_: object, **__: object) -> Fit:
        return replace(fit, layout=start.layout, x=start.x)

    monkeypatch.setattr(search, "fit_from", unmoved)
    compared = search.rivals(fit, RefittedCandidate(tilt, leader), [])
    others = {r.effect for r in compared.refitted} - {tilt.effect}
    assert {e.effect for e in others} == tried and all(e.joint == 0 for e in others)


@pytest.mark.parametrize("left, tried", [(1.2, True), (100.0, False)])
def test_near_the_noise_a_rival_may_be_close_at_the_present_model_only(
    left: float, tried: bool, base: tuple[FitContext, Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Load-dependent friction was ruled out at a viscous friction that a drive gain had moved."""
    fit_context, fit = base
    search = Search(fit_context, lambda _: None)
    chi = np.array([left, 1.0])
    fit = replace(fit, chi=chi, chi_held_out=chi, objective=fit.objective + 1000.0)
    gain, friction = (
        ScoredCandidate(ChosenEffect(name, 0), score, np.zeros(1), np.zeros(fit.point.r.size))
        for name, score in (("torque_gain", 700.0), ("load_dependent_friction", 600.0))
    )
    quiet = np.ones(2)
    leader = RefittedCandidate(
        gain,
        replace(
            search.refit(fit, gain, 0).fit, chi=quiet, chi_held_out=quiet, objective=fit.objective - 1000.0
        ),
    )
    at_leader = CandidateScores([gain, replace(friction, gain=10.0)], fit_context.projection(leader.fit))
    monkeypatch.setattr(search, "scores", lambda *_: at_leader)
    compared = search.rivals(fit, leader, [friction])
    assert (friction.effect in {r.effect for r in compared.refitted}) == tried
    assert (friction.effect in compared.ruled_out) != tried


@pytest.mark.parametrize(("times", "expected"), [(2.0, []), (8.0, [1, 0])])
def test_hidden_effects_are_tried_where_an_effect_gains_far_more_than_it_scored(
    times: float, expected: list[int], base: tuple[FitContext, Fit]
) -> None:
    """A transmission error of the wrist stood for the elbow's backlash, which scored nothing."""
    _, fit = base
    names = (("transmission_error", 1), ("base_tilt", None), ("cable_spring", 0), ("cable_spring", 1))
    scored = [
        ScoredCandidate(ChosenEffect(name, joint), 100.0, np.zeros(1), np.zeros(1)) for name, joint in names
    ]
    quiet = np.ones(2)
    after = replace(fit, chi=quiet, chi_held_out=quiet, objective=fit.objective - times * 100.0)
    assert doubtful_joints(fit, RefittedCandidate(scored[0], after), scored[1:]) == expected
    loud = replace(after, chi=np.array([1.5, 1.0]), chi_held_out=np.array([1.5, 1.0]))
    assert doubtful_joints(fit, RefittedCandidate(scored[0], loud), scored[1:]) == [0]


@pytest.mark.parametrize(
    ("effect", "lag", "wins"),
    [("torque_offset", 40.0, False), ("transmission_error", 20.0, False), ("transmission_error", 40.0, True)],
)
def test_a_gap_that_is_hardly_crossed_needs_less_of_a_lead_over_more_parameters(
    effect: str, lag: float, wins: bool, base: tuple[FitContext, Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    fit_context, fit = base
    monkeypatch.setattr(search_module, "only_an_offset", lambda _fit, e, _step: e.effect == "backlash")
    tried = []
    for name, more in (("backlash", 0.0), (effect, lag)):
        chosen = ChosenEffect(name, 0)
        layout = Layout(fit.layout.joints, (*fit.layout.effects, chosen))
        found = replace(fit, layout=layout, x=np.zeros(layout.size), objective=100.0 + more)
        tried.append(RefittedCandidate(ScoredCandidate(chosen, 1.0, np.zeros(1), np.zeros(1)), found))
    assert (Search(fit_context, lambda _: None).simplest(tried) is tried[0]) == wins
