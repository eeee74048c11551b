"""Start-up friction in moves with pauses: identified, and found before standstill is judged apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flexviz.diagnosis.rich_search import RichSearch

from benchmarks.robotlike_study.motions import random_moves
from flexviz.diagnosis.motion_fit import MotionContext
from flexviz.diagnosis.motion_samples import Phase
from flexviz.diagnosis.prediction_errors import PredictionErrorBand
from flexviz.diagnosis.so_far import Standing
from flexviz.effects import ChosenEffect
from flexviz.equation import Layout
from flexviz.identification import identify
from flexviz.measurements import MeasurementSet, Segment, read_set
from flexviz.simulation import make_plan, simulate_plan, write_plan

COULOMB, STARTUP = ChosenEffect("coulomb_friction", 0), ChosenEffect("startup_friction", 0)
TILT = ChosenEffect("base_tilt")
HIDDEN = ["coulomb_friction:joint1:coulomb=4", "startup_friction:joint1:startup=3,angle=0.02"]


@pytest.fixture(scope="module")
def moves(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    """Moves with pauses of a planar arm, 8 s a group."""
    return simulated(tmp_path_factory, HIDDEN)


@pytest.fixture(scope="module")
def without(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    """The same without start-up friction."""
    return simulated(tmp_path_factory, HIDDEN[:1])


def simulated(tmp_path_factory: pytest.TempPathFactory, hidden: list[str]) -> MeasurementSet:
    plan, rng = make_plan("planar-2r", hidden), np.random.default_rng(4)
    centre, reach = np.zeros(2), np.full(2, 0.8)
    groups = tuple(
        replace(
            group,
            duration=8.0,
            reference=random_moves(plan.robot, rng, centre=centre, reach=reach, duration=8.0),
        )
        for group in plan.groups
    )
    plan, folder = replace(plan, groups=groups), tmp_path_factory.mktemp("moves") / "set"
    write_plan(plan, simulate_plan(plan, 3), folder, 3)
    return read_set(folder)


def search_on(moves: MeasurementSet) -> RichSearch:
    own, context = Layout(moves.joints), MotionContext(moves, moves.joints)
    return RichSearch(context, own, lambda text: None, Standing(own, PredictionErrorBand(moves), None))


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
    without, result = identify(moves, effects=names[:1]), identify(moves, effects=names)
    assert result.residual.rms[0] < 0.4 * without.residual.rms[0]
    assert result["startup_friction.startup", "joint1"].value == pytest.approx(3.0, rel=0.05)
    assert result["startup_friction.angle", "joint1"].value == pytest.approx(0.02, rel=0.05)
    assert result["coulomb_friction.coulomb", "joint1"].value == pytest.approx(4.0, rel=0.02)
    # without it, Coulomb friction stands in
    assert without["coulomb_friction.coulomb", "joint1"].value > 4.5


def test_it_is_found_before_standstill_is_left_out(moves: MeasurementSet) -> None:
    search = search_on(moves)
    context = search.context
    bare = search.fit(Layout(moves.joints, (COULOMB,)), context.start(Layout(moves.joints, (COULOMB,))).x)
    assert context.louder_before_motion(bare)[0]
    found, needed = search.with_starts(bare, {})
    assert STARTUP in needed and ChosenEffect("startup_friction", 1) not in needed
    assert found.x[found.layout.effect_slice(STARTUP)] == pytest.approx([3.0, 0.02], rel=0.05)
    assert found.rms[0] < 0.4 * bare.rms[0]
    assert search.with_starts(found, needed)[0] is found


@pytest.mark.parametrize("hidden", [True, False])
def test_the_first_movement_counts_where_start_up_friction_describes_it(
    moves: MeasurementSet, without: MeasurementSet, hidden: bool
) -> None:
    """Standstill says nothing where a brake holds the joint; what follows it does."""
    search = search_on(with_brakes(moves if hidden else without, 0))
    context, layout = search.context, Layout(moves.joints, (COULOMB, TILT))
    fit = search.fit(layout, context.start(layout).x)
    assert context.set_standstill_apart(fit) and context.first_phase[0] == Phase.MOTION
    found, needed = search.with_first_movements(search.fit(layout, fit.x), {})
    assert (STARTUP in needed) == hidden
    if hidden:
        assert context.first_phase[0] == Phase.START
        # the filter carries some of the brake's torque beyond the standstill
        assert found.x[found.layout.effect_slice(STARTUP)] == pytest.approx([3.0, 0.02], rel=0.25)
