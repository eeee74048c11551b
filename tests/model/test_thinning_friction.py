"""Shear-thinning friction stands for friction that grows as |v|^0.6, as real gears show it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from flexviz.analysis.diagnosis import prediction_errors
from flexviz.analysis.identification import identify
from flexviz.data.measurements import read_set
from flexviz.model.effects import JointState
from flexviz.model.simulation import ExtraLaw, Pull, make_plan, simulate_plan, write_plan
from tests.planar_arm import HELD_OUT, of_groups


@dataclass(frozen=True)
class PowerLaw(ExtraLaw):
    """3 Nm · |v|^0.6, smooth below 0.01 rad/s."""

    def pull(self, at: JointState) -> Pull:
        v = at.theta_velocity
        return Pull(motor=3.0 * v * (v * v + 1e-4) ** -0.2)


@pytest.mark.slow
def test_a_power_law_of_no_library_is_described(tmp_path: Path) -> None:
    plan = replace(
        of_groups(make_plan("planar-2r", ["coulomb_friction:joint1:coulomb=2"]), HELD_OUT, 12.0),
        laws=(("joint1", PowerLaw()),),
    )
    write_plan(plan, simulate_plan(plan, 3), tmp_path / "set", 3)
    measurements, coulomb = read_set(tmp_path / "set"), "coulomb_friction:joint1"
    names = ("quadratic_friction", "thinning_friction")
    plain = identify(measurements, effects=[coulomb])
    with_quadratic, with_it = (identify(measurements, effects=[coulomb, f"{n}:joint1"]) for n in names)
    errors = [
        prediction_errors(measurements, plain.model, [coulomb]),
        prediction_errors(measurements, with_it.model, [coulomb, "thinning_friction:joint1"]),
    ]
    before, after = (e.rms_validation[0] ** 2 - e.noise_floor[0] ** 2 for e in errors if e.rms_validation)
    assert after < 0.15**2 * before  # of the error above the noise
    # the bound of the quadratic term, which would have to be negative
    assert with_quadratic["quadratic_friction.quadratic", "joint1"].value == pytest.approx(0.0, abs=1e-3)
    assert abs(with_it["stiffness", "joint1"].value - 1000) < 0.2 * abs(
        plain["stiffness", "joint1"].value - 1000
    )
    assert with_it["coulomb_friction.coulomb", "joint1"].value == pytest.approx(2.0, abs=0.3)
