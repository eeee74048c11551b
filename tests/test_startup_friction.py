"""Start-up friction in moves with pauses: identified, and found before standstill is judged apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.robotlike_study.motions import random_moves
from flexviz.diagnosis.motion_fit import MotionContext
from flexviz.diagnosis.prediction_errors import PredictionErrorBand
from flexviz.diagnosis.rich_search import RichSearch
from flexviz.diagnosis.so_far import Standing
from flexviz.effects import ChosenEffect
from flexviz.equation import Layout
from flexviz.identification import identify
from flexviz.measurements import MeasurementSet, read_set
from flexviz.simulation import make_plan, simulate_plan, write_plan

COULOMB, STARTUP = ChosenEffect("coulomb_friction", 0), ChosenEffect("startup_friction", 0)
HIDDEN = ["coulomb_friction:joint1:coulomb=4", "startup_friction:joint1:startup=3,angle=0.02"]


@pytest.fixture(scope="module")
def moves(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    """Moves with pauses of a planar arm, 8 s a group."""
    plan, rng = make_plan("planar-2r", HIDDEN), np.random.default_rng(4)
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
    context = MotionContext(moves, moves.joints)
    own = Layout(moves.joints)
    search = RichSearch(context, own, lambda text: None, Standing(own, PredictionErrorBand(moves), None))
    bare = search.fit(Layout(moves.joints, (COULOMB,)), context.start(Layout(moves.joints, (COULOMB,))).x)
    assert context.louder_at_rest(bare)[0]
    found, needed = search.with_starts(bare, {})
    assert STARTUP in needed and ChosenEffect("startup_friction", 1) not in needed
    assert found.x[found.layout.effect_slice(STARTUP)] == pytest.approx([3.0, 0.02], rel=0.05)
    assert found.rms[0] < 0.4 * bare.rms[0]
    assert search.with_starts(found, needed)[0] is found
