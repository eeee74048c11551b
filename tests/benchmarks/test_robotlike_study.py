"""The study of robots with many effects: its sets, shares, runs and report. Nothing is diagnosed here."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import savgol_filter

from benchmarks.diagnosis_study.judging import alike, judge
from benchmarks.diagnosis_study.laws import OFTEN, FrictionBump
from benchmarks.diagnosis_study.motions import random_moves
from benchmarks.diagnosis_study.report import calibration_rows, report, text
from benchmarks.robotlike_study.__main__ import main
from benchmarks.robotlike_study.cases import RobotCase, cases, parse_shares
from benchmarks.robotlike_study.effects import DRAWS, NUMBERS
from benchmarks.robotlike_study.making import filter_delay, make, plan_of
from benchmarks.robotlike_study.shares import effect_torque, law_torque, share
from benchmarks.running import case_folder, result_file, truth_file
from flexviz.data.measurements import read_set
from flexviz.model.simulation import Sensors
from flexviz.robot._pinocchio import pin
from flexviz.robot.model import EffectValue

TINY = RobotCase("rl5-2r-009", "2r", 5, 1.2)


def test_cases_are_mixed_and_stay_when_more_are_asked_for() -> None:
    some = cases(101, 12)
    assert [sum(c.robot == r for c in some) for r in ("2r", "ur5", "panda")] == [6, 3, 3]
    assert cases(101, 40)[:12] == some and len({c.name for c in some}) == 12
    assert {c.robot for c in cases(1, 6, parse_shares("0:0:1"))} == {"panda"}
    with pytest.raises(ValueError, match="expected a part"):
        parse_shares("1:2")


@pytest.mark.parametrize("robot", NUMBERS)
def test_draws_are_within_what_is_said(robot: str) -> None:
    kinds: set[str] = set()
    for case in [c for c in cases(3, 60) if c.robot == robot][:12]:
        plan, laws = plan_of(replace(case, duration=4.0))
        effects = plan.model.effects
        places = [(e.effect, e.joint) for e in effects]
        kinds |= {e.effect for e in effects}
        assert NUMBERS[robot][0] - 1 <= len(effects) <= NUMBERS[robot][1] and len(set(places)) == len(places)
        assert {e.effect for e in effects} <= set(DRAWS) and set(laws) <= set(OFTEN)
        assert len(laws) == len(plan.laws) <= 2
        for e in effects:  # the library only seeks it there
            assert e.effect != "stribeck_friction" or ("coulomb_friction", e.joint) in places
        assert plan.initial_stiffness is not None and plan.initial_motor_inertia is not None
        for rough, true in (
            (plan.initial_stiffness, plan.model.stiffness),
            (plan.initial_motor_inertia, plan.model.motor_inertia),
        ):
            assert np.all((rough / true > 0.49) & (rough / true < 2.01))
        wrong = plan.model.inertial[:, 0] / plan.robot.cad_parameters[:, 0]
        assert np.all((np.abs(wrong - 1) > 0.0799) & (np.abs(wrong - 1) < 0.1501))
    assert len(kinds) >= 8


def test_moves_stay_inside_and_are_smooth() -> None:
    plan, _ = plan_of(TINY)
    robot, centre, reach = plan.robot, np.array([0.2, -0.1]), np.array([0.5, 0.7])
    motion = random_moves(robot, np.random.default_rng(1), centre=centre, reach=reach, duration=10.0)
    t = np.linspace(0.0, 10.0, 20001)
    position, velocity = motion.sample(t)
    assert np.all(np.abs(position - centre) <= reach + 1e-12)
    np.testing.assert_allclose(np.gradient(position, t, axis=0)[1:-1], velocity[1:-1], atol=1e-4)
    np.testing.assert_array_equal(velocity[0], 0.0)
    assert np.abs(np.diff(velocity, axis=0)).max() < 0.02


def test_a_set_repeats_and_hides_its_truth(tmp_path: Path) -> None:
    for folder in ("one", "two"):
        make(tmp_path / folder, TINY)
    one, two = (read_set(case_folder(tmp_path / f, TINY.name)) for f in ("one", "two"))
    for a, b in zip(one.groups, two.groups, strict=True):
        np.testing.assert_array_equal(a.segments[0].theta, b.segments[0].theta)
        np.testing.assert_array_equal(a.segments[0].tau, b.segments[0].tau)
    assert (
        truth_file(tmp_path / "one", TINY.name).read_bytes()
        == truth_file(tmp_path / "two", TINY.name).read_bytes()
    )
    truth = json.loads(truth_file(tmp_path / "one", TINY.name).read_text())
    seen = {path.name for path in case_folder(tmp_path / "one", TINY.name).iterdir()}
    assert "truth.json" not in seen and "measurements.toml" in seen
    assert [g.validation for g in one.groups] == [False, False, True] and one.effects == ()
    step = truth["encoder_step"][0]
    theta = one.groups[0].segments[0].theta
    np.testing.assert_allclose(theta / step, np.round(theta / step), atol=1e-6)
    assert len(theta) == 600 and truth["joints"] == ["joint1", "joint2"]
    other, _ = plan_of(replace(TINY, seed=6))
    assert not np.allclose(other.model.stiffness, truth["stiffness"])
    shares = [e["share"] for e in truth["effects"]]
    assert shares == sorted(shares, reverse=True)


MOTOR_EFFECTS = {
    "coulomb_friction",
    "stribeck_friction",
    "quadratic_friction",
    "torque_ripple",
    "torque_offset",
}


def by_hand(e: dict[str, Any], theta: np.ndarray, v: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Torque of an effect along a recorded motion of its joint [Nm]; NaN for others."""
    p, sign = e.get("all_parameters", {}), np.tanh(v / 0.005)
    match e["effect"]:
        case "coulomb_friction" | "link_coulomb_friction":
            return p["coulomb"] * sign
        case "stribeck_friction":
            return p["stribeck"] * np.exp(-((v / p["velocity"]) ** 2)) * sign
        case "torque_offset":
            return np.full(len(theta), p["offset"])
        case "quadratic_friction":
            return p["quadratic"] * v * np.abs(v)
        case "torque_ripple":
            return p["amplitude"] * np.sin(p["order"] * theta + p["phase"])
        case "cable_spring":
            return p["stiffness"] * (theta - p["rest_angle"])
        case "load_dependent_friction":  # `load` is what the motor carries, this friction included
            return p["coefficient"] * np.abs(load / (1 + p["coefficient"] * sign * np.sign(load))) * sign
    return np.full(len(theta), np.nan)


