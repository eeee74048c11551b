"""Public recordings become measurement sets; here from made-up logs in the form of one of the sources."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.public_robots import main
from flexviz.data.measurements import read_set

LOG = "FrankaEmikaPandaDynModel/matlab/data/Exciting_Traj/Trajectory_1/rbt_log"


def test_one_value_per_line_and_irregular_time_stamps(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / LOG
    log.mkdir(parents=True)
    rng = np.random.default_rng(0)
    time = np.arange(6000) * 1e-3 + 1e-4 * rng.uniform(-1, 1, 6000)
    theta = np.sin(time[:, None] * np.arange(1.0, 8.0))
    theta[:, 3] -= 1.5  # within the joint's limits
    tau = 5 * np.cos(time[:, None] * np.arange(1.0, 8.0))
    for name, values in (("time", time), ("positions", theta), ("torques", tau)):
        np.savetxt(log / f"exciting_traj_{name}.txt", values.reshape(-1, 1))
    main(["make", "--work", str(tmp_path)])
    said = capsys.readouterr().out
    assert "ur10e: skipped" in said and "tiago: skipped" in said
    found = read_set(tmp_path / "sets" / "panda")
    assert [(g.name, g.validation) for g in found.groups] == [("first", False), ("rest", True)]
    (segment,) = found.groups[1].segments
    middle = len(segment.time) // 2
    at = segment.time[middle]
    speed = np.arange(1.0, 8.0)
    offset = np.array([0, 0, 0, -1.5, 0, 0, 0])
    assert segment.theta[middle] == pytest.approx(np.sin(at * speed) + offset, abs=3e-3)
    assert segment.tau[middle] == pytest.approx(5 * np.cos(at * speed), abs=2e-2)
