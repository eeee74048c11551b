"""The studies of one model and one yardstick: their sets, changed recordings and figures."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import changed_recordings as changes
from benchmarks.changed_recordings import Recording
from benchmarks.one_truth import making, plans
from benchmarks.one_truth.__main__ import main
from benchmarks.one_truth.answers import added_effects
from benchmarks.one_truth.judging import printed_errors
from benchmarks.one_truth.making import Planned, make
from benchmarks.one_truth.plans import PLANS, make_study
from benchmarks.running import case_folder, made_cases, read, truth_file
from flexviz.data.measurements import GroupTable, read_set
from flexviz.model.equation import INERTIAL_NAMES

COUNTS = {"clean": 120, "two_effects": 50, "torque_scale": 70, "small": 40, "filters": 32}
RATE = 500.0  # [Hz]


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(making, "DURATION", 2.0)
    monkeypatch.setattr(plans, "ROBOTLIKE_DURATION", 2.0)


@pytest.mark.parametrize("study", PLANS)
def test_the_sets_of_a_study_can_be_read(study: str, tmp_path: Path) -> None:
    sets = list(PLANS[study](3))
    assert len(sets) == len({one.name for one in sets}) == COUNTS[study]
    apart = study in ("clean", "small")  # so that both simulators have their turn
    one = next(s for s in sets if s.robot == "2r" and s.apart == apart and (s.wanted or study == "clean"))
    make(tmp_path, one)
    measurements = read_set(case_folder(tmp_path, one.name))
    truth = read(truth_file(tmp_path, one.name))
    assert measurements.n == 2 and len(measurements.validation_groups) == 1
    assert (measurements.initial_stiffness is None) == (not one.initial)
    assert truth["wanted"] == list(one.wanted) and truth["case"] == one.name
    assert {e["effect"] for e in truth["effects"]} >= {*one.hidden, *one.wanted}


def test_robotlike_and_worn_sets(tmp_path: Path) -> None:
    assert make_study("plain_guess", tmp_path, 3, 1, "2r-000") == 0
    (name,) = made_cases(tmp_path / "plain_guess")
    assert read_set(case_folder(tmp_path / "plain_guess", name)).n == 2
    worn = [one for one in PLANS["two_effects"](3) if one.robot == "worn"]
    assert len(worn) == 10 and len({one.seed for one in worn}) == 10


def test_what_is_not_stated_is_a_delay(tmp_path: Path) -> None:
    make(tmp_path, Planned("a", 1, "2r", changes=(lambda one: changes.thinned(one, 10),), hold=False))
    measurements = read_set(case_folder(tmp_path, "a"))
    assert measurements.torque_hold == 0.0 and len(measurements.groups[0].time) == 200
    (delay,) = read(truth_file(tmp_path, "a"))["effects"]
    assert delay["effect"] == "torque_delay" and delay["parameters"] == {"delay": 0.00025}


def recording() -> Recording:
    time = np.arange(0.0, 8.0, 1 / RATE)
    theta = np.stack([np.sin(2 * time), np.cos(1.5 * time)], axis=1)
    groups = (GroupTable("g1", "t1", "p1", time, theta, 10.0 * np.roll(theta, 1, axis=1)),)
    return Recording(("a", "b"), groups, ())


def test_changes_of_one_torque() -> None:
    one, (group,) = recording(), recording().groups
    for changed in (
        changes.scaled(one, 1, 0.25),
        changes.late(one, 1, 0.01),
        changes.clipped(one, 1, 0.7, 0.0),
    ):
        np.testing.assert_array_equal(changed.groups[0].tau[:, 0], group.tau[:, 0])
        np.testing.assert_array_equal(changed.groups[0].theta, group.theta)
    tau = changes.scaled(one, 1, 0.25).groups[0].tau
    np.testing.assert_allclose(1.25 * tau[:, 1], group.tau[:, 1])  # what acts is more than what is recorded
    late = changes.late(one, 1, 0.01)
    np.testing.assert_allclose(late.groups[0].tau[5:, 1], group.tau[:-5, 1], atol=1e-9)
    assert late.hidden[0]["parameters"] == {"delay": -0.01} and late.hidden[0]["joint"] == "b"
    clipped = changes.clipped(one, 1, 0.7, 0.0)
    limit = clipped.hidden[0]["parameters"]["limit"]
    assert limit == pytest.approx(0.7 * np.abs(group.tau[:, 1]).max())
    assert np.abs(clipped.groups[0].tau[:, 1]).max() == limit
    small = changes.unmodelled(one, 0, 0.01, "rough_spot").groups[0].tau - group.tau
    assert np.sqrt(np.mean(small[:, 0] ** 2)) == pytest.approx(0.01 * group.tau[:, 0].std())


def test_changes_of_all_signals() -> None:
    one, (group,) = recording(), recording().groups
    causal = changes.low_passed(one, 20.0, True, True)
    lag = causal.hidden[0]["parameters"]["delay"]
    late = np.interp(group.time + lag, group.time, group.tau[:, 0])
    np.testing.assert_allclose(causal.groups[0].tau[500:, 0], late[500:], atol=0.02)
    np.testing.assert_array_equal(causal.groups[0].theta, group.theta)
    both = changes.low_passed(one, 20.0, False, False)
    assert not both.hidden and not np.array_equal(both.groups[0].theta, group.theta)
    np.testing.assert_allclose(both.groups[0].tau[500:-500], group.tau[500:-500], atol=0.02)
    assert len(np.unique(changes.rounded(one, 6).groups[0].theta[:, 0])) <= 22
    assert len(changes.thinned(one, 4).groups[0].time) == 1000


PRINTED = """
 error of the held-out groups [% of the torque]  joint1  joint2  mean  verdict
 ─────────────────────────────────────────────────────────────────────────────
 present model                                     8.70    5.30  7.00  missing
 + Backlash on joint1                             9.20    4.10  6.60  unknown

 error of the last model [Nm]                     1.69   0.800