def test_shares_of_a_set_from_what_it_recorded(tmp_path: Path) -> None:
    """Torques by hand from recorded positions and torques; the truth file has them from the simulation."""
    case = replace(TINY, name="rl5-2r-010", duration=3.0)
    make(tmp_path, case)
    truth = json.loads(truth_file(tmp_path, case.name).read_text())
    groups = read_set(case_folder(tmp_path, case.name)).groups
    segment = next(g for g in groups if g.validation).segments[0]
    theta = segment.theta
    v, a = (np.asarray(savgol_filter(theta, 15, 3, deriv=k, delta=segment.step, axis=0)) for k in (1, 2))
    load = segment.tau - np.array(truth["motor_inertia"]) * a - np.array(truth["viscous_motor"]) * v
    hidden = [e for e in truth["effects"] if e["joint"] is not None]
    places = [truth["joints"].index(e["joint"]) for e in hidden]
    for i, e in zip(places, hidden, strict=True):
        if e["effect"] in MOTOR_EFFECTS:
            load[:, i] -= by_hand(e, theta[:, i], v[:, i], load[:, i])
    checked = set()
    for i, e in zip(places, hidden, strict=True):
        torque = by_hand(e, theta[:, i], v[:, i], load[:, i])
        if np.isfinite(torque).all():
            checked.add(e["effect"])
            assert e["torque_rms"] == pytest.approx(np.sqrt(np.mean(torque**2)), rel=0.05), e
        assert e["share"] == pytest.approx(e["torque_rms"] / segment.tau[:, i].std(), rel=1e-9)
    assert len(checked) >= 5, checked


def test_torque_of_each_effect_against_a_finite_computation() -> None:
    """Presliding by small steps; effects in the joint by the slopes of the inverse dynamics."""
    plan, _ = plan_of(TINY)
    group = plan.groups[0]
    plan = replace(plan, model=replace(plan.model, effects=()), laws=())
    run = plan.run(group)
    dahl = EffectValue("presliding_hysteresis", "joint1", {"presliding_stiffness": 80.0, "coulomb": 1.5})
    torque = effect_torque(plan, group, run, dahl)
    fine = np.interp(np.linspace(0, run.time[-1], 200 * (len(run.time) - 1) + 1), run.time, run.theta[:, 0])
    z, out = 0.0, [0.0]
    for step in np.diff(fine).tolist():
        z += step - abs(step) * z * 80.0 / 1.5
        out.append(80.0 * z)
    np.testing.assert_allclose(torque, np.array(out)[::200], atol=2e-3)

    parameters = {"amplitude": 1e-3, "order": 3.0, "phase": 0.4}
    wave = effect_torque(plan, group, run, EffectValue("transmission_error", "joint2", parameters))
    shift = 1e-3 * np.sin(3.0 * run.theta[:, 1] + 0.4)
    rate = np.gradient(shift, run.time)
    acceleration = np.gradient(run.q_velocity, run.time, axis=0)
    model = plan.robot.model_with(plan.model.inertial, plan.payloads[group.payload])
    data, expected = model.createData(), []
    for row in zip(run.q, run.q_velocity, acceleration, strict=True):
        by_q, by_v, mass = pin.computeRNEADerivatives(model, data, *row)
        expected.append([by_q[1, 1], by_v[1, 1], mass[1, 1]])
    nearly = (np.array(expected) * np.column_stack([shift, rate, np.gradient(rate, run.time)])).sum(axis=1)
    assert share(wave - nearly, 1.0)["share"] < 0.01 * share(wave, 1.0)["share"]


