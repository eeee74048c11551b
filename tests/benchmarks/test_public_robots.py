"""Public recordings become measurement sets; here from made-up logs in the form of one of the sources."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.public_robots import main
from flexviz.data.measurements import read_set
from flexviz.robot.robot import Robot

LOG = "FrankaEmikaPandaDynModel/matlab/data/Exciting_Traj/Trajectory_1/rbt_log"


def test_one_value_per_line_and_irregular_time_stamps(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / LOG
    log.mkdir(parents=True)
    rng = np.random.default_rng(0)
    time = np.arange(6000) * 1e-3 + 1e-4 * rng.uniform(-1, 1, 6000)
    speed, offset = np.arange(1.0, 8.0), np.array([0, 0, 0, -1.5, 0, 0, 0])  # within the joint's limits
    panda = Robot.load("example-robot-data:panda", [f"panda_joint{i}" for i in range(1, 8)])

    def motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        phase = np.outer(t, speed)
        q, v, a = np.sin(phase) + offset, speed * np.cos(phase), -(speed**2) * np.sin(phase)
        return q, panda.cad_torques((), q, v, a) + v

    theta, tau = motion(time)
    for name, values in (("time", time), ("positions", theta), ("torques", tau)):
        np.savetxt(log / f"exciting_traj_{name}.txt", values.reshape(-1, 1))
    main(["make", "--work", str(tmp_path)])
    said = capsys.readouterr().out
    assert "ur10e: skipped" in said and "tiago: skipped" in said
    found = read_set(tmp_path / "sets" / "panda")
    assert [(g.name, g.validation) for g in found.groups] == [("first", False), ("rest", True)]
    (segment,) = found.groups[1].segments
    middle = len(segment.time) // 2
    theta, tau = motion(segment.time[middle : middle + 1])
    assert segment.theta[middle] == pytest.approx(theta[0], abs=3e-3)
    assert segment.tau[middle] == pytest.approx(tau[0], abs=0.2)
