"""Logs of goals and positions, without a torque: imported without a key that is written by hand."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as papq
import pytest

import flexviz
from flexviz.data.importing import inspect_logs
from tests.import_data import write_lerobot_goals
from tests.independent.servo_simulator import PENDULUM, Servo, random_goals, simulated

pytest.importorskip("mujoco")
SERVO = Servo(12.0, 0.02, 0.5)
JOINTS = ("hinge",)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """A pendulum's URDF and two runs of it."""
    urdf = tmp_path_factory.mktemp("robot") / "pendulum.urdf"
    urdf.write_text(PENDULUM.format(mass=0.6, i=2e-4, axis="0 1 0"), encoding="utf-8")
    runs = [simulated(urdf, JOINTS, [SERVO], random_goals(k, 1, 1.2, 1.0), 12.0, 0.02) for k in range(2)]
    episodes = [SimpleNamespace(time=r["time"], theta=r["theta"], goal=r["theta_ref"]) for r in runs]
    return SimpleNamespace(urdf=urdf, episodes=episodes)


def identified(recorded: SimpleNamespace, logs: list[Path], folder: Path) -> flexviz.Identification:
    """The result of logs whose drafted mapping is imported as it is."""
    draft = inspect_logs(logs, str(recorded.urdf)).draft
    assert not draft.missing and draft.drive
    mapping = folder / "mapping.toml"
    mapping.write_text(draft.text(mapping), encoding="utf-8")
    flexviz.import_logs(mapping, folder / "set")
    return flexviz.identify(folder / "set")


def near(result: flexviz.Identification) -> bool:
    gain, inertia = (result[name, "hinge"].value for name in ("position_control.gain", "motor_inertia"))
    return abs(gain / SERVO.gain - 1) < 0.02 and abs(inertia / SERVO.armature - 1) < 0.05


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_a_lerobot_dataset_whose_action_differs_from_its_state(
    version: str, recorded: SimpleNamespace, tmp_path: Path
) -> None:
    folder = write_lerobot_goals(tmp_path / "dataset", recorded.episodes, version, JOINTS)
    assert near(identified(recorded, [folder], tmp_path))


@pytest.mark.parametrize(
    "goal, position, scale",
    [
        ("goal_position.{}", "present_position.{}", 1.0),
        ("reference/positions/{}", "feedback/positions/{}", 1.0),
        ("goal_position.{}", "present_position.{}", 4096 / (2 * np.pi)),
    ],
)
def test_columns_of_goals(
    goal: str, position: str, scale: float, recorded: SimpleNamespace, tmp_path: Path
) -> None:
    logs = []
    for k, run in enumerate(recorded.episodes):
        counts = scale != 1.0
        columns = {"time": run.time}
        for name, values in ((goal, run.goal), (position, run.theta)):
            raw = values[:, 0] * scale + (2048 if counts else 0)
            columns[name.format("hinge")] = np.round(raw) if counts else raw
        columns["present_current.hinge"] = np.abs(np.round(100 * (run.goal - run.theta)[:, 0]))
        logs.append(tmp_path / f"run{k}.parquet")
        papq.write_table(pa.table(columns), logs[-1])
    assert near(identified(recorded, logs, tmp_path))
