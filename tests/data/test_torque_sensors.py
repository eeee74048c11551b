"""Torque of joint torque sensors: recognised, told, and identified without motors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.torque_sensors import sensed
from flexviz import identify, read_set
from flexviz.base.errors import InputError
from flexviz.checks import behind_gear
from flexviz.content.results import ResultDocument
from flexviz.data.measurements import MeasurementSet
from flexviz.model.equation import Layout, layout_of
from flexviz.model.simulation.presets import PRESETS
from flexviz.model.simulation.sets import move, record, write_plan
from flexviz.outlets.exporting import export
from flexviz.robot.robot import Robot
from tests.independent.servo_simulator import PENDULUM
from tests.planar_arm import HELD_OUT, of_groups

SAID = "joint torque sensors, behind the gears"


@pytest.fixture(scope="module")
def arms(tmp_path_factory: pytest.TempPathFactory) -> dict[str, MeasurementSet]:
    """One simulated motion, with the motors' torque and with that of joint torque sensors."""
    folder, plan = tmp_path_factory.mktemp("sensors"), of_groups(PRESETS["panda"](), HELD_OUT, 10.0)
    recorded = record(plan, move(plan), 1)
    runs = {"motor": recorded, "joint": sensed(plan, recorded, 1)}
    return {side: read_set(write_plan(plan, made, folder / side, 1)) for side, made in runs.items()}


def test_each_torque_is_recognised(arms: dict[str, MeasurementSet]) -> None:
    assert behind_gear(arms["joint"])
    assert not behind_gear(arms["motor"])


def test_what_the_set_states_counts_more(arms: dict[str, MeasurementSet]) -> None:
    assert layout_of(replace(arms["joint"], torque="motor")).motors
    assert not layout_of(replace(arms["motor"], torque="joint")).motors


def test_data_that_excite_too_little_are_taken_for_the_motors(arms: dict[str, MeasurementSet]) -> None:
    still = [
        replace(g, segments=tuple(replace(s, theta=0 * s.theta + s.theta[0], tau=0 * s.tau + s.tau[0])
                                  for s in g.segments))
        for g in arms["joint"].groups
    ]  # fmt: skip
    assert not behind_gear(replace(arms["joint"], groups=tuple(still)))


def test_identified_without_motors_and_exported(arms: dict[str, MeasurementSet], tmp_path: Path) -> None:
    result = identify(arms["joint"])
    assert result.converged
    assert not {"motor_inertia", "motor_viscous_friction"} & {p.name for p in result.parameters}
    plan = PRESETS["panda"]()
    np.testing.assert_allclose(result.model.stiffness[:4], plan.model.stiffness[:4], rtol=0.05)
    np.testing.assert_allclose(
        result.model.link_viscous_friction, plan.model.link_viscous_friction, rtol=0.01
    )
    document = result.document()
    assert document.torque_side == "joint"
    assert SAID in result.summary()
    assert ResultDocument.from_dict(document.to_dict()) == document
    written = export(arms["joint"], result, tmp_path / "all")
    assert "mjcf" not in written.files
    assert "unknown and zero here" in (tmp_path / "all" / "parameters.yaml").read_text()
    with pytest.raises(InputError, match="MJCF needs motor inertias"):
        export(arms["joint"], result, tmp_path / "mjcf", ["mjcf"])


def test_layout_without_motors_keeps_the_link_side() -> None:
    layout = Layout(("a", "b"), motors=False)
    x = np.arange(1.0, layout.size + 1)
    model = layout.model(x)
    assert layout.size == 24
    assert not model.motor_inertia.any()
    assert not model.motor_viscous_friction.any()
    np.testing.assert_allclose(layout.vector(model), x)


def test_of_a_single_joint(tmp_path: Path) -> None:
    urdf = tmp_path / "pendulum.urdf"
    urdf.write_text(PENDULUM.format(mass=0.6, i=2e-4, axis="0 1 0"))
    time, speed = np.arange(0.0, 20.0, 0.005), np.array([2.0, 5.3, 9.1])
    phase = np.outer(time, speed)
    waves = np.sin(phase), speed * np.cos(phase), -(speed**2) * np.sin(phase)
    q, v, a = (wave.mean(axis=1)[:, None] for wave in waves)
    tau = Robot.load(str(urdf)).cad_torques((), q, v, a) + 0.02 * a + 0.1 * v
    noise = 1e-3 * np.random.default_rng(0).normal(size=q.shape)
    made = {"a": {"time": time, "theta": q, "tau": tau + noise}}
    assert not behind_gear(
        MeasurementSet.from_arrays(urdf, made)
    )  # nothing separates the inertias of one joint
