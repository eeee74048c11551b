"""Design of experiments: closed forms, limits on a fine grid, predicted against identified errors, files."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from flexviz import Design, DesignSettings, design, identify, write_design
from flexviz.analysis.designing.criterion import BestSeparation, LeastErrors
from flexviz.analysis.designing.information import information
from flexviz.analysis.designing.subject import subject_of
from flexviz.base.errors import InputError
from flexviz.content.records import CandidateEffect, Tie
from flexviz.content.results import ResultDocument
from flexviz.model.simulation import Fourier, follow, make_plan, simulate_run
from flexviz.outlets.terminal import main

ENTRY = CandidateEffect(
    effect="coulomb_friction",
    joint="joint2",
    score=0.9,
    confidence=0.9,
    parameters={},
    inseparable_from=(Tie("link_coulomb_friction", "joint2", 0.99),),
)
LIMITS = {
    "lower": [-0.5, -1.5],
    "upper": [1.0, 0.5],
    "velocity": [1.5, 2.0],
    "acceleration": [6.0, 9.0],
    "torque": [90.0, 50.0],
    "box_lower": [0.3, -3.0, -1.0],
}
QUICK = DesignSettings.of(groups=2, duration=5.0, evaluations=48, passes=1, limits=LIMITS)
SMOOTH = Fourier(np.array([0.2, -0.4]), np.full((2, 3), 0.1), np.full((2, 3), 0.1), 1.2, end=5.0)


@pytest.fixture(scope="module")
def found() -> Design:
    return design("planar-2r", settings=QUICK, seed=3)


def white(count: int, n: int, sigma: float, step: float) -> np.ndarray:
    return np.full((count // 2 + 1, n), 2 * step * sigma**2)


@pytest.mark.parametrize("count", [60, 61])
def test_error_of_one_linear_parameter_is_sigma_over_the_root_of_the_sum_of_squares(count: int) -> None:
    phi = np.random.default_rng(0).standard_normal((count, 2, 1))
    gram = information(phi, white(count, 2, 0.3, 0.05), 0.05)
    least = LeastErrors(np.zeros((1, 1)), np.array([0]), np.array([1.0]))
    assert least.value(gram) == pytest.approx(np.log(0.3 / np.sqrt((phi**2).sum())), abs=1e-9)
    assert np.fft.rfftfreq(count, 0.05)[-1] <= 10.0


def test_gain_is_what_the_other_effect_leaves() -> None:
    rng = np.random.default_rng(1)
    model, first, second = rng.standard_normal((3, 80))
    columns = np.stack((model, first, second, 2 * first, 3 * second), axis=1)[:, None]
    gram = information(columns, white(80, 1, 0.5, 0.1), 0.1)
    gains = BestSeparation(np.zeros((3, 3)), (np.array([1]), np.array([2]))).gains(gram)
    for gain, mine, other in ((gains[0], 2 * first, second), (gains[1], 3 * second, first)):
        others = np.stack((model, other), axis=1)
        left = mine - others @ np.linalg.lstsq(others, mine, rcond=None)[0]
        assert gain == pytest.approx(0.5 * left @ left / 0.25, rel=1e-6)


def test_quick_prediction_follows_the_simulation() -> None:
    plan = make_plan("planar-2r")
    robot, model, controller, bodies = plan.robot, plan.model, plan.controller, plan.payloads["p2"]
    run = simulate_run(
        robot, model, payload=bodies, reference=SMOOTH, controller=controller, duration=2.0, step=0.001
    )
    quick = follow(robot, model, SMOOTH, np.arange(400) * 0.005, controller, payload=bodies)
    for name, tolerance in (("theta", 5e-5), ("q", 5e-4), ("tau", 0.5)):
        truth = getattr(run, name)[::20]
        assert np.abs(getattr(quick, name) - truth).max() < tolerance
        assert np.ptp(truth) > 50 * tolerance


def test_motion_rests_at_both_ends() -> None:
    position, velocity = SMOOTH.sample(np.array([0.0, 2.5, 5.0]))
    assert np.allclose(position[[0, 2]], SMOOTH.centre) and np.allclose(velocity[[0, 2]], 0.0)
    ahead, behind = (SMOOTH.sample(np.array([4.6 + d]))[0] for d in (1e-6, -1e-6))
    assert (ahead - behind) / 2e-6 == pytest.approx(SMOOTH.sample(np.array([4.6]))[1], abs=1e-6)


def test_limits_hold_on_a_fine_grid_of_the_full_simulation(found: Design) -> None:
    plan = make_plan("planar-2r")
    for group in found.groups:
        planned = group.planned
        run = simulate_run(
            plan.robot, plan.model, payload=plan.payloads[planned.payload], reference=planned.reference,
            controller=plan.controller, duration=planned.duration, record_step=0.001,
        )  # fmt: skip
        assert np.all(run.theta > LIMITS["lower"]) and np.all(run.theta < LIMITS["upper"])
        assert np.all(np.abs(run.theta_velocity) < LIMITS["velocity"])
        assert np.all(np.abs(np.gradient(run.theta_velocity, 0.001, axis=0)) < 1.02 * np.array([6.0, 9.0]))
        assert np.all(np.abs(run.tau) < 1.01 * np.array(LIMITS["torque"]))
        tool = [plan.robot.link_poses(q)["link2"][0, 3] for q in run.q[::50]]
        assert min(tool) > 0.3


def test_search_improves_and_repeats(found: Design) -> None:
    assert found.value < 0.8 * found.before
    again = design("planar-2r", settings=QUICK, seed=3)
    assert again.value == found.value and again.groups[0].planned.payload == found.groups[0].planned.payload


def test_predicted_errors_are_those_of_the_identification(found: Design) -> None:
    subject = subject_of("planar-2r")
    recorded = subject.predicted([group.planned for group in found.groups], 0.001, seed=9)
    result = identify(recorded, refine=True)
    for name in ("stiffness", "motor_inertia", "motor_viscous_friction"):
        for joint in found.joints:
            predicted = next(e for e in found.errors if (e.name, e.joint) == (name, joint))
            one = result[name, joint]
            assert one.std == pytest.approx(predicted.std, rel=0.15)
            assert abs(one.value - predicted.value) < 5 * predicted.std


def test_a_stopped_search_keeps_the_best_so_far() -> None:
    calls = iter(range(1000))
    stopped = design("planar-2r", settings=QUICK, seed=3, should_stop=lambda: next(calls) > 20)
    assert stopped.stopped and len(stopped.groups) == 2 and stopped.evaluations < 40
    assert all(one.share <= 1.0 for group in stopped.groups for one in group.used)


def test_the_deciding_motion_beats_a_random_one() -> None:
    settings = QUICK.model_copy(update={"groups": 1, "evaluations": 24})
    pair = ("torque_offset:joint2", "cable_spring:joint2")
    found = design("planar-2r", separate=pair, settings=settings)
    # an offset is a spring with a distant rest angle: only the spring can win
    assert found.separates == pair and found.gains[0] < 1e-3 * found.gains[1]
    assert found.gains[1] == pytest.approx(found.value, rel=1e-6)
    assert found.value > 1.5 * found.before


def test_files_read_back(found: Design, tmp_path: Path) -> None:
    from ruamel.yaml import YAML

    folder = write_design(found, tmp_path / "out")
    document = json.loads((folder / "design.json").read_text())
    for group, entry in zip(found.groups, document["groups"], strict=True):
        reference = group.planned.reference
        with (folder / entry["files"][0]).open() as file:
            rows = list(csv.DictReader(file))
        time = np.array([float(row["time"]) for row in rows])
        position, velocity = reference.sample(time)
        read = np.array([[float(row[f"theta_ref_{j}"]) for j in found.joints] for row in rows])
        assert np.abs(read - position).max() < 1e-8 and time[-1] == 5.0
        points = YAML(typ="safe").load((folder / entry["files"][1]).read_text())["points"]
        at = np.array([p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in points])
        assert np.abs(np.array([p["velocities"] for p in points]) - reference.sample(at)[1]).max() < 1e-8
        slope = np.gradient(velocity, 0.001, axis=0)
        given = np.array([[float(row[f"acceleration_ref_{j}"]) for j in found.joints] for row in rows])
        assert np.abs(given - slope)[1:-1].max() < 0.01
        centre, sine, cosine = (np.array(entry[k]) for k in ("centre", "sine", "cosine"))
        again = Fourier(centre, sine, cosine, entry["frequency"], end=5.0)
        assert np.allclose(again.sample(time)[0], position)
    with pytest.raises(InputError, match="expected a new or empty folder"):
        write_design(found, folder)


@pytest.mark.parametrize(
    "text, words",
    [
        ("groups = 0", "groups: found 0, expected a number of at least 1"),
        ("gruops = 1", 'unknown key "gruops"; did you mean "groups"'),
        ('payloads = ["p9"]', 'payloads: payload "p9" is not defined'),
        (
            "harmonics = 12\nfrequency = 0.5",
            "harmonics: the fastest harmonic has 6 Hz, expected at most 4 Hz",
        ),
        ("[limits]\ntorque = [1.0]", "limits.torque: 1 values, expected 2, one per joint: joint1, joint2"),
        ("[limits]\nfloor = 9.0", "no motion within the limits was found: workspace of link2"),
        ('[limits]\ntool = "hand"', 'limits.tool: link "hand" does not exist'),
    ],
)
def test_wrong_settings_are_named(
    text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "s.toml").write_text(text)
    arguments = ["design", "planar-2r", "--settings", str(tmp_path / "s.toml"), "--out", str(tmp_path / "o")]
    assert main(arguments) == 2
    assert words in capsys.readouterr().err and not (tmp_path / "o").exists()


@pytest.mark.parametrize(
    "call, words",
    [
        (lambda: design("planar-2r", parameters=["stifness"]), 'did you mean "stiffness"'),
        (lambda: design("planar-2r", separate=["backlash:joint1"]), "expected two different ones"),
        (
            lambda: design("planar-2r", separate=["external_contact:joint1", "backlash:joint1"]),
            "episode",
        ),
        (lambda: design("nothing-there"), "neither a preset nor a measurement set"),
    ],
)
def test_wrong_arguments_are_named(call: Callable[[], Design], words: str) -> None:
    with pytest.raises(InputError, match=words):
        call()


def test_a_tie_in_the_summary_names_the_command() -> None:
    found = ResultDocument(format=1, set="s", verdict="missing", candidates=(ENTRY,))
    line = found.summary().splitlines()[-1]
    options = "--separate coulomb_friction:joint2 --separate link_coulomb_friction:joint2"
    assert line.strip() == f"the motion that would decide: flexviz design SET {options} --out DIR"
