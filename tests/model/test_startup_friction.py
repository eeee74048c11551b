"""Start-up friction in moves with pauses: identified, and found beside what standstill shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.diagnosis_study.motions import random_moves
from flexviz.analysis.diagnosis import diagnose, prediction_errors
from flexviz.analysis.diagnosis.coarse import Coarse
from flexviz.analysis.diagnosis.search import Search
from flexviz.analysis.identification import identify
from flexviz.analysis.motion import MotionContext, Phase
from flexviz.data.measurements import MeasurementSet, Segment, read_set
from flexviz.model.effects import ChosenEffect
from flexviz.model.equation import Layout
from flexviz.model.simulation import make_plan, simulate_plan, write_plan
from tests.planar_arm import HELD_OUT, of_groups

COULOMB, STARTUP = ChosenEffect("coulomb_friction", 0), ChosenEffect("startup_friction", 0)
HIDDEN = ["coulomb_friction:joint1:coulomb=4", "startup_friction:joint1:startup=3,angle=0.02"]


@pytest.fixture(scope="module")
def moves(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    """Moves with pauses of a planar arm, 8 s a group."""
    return simulated(tmp_path_factory, HIDDEN)


@pytest.fixture(scope="module")
def without(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    """The same without start-up friction."""
    return simulated(tmp_path_factory, HIDDEN[:1])


def simulated(
    tmp_path_factory: pytest.TempPathFactory, hidden: list[str], names: Sequence[str] = HELD_OUT
) -> MeasurementSet:
    plan, rng = make_plan("planar-2r", hidden), np.random.default_rng(4)
    centre, reach = np.zeros(2), np.full(2, 0.8)
    groups = tuple(
        replace(
            group,
            duration=8.0,
            reference=random_moves(plan.robot, rng, centre=centre, reach=reach, duration=8.0),
        )
        for group in of_groups(plan, names).groups
    )
    plan, folder = replace(plan, groups=groups), tmp_path_factory.mktemp("moves") / "set"
    write_plan(plan, simulate_plan(plan, 3), folder, 3)
    return read_set(folder)


def view_of(moves: MeasurementSet) -> Coarse:
    own = Layout(moves.joints)
    return Coarse(MotionContext(moves, own.joints, stand_ins=True), own, lambda _: None)


def with_brakes(moves: MeasurementSet, joint: int) -> MeasurementSet:
    """As if a brake held the joint at rest, against a motor torque that is anything."""

    def held(segment: Segment) -> Segment:
        tau, speed = segment.tau.copy(), np.gradient(segment.theta[:, joint], segment.step)
        tau[:, joint] += 30 * np.exp(-((speed / 3e-3) ** 2)) * np.sin(4 * segment.time)
        return replace(segment, tau=tau)

    groups = tuple(replace(g, segments=tuple(map(held, g.segments))) for g in moves.groups)
    return replace(moves, groups=groups)


def test_identification_recovers_it(moves: MeasurementSet) -> None:
    names = ["coulomb_friction:joint1", "startup_friction:joint1"]
    without = identify(moves, effects=names[:1], refine=False)
    result = identify(moves, effects=names)
    # what it leaves of the held-out groups; residuals of both fits differ in what they leave out
    before, after = (
        prediction_errors(moves, found.model, some).rms_validation
        for found, some in ((without, names[:1]), (result, names))
    )
    assert before is not None and after is not None and after[0] < 0.2 * before[0]
    assert result["startup_friction.startup", "joint1"].value == pytest.approx(3.0, rel=0.05)
    assert result["startup_friction.angle", "joint1"].value == pytest.approx(0.02, rel=0.05)
    assert result["coulomb_friction.coulomb", "joint1"].value == pytest.approx(4.0, rel=0.02)
    # without it, Coulomb friction stands in
    assert without["coulomb_friction.coulomb", "joint1"].value > 4.5


def test_it_is_found_with_all_samples(moves: MeasurementSet, without: MeasurementSet) -> None:
    for measurements, hidden in ((moves, True), (without, False)):
        view = view_of(measurements)
        found = Search(view).run(view.begin())
        assert (STARTUP in view.parts(found)) == hidden and COULOMB in view.parts(found)
        assert ChosenEffect("startup_friction", 1) not in view.parts(found)
        if hidden:
            assert found.fit.x[found.layout.effect_slice(STARTUP)] == pytest.approx([3.0, 0.02], rel=0.1)


def test_a_diagnosis_finds_it_first_after_coulomb_friction(moves: MeasurementSet) -> None:
    result = diagnose(moves, apply=True, guard=False)
    first, second, *_ = (step.added for step in result.steps[1:])
    assert first is not None and first.text == "coulomb_friction:joint1"
    assert first.parameters["coulomb"].value == pytest.approx(4.0, rel=0.01)
    assert second is not None and second.text == "startup_friction:joint1" and second.confidence > 0.9
    assert second.parameters["startup"].value == pytest.approx(3.0, rel=0.03)
    assert second.parameters["angle"].value == pytest.approx(0.02, rel=0.03)


@pytest.mark.slow
def test_it_is_found_where_a_brake_holds_at_rest(tmp_path_factory: pytest.TempPathFactory) -> None:
    moves = simulated(tmp_path_factory, HIDDEN, (*HELD_OUT, "t3p3"))
    result = diagnose(with_brakes(moves, 0), apply=True, guard=False)
    assert "startup_friction:joint1" in [step.added.text for step in result.steps if step.added]


def test_standstill_says_nothing_where_a_brake_holds_the_joint(moves: MeasurementSet) -> None:
    view = view_of(with_brakes(moves, 0))
    layout = Layout(moves.joints, (COULOMB,))
    fit = view.fit(layout, view.context.start(layout).x).fit
    assert view.context.set_standstill_apart(fit)
    assert view.context.first_phase[0] == Phase.MOTION and view.context.used[0][:, 0].mean() < 0.9
    again = view.fit(layout, fit.x).fit
    assert not view.context.set_standstill_apart(again)  # once is enough
