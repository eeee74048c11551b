"""A set simulated from nothing but a URDF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexviz.base.errors import InputError
from flexviz.data.measurements import read_set
from flexviz.model.simulation import from_urdf
from flexviz.model.simulation.from_urdf import plan_from_urdf
from flexviz.model.simulation.sets import make_plan, simulate_preset
from tests.small_set import URDF


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    file = tmp_path / "arm.urdf"
    file.write_text(URDF)
    return file


def test_values_are_of_the_robots_size(urdf: Path) -> None:
    plan = plan_from_urdf(urdf)
    model = plan.model
    resonance = np.sqrt(model.stiffness / (2 * model.motor_inertia)) / (2 * np.pi)
    assert resonance == pytest.approx(8.0)  # [Hz]
    for group in plan.groups:
        position, velocity = group.reference.sample(np.linspace(0, group.duration, 500))
        assert (np.abs(position) < plan.robot.upper_limit).all()
        assert (np.abs(velocity) < plan.robot.velocity_limit).all()
    assert sum(group.validation for group in plan.groups) == 1 and len(plan.payloads) == 3
    assert plan.payloads["p3"][0].link == "link2" and plan.payloads["p3"][0].mass == pytest.approx(0.8)
    assert list(plan.files) == ["arm.urdf"]


def test_a_set_is_written_with_its_robot(urdf: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(from_urdf, "DURATION", 0.3)
    (tmp_path / "part.stl").write_bytes(b"solid nothing\nendsolid")
    urdf.write_text(
        URDF.replace("</inertial></link>", '</inertial><visual><geometry><mesh filename="part.stl"/>'
                     "</geometry></visual></link>")
    )  # fmt: skip
    done = simulate_preset(urdf, tmp_path / "out", ["coulomb_friction:joint1"])
    measurements = read_set(done.folder)
    assert measurements.robot.urdf_path == done.folder / "arm.urdf" and len(measurements.groups) == 4
    assert (done.folder / "part.stl").is_file() and measurements.simulated
    assert measurements.kp is not None and measurements.initial_stiffness is not None


def test_what_cannot_be_simulated_says_why(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not found"):
        make_plan(tmp_path / "no.urdf")
    bad = tmp_path / "bad.urdf"
    bad.write_text(URDF.replace('lower="-3.1" upper="3.1"', 'lower="0" upper="0"'))
    with pytest.raises(InputError, match='joint "joint1" can move less than'):
        make_plan(bad)
    massless = URDF.replace('<mass value="4"/>', '<mass value="0"/>').replace('="0.1"', '="0"')
    bad.write_text(massless)
    with pytest.raises(InputError, match="no inertia"):
        make_plan(bad)