"""


def test_printed_errors() -> None:
    assert printed_errors(PRINTED, 2) == [(0, [8.7, 5.3]), (1, [9.2, 4.1])]
    assert [n for n, _ in printed_errors(PRINTED.replace("joint1 ", "joints 1, 2 and 3  "), 2)] == [0, 3]
    assert printed_errors("nothing", 2) == []


FAKE = """
import json, pathlib, sys
case, options = pathlib.Path(sys.argv[2]), sys.argv[3:-2]
here = pathlib.Path(__file__).parent
document = json.loads((here / "answer.json").read_text())
if sys.argv[1] == "diagnose":
    print((here / "printed").read_text())
else:
    document = {"parameters": document["model"]["parameters"]}
with open(here / "calls", "a") as calls:
    calls.write(" ".join([sys.argv[1], *options]) + "\\n")
pathlib.Path(sys.argv[-1]).write_text(json.dumps(document))
"""


def answer(truth: dict[str, Any], folder: Path) -> None:
    """The files of a command that finds the truth, and a backlash too many; its steps fall in Nm."""
    names = {"stiffness": "stiffness", "motor_inertia": "motor_inertia"}
    names |= {"link_viscous_friction": "viscous_link", "motor_viscous_friction": "viscous_motor"}
    columns = {name: truth[key] for name, key in names.items()}
    columns |= dict(zip(INERTIAL_NAMES, np.array(truth["inertial"]).T.tolist(), strict=True))
    parameters = [
        {"name": name, "joint": joint, "value": values[k], "std": 1.0, "identifiable": "yes"}
        for name, values in columns.items()
        for k, joint in enumerate(truth["joints"])
    ]
    parameters.append({"name": "backlash.half_width", "joint": "joint1", "value": 1e-6, "std": 1e-6,
                       "identifiable": "no"})  # fmt: skip
    added = {"effect": "backlash", "joint": "joint1", "group": None, "payload": None, "confidence": 0.9}
    model = {"effects": [added | {"parameters": {"half_width": {"value": 1e-6, "std": 1e-6}}}]}
    steps = [
        {"added": which, "rms": errors, "rms_validation": errors, "verdict": "missing"}
        for which, errors in ((None, [2.0, 1.0]), (added, [1.5, 0.8]))
    ]
    document = {"verdict": "missing", "candidates": [added], "steps": steps}
    document |= {"model": model | {"parameters": parameters}}
    (folder / "answer.json").write_text(json.dumps(document))
    (folder / "printed").write_text(PRINTED)
    (folder / "fake.py").write_text(FAKE)


def test_run_and_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clean = next(one for one in PLANS["clean"](3) if one.robot == "2r" and not one.apart)
    make(tmp_path / "clean", clean)
    make(tmp_path / "plain_guess", replace(clean, name="rl3-2r-000"))
    answer(read(truth_file(tmp_path / "plain_guess", "rl3-2r-000")), tmp_path)
    command = ["--work", str(tmp_path), "--command", f"it={sys.executable} {tmp_path / 'fake.py'}"]
    for _ in range(2):
        assert main(["run", "all", *command]) == 0
    calls = (tmp_path / "calls").read_text().splitlines()
    assert sorted(calls) == sorted([
        *["diagnose --apply"] * 2,  # each set once, for all studies
        *(f"identify {' '.join(f'--effect {e}' for e in effects)}" for effects in (
            ["coulomb_friction"], ["coulomb_friction", "torque_offset"],
            ["coulomb_friction", "torque_offset", "load_dependent_friction"], ["backlash:joint1"],
        )),
    ])  # fmt: skip
    assert main(["report", "all", *command]) == 1
    printed = capsys.readouterr().out
    assert "no worse than 1.02 × the best guess: 1/1 (100.0 %), required 100 %" in printed
    assert "errors within 2 %: 1/1" in printed and "difference in standard errors: at most 0" in printed
    assert "clean: no effect but a delay: 0/1 (0.0 %), required 100 %: MISSED" in printed
    assert "no printed error rises where that in Nm falls: 0/2 (0.0 %), required 100 %: MISSED" in printed
    assert "right among those stated about .9: 0/2" in printed
    assert main(["report", "nothing", *command]) == 2


def test_effects_of_a_model_that_the_set_lacks(tmp_path: Path) -> None:
    (tmp_path / "measurements.toml").write_text('[model]\neffects = ["coulomb_friction"]\n')
    found = [{"effect": "external_contact", "joint": "a", "group": "g2"}, {"effect": "torque_delay"}]
    texts = added_effects(
        tmp_path, ["coulomb_friction", "torque_offset", *found, {"effect": "payload_error", "payload": "p"}]
    )
    assert texts == ["torque_offset", "external_contact:a@g2", "torque_delay", "payload_error:p"]
