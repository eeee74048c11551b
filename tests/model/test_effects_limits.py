"""What parameters of effects may be: signs, orders, and an interval that ends after it begins."""

from __future__ import annotations

import numpy as np
import pytest

from flexviz.analysis.estimation import Bounds
from flexviz.analysis.estimation.descent import SHORTEST, Reach
from flexviz.analysis.estimation.prior import Prior, physically_consistent
from flexviz.analysis.estimation.score_test import allowed
from flexviz.model.effects import EFFECTS, ChosenEffect, EffectEvidence
from flexviz.model.equation import Layout
from flexviz.robot.robot import Robot

DISSIPATE = {  # friction takes energy out, a spring pulls back: these sizes are never negative
    "coulomb_friction": "coulomb",
    "stribeck_friction": "stribeck",
    "quadratic_friction": "quadratic",
    "load_dependent_friction": "coefficient",
    "presliding_hysteresis": "coulomb",
    "thinning_friction": "thinning",
    "startup_friction": "startup",
    "friction_drift": "relative_rise",
    "temperature_friction": "viscous_fall",
    "link_coulomb_friction": "coulomb",
    "joint_damping": "damping",
    "cable_spring": "stiffness",
    "coupled_friction": "coulomb",
}


@pytest.mark.parametrize("name", DISSIPATE)
def test_wrong_signs_are_out_of_bounds_and_gain_nothing(name: str) -> None:
    specs = EFFECTS[name].parameters
    index = [p.name for p in specs].index(DISSIPATE[name])
    assert 0.0 <= specs[index].lower < 0.01
    if specs[index].lower > 0.0:
        return
    values = np.array([max(p.lower, 0.5) for p in specs])
    assert allowed(ChosenEffect(name, 0), values)
    values[index] = -0.5
    assert not allowed(ChosenEffect(name, 0), values)


def test_directional_friction_never_drives_the_motor() -> None:
    effect = EFFECTS["directional_friction"]
    evidence = EffectEvidence(np.zeros(3), 1e-3, viscous=2.0)
    assert all(effect.credible(np.array([f]), evidence) for f in (-1.9, 0.5, 2.0))
    assert not any(effect.credible(np.array([f]), evidence) for f in (-2.1, 3.0))


@pytest.mark.parametrize("name", ["torque_ripple", "transmission_error"])
def test_a_ripple_has_at_least_one_cycle_a_turn(name: str) -> None:
    order = next(p for p in EFFECTS[name].parameters if p.name == "order")
    assert order.lower == 1.0 and order.lower_occurs


def test_a_contact_never_ends_before_it_begins() -> None:
    robot = Robot.load("robots:planar_2r")
    layout = Layout(robot.joints, (ChosenEffect("external_contact", 1, "g1"),))
    cad = physically_consistent(robot.cad_parameters)
    x = np.ones(layout.size)
    x[layout.inertial] = cad.ravel()
    x[-3:] = 5.0, 2.0, 2.4
    prior = Prior(layout, cad, x.copy(), np.full(layout.size, np.inf))
    open_bounds = Bounds(np.full(layout.size, -np.inf), np.full(layout.size, np.inf))
    step = np.zeros(layout.size)
    step[-2:] = 3.0, -1.0
    reached = next(Reach(open_bounds, prior.feasible, layout.compliance).along(x, step, SHORTEST))
    assert x[-2] < reached[-2] <= reached[-1] < x[-1]
    assert prior.feasible(reached) and not prior.feasible(x + step) and prior.value(x + step) == np.inf
