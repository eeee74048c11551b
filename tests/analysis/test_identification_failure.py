"""A fit that does not converge names the joint that keeps it from converging, and why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexviz.analysis.identification import identify
from flexviz.analysis.identification.failure import Unrest, unexplained, unrest_by_residual, why_not
from flexviz.base.resources import sessions_dir
from flexviz.content.records import ParameterEstimate, ResidualSummary
from flexviz.content.wording import percent
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.equation import Layout


@pytest.fixture(scope="module")
def strange() -> MeasurementSet:
    """The bundled set; the torque of joint 2 belongs to another motion."""
    whole = read_set(sessions_dir() / "planar-2r-demo")
    groups = []
    for group in whole.groups:
        (segment,) = group.segments
        tau, time = segment.tau.copy(), segment.time
        tau[:, 1] = 20 * np.sin(1.4 * np.pi * time + 1) + 8 * np.sin(3.8 * np.pi * time)
        groups.append(replace(group, segments=(replace(segment, tau=tau),)))
    return replace(whole, groups=tuple(groups))


@pytest.mark.slow
def test_the_joint_whose_torque_is_another_motions_is_named(strange: MeasurementSet) -> None:
    result = identify(strange, refine=True)
    assert not result.converged
    assert "joint2 cannot be fitted, because its motor inertia ended at the bound" in result.message
    assert "joint1 cannot be fitted" not in result.message
    share = result.residual.rms[1] / result.residual.torque_spread[1]
    assert share > 1 and f"its error is {percent(share)} of its torque" in result.message


def test_a_converged_fit_that_explains_nothing_of_a_joint_says_so() -> None:
    summary = ResidualSummary(("a", "b"), (0.1, 3.0), None, (0.1, 0.1), (10.0, 2.9))
    found = unexplained(summary)
    assert found is not None and list(found.joints) == [0.0, 1.0]
    assert unexplained(replace(summary, rms=(0.1, 2.8))) is None
    assert unexplained(replace(summary, noise_floor=(0.1, 1.1))) is None
    assert unexplained(replace(summary, torque_spread=(10.0, 0.0))) is None
    assert unexplained(replace(summary, torque_spread=())) is None


def test_a_plain_fit_that_runs_out_of_steps_says_what_still_moves() -> None:
    measurements = read_set(sessions_dir() / "planar-2r-demo")
    result = identify(measurements, max_iterations=1, refine=False, bandwidth=30.0)
    assert not result.converged and " cannot be fitted, because " in result.message
    assert "nan" not in result.message


def estimate(name: str, joint: str, grade: str = "yes", at_bound: bool = False) -> ParameterEstimate:
    return ParameterEstimate(name, joint, 1.0, 0.1, "-", grade, 1.0, (), at_bound)  # type: ignore[arg-type]


def test_reasons() -> None:
    layout = Layout(("a", "b", "c"))
    residual = ResidualSummary(("a", "b", "c"), (0.1, 3.0, 0.1), None, (0.1, 0.1, 0.1), (10.0, 10.0, 10.0))
    parameters = [
        estimate("stiffness", "a", "no"),
        estimate("stiffness", "b", "no", at_bound=True),
        estimate("motor_inertia", "b", "weak"),
        estimate("mass", "b", "no"),  # single inertial parameters seldom are determined
    ]
    both = unrest_by_residual(np.array([4.0, 6.0, 0.5]))
    assert why_not(both, layout, parameters, residual) == (
        "b cannot be fitted, because its stiffness ended at the bound of what is possible and its error is "
        "30 % of its torque; a cannot be fitted, because the data do not determine its stiffness"
    )
    moving = np.zeros(layout.size)
    moving[layout.motor_viscous.start + 2] = 3.0
    text = why_not(Unrest(np.array([0.1, 0.2, 0.7]), moving), layout, parameters, residual)
    assert text == "c cannot be fitted, because its motor viscous friction still moves"
    unknown = replace(residual, torque_spread=())
    assert "error" not in why_not(both, layout, parameters, unknown)
