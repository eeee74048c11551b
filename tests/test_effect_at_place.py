"""An effect of the library that only the parameters beside an arbitrary torque show."""

from __future__ import annotations

from dataclasses import replace
from math import cos
from pathlib import Path

import numpy as np
import pytest

from flexviz.diagnosis.acceptance import excess
from flexviz.diagnosis.effect_at_place import acts_there, effect_at_place
from flexviz.diagnosis.fit_context import FitContext
from flexviz.diagnosis.search import Search
from flexviz.diagnosis.unknown_place import UnknownPlace, unknown_place
from flexviz.effects import ChosenEffect, JointState
from flexviz.equation import Layout
from flexviz.estimation import Side, UnknownInput
from flexviz.measurements import MeasurementSet, read_set
from flexviz.simulation import ExtraLaw, Pull, make_plan, simulate_plan, write_plan
from tests.planar_arm import HELD_OUT, of_groups

HALF_WIDTH = 0.004


class Uneven(ExtraLaw):
    """A spring that is softer at some angles, on a joint of 1,500 Nm/rad: no effect of the library."""

    def pull(self, at: JointState) -> Pull:
        return Pull(joint=0.4 * 1500.0 * cos(5 * at.theta) * (at.theta - at.q))


def lost_motion(folder: Path) -> MeasurementSet:
    """The planar arm with backlash of several times the joint's deflection."""
    plan = of_groups(make_plan("planar-2r", [f"backlash:joint2:half_width={HALF_WIDTH}"]), HELD_OUT)
    return read_set(write_plan(plan, simulate_plan(plan, 7), folder, 7))


def uneven(folder: Path) -> MeasurementSet:
    plan = of_groups(make_plan("planar-2r"), HELD_OUT)
    plan = replace(plan, laws=((plan.model.joints[1], Uneven()),))
    return read_set(write_plan(plan, simulate_plan(plan, 7), folder, 7))


@pytest.mark.parametrize("makes", [lost_motion, uneven])
def test_an_effect_is_found_from_parameters_that_nothing_biases(makes: object, tmp_path: Path) -> None:
    """From a fit whose stiffness has run away; a law that the effects only resemble stays unknown."""
    measurements = (lost_motion if makes is lost_motion else uneven)(tmp_path / "set")
    layout = Layout(measurements.joints)
    context = FitContext(measurements, layout)
    x = context.fit(layout, context.start(layout).x).x
    x[layout.compliance.start + 1] *= 30
    astray = context.fit(layout, x, iterations=0)
    place = unknown_place(context, astray, lambda: None)
    assert place is not None and place.complete and place.joint == "joint2"
    step = effect_at_place(Search(context, lambda text: None), astray, place, context.without_effects(astray))
    if makes is uneven:
        assert step is None
        return
    assert step is not None and step.before is astray
    assert step.chosen.effect == ChosenEffect("backlash", 1)
    fit = step.after
    assert fit.x[layout.size] == pytest.approx(HALF_WIDTH, rel=0.05)
    assert excess(fit) < 0.5
    # all candidates of that joint were scored, and no others
    assert step.scores is not None and {s.effect.joint for s in step.scores.ranked} == {1}


@pytest.mark.parametrize(
    ("side", "sure", "there"),
    [
        ("motor", True, ("coulomb_friction", "torque_gain")),
        ("transmission", True, ("backlash",)),
        ("link", True, ("cable_spring",)),
        ("link", False, ("backlash", "cable_spring", "coulomb_friction", "torque_gain")),
    ],
)
def test_effects_of_that_side_are_tried(side: Side, sure: bool, there: tuple[str, ...]) -> None:
    layout = Layout(("joint1", "joint2"))
    place = UnknownPlace(UnknownInput(1, side, 1.0), layout, np.zeros(layout.size), sure, 0.0, True)
    names = ("backlash", "cable_spring", "coulomb_friction", "external_contact", "torque_gain")
    effects = [ChosenEffect(name, joint) for name in names for joint in (0, 1)]
    effects.append(ChosenEffect("torque_delay"))
    found = {e for e in effects if acts_there(e, place)}
    assert found == {ChosenEffect(name, 1) for name in there}