def test_torque_of_an_unknown_law() -> None:
    plan, _ = plan_of(TINY)
    run = plan.run(plan.groups[0])
    law = FrictionBump(1.2, 0.1, 0.2)
    near = np.exp(-(((run.theta[:, 1] - 0.1) / 0.2) ** 2))
    expected = 1.2 * near * np.tanh(run.theta_velocity[:, 1] / 0.005)
    np.testing.assert_allclose(law_torque(plan, run, "joint2", law), expected, atol=1e-12)


def test_the_delay_of_a_filtered_torque() -> None:
    """The share against the difference between the filtered and the applied torque."""
    plan, _ = plan_of(replace(TINY, duration=3.0))
    bandwidth = 2 * np.pi * 200.0
    applied = replace(plan, sensors=Sensors()).run(plan.groups[0])
    seen = replace(plan, sensors=Sensors(torque_filter=bandwidth)).run(plan.groups[0])
    entry = filter_delay(seen, bandwidth)
    assert entry["parameters"]["delay"] == pytest.approx(-1 / 1256.637, rel=1e-4) and entry["joint"] is None
    # an applied torque is seen from the middle of its hold on
    held = np.column_stack(
        [np.interp(seen.time, applied.time + applied.torque_hold / 2, column) for column in applied.tau.T]
    )
    difference = np.sqrt(((held - seen.tau) ** 2).mean(axis=0)) / seen.tau.std(axis=0)
    assert entry["share"] == pytest.approx(difference.max(), rel=0.15)


def effect(name: str, joint: str, part: float, **parameters: float) -> dict[str, Any]:
    return {"effect": name, "joint": joint, "share": part, "torque_rms": part, "parameters": parameters}


def added(name: str, joint: str, confidence: float | None = None, **parameters: float) -> dict[str, Any]:
    values = {k: {"value": v, "std": 0.1, "unit": ""} for k, v in parameters.items()}
    out: dict[str, Any] = {"effect": name, "joint": joint, "parameters": values}
    return out if confidence is None else out | {"confidence": confidence}


TRUTH = {
    "case": "rl1-2r-000",
    "robot": "2r",
    "effects": [
        effect("coulomb_friction", "joint1", 0.3, coulomb=2.0),
        effect("cable_spring", "joint2", 0.2, stiffness=4.0),
        effect("unknown", "joint2", 0.1) | {"kind": "friction_bump"},
        effect("torque_ripple", "joint1", 0.04, amplitude=0.5, order=9.0),
        effect("stribeck_friction", "joint1", 0.02, stribeck=0.5, velocity=0.1),
    ],
}


def result(*effects: dict[str, Any], last: str = "unknown") -> dict[str, Any]:
    steps: list[dict[str, Any]] = [{"added": None, "rms_validation": [3.0, 4.0], "verdict": "missing"}]
    steps += [{"added": e, "rms_validation": [0.3, 0.4], "verdict": last} for e in effects]
    diagnosis = {"verdict": "missing", "candidates": [], "steps": steps, "model": {"effects": list(effects)}}
    return {
        "case": TRUTH["case"],
        "exit": 0,
        "wall": 9.0,
        "cpu": 8.0,
        "peak_mb": 300.0,
        "diagnosis": diagnosis,
    }


