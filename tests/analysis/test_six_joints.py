"""Robots with six joints, simulated and recorded: every joint counts, not the first two."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as papq
import pytest

from benchmarks.independent import make_case
from flexviz.analysis.diagnosis import Diagnosis, diagnose
from flexviz.data.measurements import read_set
from tests.shared_data import REAL

LATE = slice(2, 6)  # beyond the second joint


def added(result: Diagnosis) -> set[str]:
    return {step.added.text for step in result.steps if step.added is not None}


def test_effects_on_late_joints_of_a_simulated_arm(tmp_path: Path) -> None:
    """A UR5 with dry friction on its last joint and an offset on the one before; all end at the noise."""
    truth = make_case(10, "coulomb_friction+torque_offset", "ur5", tmp_path, duration=4.0, noise=1.0)
    hidden = {f"{e['effect']}:{e['joint']}" for e in truth["effects"]}
    assert {text.partition(":")[2] for text in hidden} == {"wrist_3_joint", "wrist_2_joint"}
    result = diagnose(read_set(tmp_path), apply=True)
    assert hidden <= added(result)
    first, last = (np.array(result.steps[k].rms_validation) for k in (0, -1))
    floor = np.array(result.steps[-1].noise_floor)
    assert np.all(last < 2 * floor), last / floor
    assert np.all(last[4:] < 0.5 * first[4:])


def test_late_joints_of_a_recorded_arm(tmp_path: Path) -> None:
    """Ten seconds of a UR10, whose model lacks friction: that of late joints is found, their error falls."""
    if not (REAL / "ur10").is_dir():
        pytest.skip("the recording is not part of the project")
    for file in (REAL / "ur10").iterdir():
        if file.suffix == ".parquet":
            table = papq.read_table(file)
            time = table["time"].to_numpy()
            papq.write_table(table.slice(0, int(np.sum(time < time[0] + 10.0))), tmp_path / file.name)
        else:
            shutil.copyfile(file, tmp_path / file.name)
    measurements = read_set(tmp_path)
    result = diagnose(measurements, apply=True)
    late = [text for text in added(result) if text.partition(":")[2] in measurements.joints[LATE]]
    assert late
    first, last = (np.array(result.steps[k].rms_validation) for k in (0, -1))
    assert np.sum(last[LATE] < 0.8 * first[LATE]) >= 2
    assert np.mean(last / first) < 0.9
