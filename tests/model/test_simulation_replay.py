"""Replaying an identified model along a recorded group."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexviz.base.errors import Cancelled
from flexviz.data.measurements import MeasurementSet, Segment, read_set
from flexviz.model.simulation import Plan, make_plan, replay, simulate_plan, write_plan


def simulated(plan: Plan, folder: Path, duration: float) -> MeasurementSet:
    plan = replace(plan, groups=tuple(replace(g, duration=duration) for g in plan.groups[:1]))
    return read_set(write_plan(plan, simulate_plan(plan, 5), folder))


@pytest.mark.parametrize("start", ["rest", "moving"])
def test_closed_loop_repeats_the_recording(tmp_path: Path, start: str) -> None:
    plan = make_plan("paper-a", start=start)
    found = simulated(plan, tmp_path / "set", 1.0)
    group = found.groups[0]
    shares: list[float] = []
    run = replay(
        found.robot,
        plan.model,
        group,
        found.kp,
        found.kd,
        torque_hold=found.torque_hold,
        progress=lambda news: shares.append(news.share or 0.0),
    )
    assert run.facts[0].values["loop"] == "closed" and shares == sorted(shares) and shares[-1] == 1.0
    np.testing.assert_array_equal(run.time, group.segments[0].time)
    error = run.theta - group.segments[0].theta
    np.testing.assert_allclose(error.std(axis=0), 2e-5, rtol=0.1)  # only the noise is left
    assert np.abs(run.q - group.q).max() < 1e-5
    wrong = replace(plan.model, stiffness=0.7 * plan.model.stiffness)
    worse = replay(found.robot, wrong, group, found.kp, found.kd, torque_hold=found.torque_hold)
    assert np.abs(worse.q - group.q).max() > 1e-3


@pytest.mark.parametrize("name", ["planar-2r", "panda"])
def test_open_loop_stays_near(tmp_path: Path, name: str) -> None:
    plan = make_plan(name)
    found = simulated(plan, tmp_path / "set", 1.5)
    group = replace(found.groups[0], theta_ref=None)
    run = replay(found.robot, plan.model, group, found.kp, found.kd, torque_hold=found.torque_hold)
    assert run.facts[0].values["loop"] == "open"
    error = run.theta - group.segments[0].theta
    assert np.abs(error).max() < 3e-4
    assert np.abs(run.q - found.groups[0].q).max() < 3e-4
    wrong = replace(plan.model, inertial=1.3 * plan.model.inertial)
    worse = replay(found.robot, wrong, group, torque_hold=found.torque_hold)
    assert np.abs(worse.theta - group.segments[0].theta).max() > 3 * np.abs(error).max()


def test_gaps_limits_and_stopping(tmp_path: Path) -> None:
    plan = make_plan("planar-2r")
    found = simulated(plan, tmp_path / "set", 1.2)
    whole = found.groups[0].segments[0]
    pieces = tuple(
        Segment(whole.time[s], whole.theta[s], whole.tau[s], whole.step)
        for s in (slice(0, 500), slice(700, 1200))
    )
    group = replace(found.groups[0], segments=pieces)
    run = replay(found.robot, plan.model, group, found.kp, found.kd, torque_hold=found.torque_hold)
    assert len(run.time) == 1000
    measured = np.concatenate([piece.theta for piece in pieces])
    assert np.abs(run.theta - measured).max() < 1e-3
    short = replay(found.robot, plan.model, group, found.kp, found.kd, duration=0.1)
    assert len(short.time) == 101
    with pytest.raises(Cancelled):
        replay(found.robot, plan.model, group, found.kp, found.kd, should_stop=lambda: True)


def test_joints_too_stiff_to_resolve_are_softened(tmp_path: Path) -> None:
    plan = make_plan("planar-2r")
    found = simulated(plan, tmp_path / "set", 0.3)
    stiff = replace(plan.model, stiffness=np.array([1e9, 1100.0]), motor_inertia=np.array([2.45, 1e-9]))
    run = replay(found.robot, stiff, found.groups[0], found.kp, found.kd, torque_hold=found.torque_hold)
    limited = [fact for fact in run.facts if fact.kind == "limited"]
    assert [fact.values["what"] for fact in limited] == ["stiffness", "motor_inertia"]
    assert "joint1" in limited[0].joints and "joint2" in limited[1].joints
    assert np.isfinite(run.theta).all()