def test_scoring_of_a_result() -> None:
    got = judge(
        TRUTH,
        result(
            added("link_coulomb_friction", "joint1", 0.97, coulomb=1.9),  # a twin
            added("cable_spring", "joint2", 0.92, stiffness=3.0),
            added("torque_ripple", "joint1", 0.6, amplitude=-0.55, order=9.1),
            added("stribeck_friction", "joint2", 0.96),  # an imitation of the law beside it
            added("torque_gain", "joint1", 0.2),  # false
        ),
        many=True,
    )
    assert len(got.must) == 3 and not got.missed and len(got.hidden) == 4
    assert got.false == ["torque_gain:joint1"] and got.imitations == ["stribeck_friction:joint2"]
    assert got.verdict_right and got.held_out == pytest.approx(0.1)
    assert {value.name: value.error for value in got.values} == pytest.approx(
        {"cable_spring.stiffness": 0.25, "torque_ripple.amplitude": 0.1}
    )
    rows = {row[0]: row[1:] for row in calibration_rows(got.additions)}
    assert rows["0.95 to 1"] == ["2", "0.965", "1/2 (50.0 %)", "2/2 (100.0 %)"]
    assert rows["0.9 to 0.95"][0] == "1" and rows["0.5 to 0.7"][2] == "1/1 (100.0 %)"
    assert rows["0 to 0.3"][2] == "0/1 (0.0 %)" and rows["none stated"][0] == "0"
    lost = judge(TRUTH, {"error": "no answer in 5 s", "wall": 5.0, "cpu": 4.0, "peak_mb": 1.0}, many=True)
    told = text(report({"now": {"a": got, "b": lost}}, dict.fromkeys("abc", "2r")))
    for line in (
        "2 of 3 sets have a result of every command, 1 an answer",
        "- a: missing, last unknown; added link_coulomb_friction:joint1, ",
        "false torque_gain:joint1",
        "- b: no answer (no answer in 5 s)",
    ):
        assert line in told
    cells = {row.split()[0]: row.split()[1:] for row in told.splitlines() if row.strip()}
    assert cells["2r"][:6] == ["now", "2", "3/6", "1", "0/2", "1/2"]
    missed = judge(TRUTH, result(added("coulomb_friction", "joint2"), last="nothing-missing"), many=True)
    assert not missed.verdict_right and len(missed.missed) == 3
    assert missed.additions[0].imitation and missed.additions[0].confidence is None
    assert not alike(added("coulomb_friction", "joint2"), TRUTH["effects"][0])


def test_a_free_curve_is_false_only_where_an_unmodelled_torque_acts_not() -> None:
    right, wrong = (
        judge(TRUTH, result(added("free_curve_friction", joint)), many=True) for joint in ("joint2", "joint1")
    )
    assert not right.additions and wrong.false == ["free_curve_friction:joint1"]


FAKE = """
import json, pathlib, sys, time
assert sys.argv[1] == "diagnose" and sys.argv[3:5] == ["--apply", "--json"], sys.argv
case = pathlib.Path(sys.argv[2])
if case.name.endswith("slow"):
    time.sleep(60)
if case.name.endswith("bad"):
    sys.exit("cannot read it")
room = bytearray(60_000_000)
effects = [{"effect": "coulomb_friction", "joint": "joint1", "parameters": {}}]
document = {"verdict": "missing", "candidates": [], "steps": [], "model": {"effects": effects}}
pathlib.Path(sys.argv[5]).write_text(json.dumps(document))
with open(case / "calls", "a") as calls:
    calls.write("x")
"""


def test_runs_are_kept_and_their_cost_recorded(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fake = tmp_path / "fake.py"
    fake.write_text(FAKE)
    for name in ("a-good", "a-slow", "a-bad"):
        case_folder(tmp_path, name).mkdir(parents=True)
        truth_file(tmp_path, name).parent.mkdir(exist_ok=True)
        truth_file(tmp_path, name).write_text(json.dumps(TRUTH | {"case": name}))
    arguments = ["run", "--work", str(tmp_path), "--timeout", "1.5", "--command", f"{sys.executable} {fake}"]
    for _ in range(2):
        assert main(arguments) == 0
    assert (case_folder(tmp_path, "a-good") / "calls").read_text() == "x"  # not a second time
    got = {
        n: json.loads(result_file(tmp_path / "results", n).read_text()) for n in ("a-good", "a-slow", "a-bad")
    }
    # a child's peak starts at the size of the process that forked it, here the whole test run
    assert got["a-good"]["exit"] == 0 and got["a-good"]["peak_mb"] > 60 and got["a-good"]["wall"] > 0
    assert got["a-slow"]["exit"] is None and got["a-slow"]["error"] == "no answer in 1.5 s"
    assert got["a-bad"]["exit"] == 1 and got["a-bad"]["error"] == "cannot read it"
    assert main(["report", "--work", str(tmp_path)]) == 1  # two have no answer
    assert "3 of 3 sets have a result of every command, 1 an answer" in capsys.readouterr().out
