"""What the equation keeps between evaluations is what a fresh one computes; what nobody needs is left out."""

from __future__ import annotations

import numpy as np
import pytest

from flexviz.model.effects import ChosenEffect
from flexviz.model.equation import Equation
from flexviz.model.equation.motions import WideMotions
from tests.model.test_equation_truth import Hidden, at_the_truth

MANY: Hidden = {
    ("torque_ripple", 0): (1.8, 2.0, 0.4),
    ("stribeck_friction", 0): (1.5, 0.1),
    ("coulomb_friction", 1): (2.0,),
    ("load_dependent_friction", 1): (0.05,),
    ("cable_spring", 0): (3.0, 0.2),
    ("stiffness_hardening", 1): (2e4,),
}


def scaled(equation: Equation, x: np.ndarray, **factors: float) -> np.ndarray:
    """The vector with the parameters of some effects of joint 1 scaled."""
    out = x.copy()
    for name, factor in factors.items():
        out[equation.layout.effect_slice(ChosenEffect(name, 0))] *= factor
    return out


def test_an_evaluation_does_not_depend_on_earlier_ones() -> None:
    equation, x = at_the_truth(MANY, 8.0, 1.2)
    others = [
        scaled(equation, x, torque_ripple=1.1),
        scaled(equation, x, stribeck_friction=0.9),
        scaled(equation, x, torque_ripple=1.1, cable_spring=1.2),
        x,
    ]
    point = equation.at(x)
    for other in others:
        point.residual(other)
        fresh = Equation(equation.robot, equation.signals, equation.layout).at(x)
        np.testing.assert_array_equal(point.residual(other), fresh.residual(other))
        np.testing.assert_array_equal(point.evaluate(other).jacobian, fresh.evaluate(other).jacobian)


def test_points_of_one_fit_share_what_does_not_change() -> None:
    """A later point with other parameters sees new torques, although laws without a state are kept."""
    equation, x = at_the_truth(MANY, 8.0, 1.2)
    point = equation.at(x)
    point.evaluate(x)
    moved = scaled(equation, x, torque_ripple=1.5, cable_spring=0.5)
    moved[equation.layout.compliance] *= 1.3
    later = equation.at(moved, point)
    fresh = Equation(equation.robot, equation.signals, equation.layout).at(moved)
    typical = np.sqrt(np.mean(fresh.evaluate(moved).torque[0] ** 2))
    np.testing.assert_allclose(later.residual(moved), fresh.residual(moved), atol=2e-5 * typical)
    assert np.abs(later.residual(moved) - point.residual(moved)).max() > 1e-3 * typical


def test_torque_and_link_side_are_those_of_all_effects() -> None:
    equation, x = at_the_truth(MANY, 8.0, 1.2)
    point = equation.at(x)
    for found, expected in zip(point.motor_side(x), point.motor_side(x, point.terms(x)), strict=True):
        np.testing.assert_array_equal(found, expected)


def test_the_torque_is_computed_for_laws_that_follow_it_only(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    levels = WideMotions._levels

    def counting(self: WideMotions, joint: int, s: np.ndarray) -> object:
        asked.append(joint)
        return levels(self, joint, s)

    monkeypatch.setattr(WideMotions, "_levels", counting)
    motor_side: Hidden = {key: value for key, value in MANY.items() if key[0] != "cable_spring"}
    equation, x = at_the_truth(motor_side, 8.0, 1.2)
    point = equation.at(x)
    point.evaluate(x)
    assert asked and set(asked) == {1}
    before = len(asked)
    point.residual(scaled(equation, x, torque_ripple=1.2))
    assert len(asked) == before  # the same torque
    motion = point.context.motions(0)[0]
    assert np.all(np.isfinite(motion.link_velocity)) and set(asked) == {0, 1}
    with pytest.raises(AttributeError):
        motion.acceleration  # type: ignore[attr-defined]  # noqa: B018
