"""The measuring stick and the counting of constants, on made-up results and sources. Nothing is diagnosed."""

from __future__ import annotations

import ast
import json
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import changed_constant, constant_worth, constants, filtered_logs, servo_joint
from benchmarks.diagnosis_study.judging import Judgement, judge
from benchmarks.filtered_logs import FILTERS
from benchmarks.measuring_stick.__main__ import main, named_command
from benchmarks.measuring_stick.report import report, stated_share
from benchmarks.measuring_stick.sets import CLASSES, MANY, find_sets
from benchmarks.robotlike_study.cases import RobotCase
from benchmarks.robotlike_study.making import write_case
from benchmarks.running import read, result_file
from flexviz.data.measurements import read_set

Json = dict[str, Any]

COULOMB = {"effect": "coulomb_friction", "joint": "joint1", "parameters": {"coulomb": 2.0}, "payload": None}
RIPPLE = {"effect": "torque_ripple", "joint": "joint2", "payload": None,
          "parameters": {"amplitude": 0.5, "phase": 1.0}}  # fmt: skip
BUMP = {"effect": "unknown", "joint": "joint2", "parameters": {}, "kind": "friction_bump"}


def added(effect: str, joint: str, confidence: float = 0.95, **values: float) -> Json:
    parameters = {k: {"value": v, "std": 0.1, "unit": ""} for k, v in values.items()}
    return {"effect": effect, "joint": joint, "parameters": parameters, "confidence": confidence}


def result(verdict: str, *effects: Json, last: str = "nothing-missing", cpu: float = 2.0) -> Json:
    steps: list[Json] = [{"added": None, "rms_validation": [3.0, 4.0], "verdict": verdict}]
    steps += [{"added": e, "rms_validation": [0.3, 0.4], "verdict": last} for e in effects]
    got: Json = {"verdict": verdict, "candidates": list(effects), "steps": steps, "where": [{}]}
    got |= {"model": {"effects": list(effects)}, "torque": {"spread": [3.0, 2.0]}}
    got["where"] = [{"joint": "joint2", "variable": "position"}]
    return {"exit": 0, "wall": 3.0, "cpu": cpu, "peak_mb": 300.0, "diagnosis": got}


def judged(kind: str, hidden: list[Json], got: Json, **more: Any) -> Judgement:
    truth = {"case": "a", "robot": "2r", "base": [], "effects": hidden} | more
    return judge(truth, got, CLASSES[kind] == MANY)


def test_few_effects() -> None:
    both = [COULOMB, RIPPLE]
    right = [
        added("coulomb_friction", "joint1", coulomb=2.1),
        added("torque_ripple", "joint2", amplitude=-0.5),
    ]
    good = judged("pair", both, result("missing", *right))
    assert good.right and good.verdict_right and good.first_right and not good.missed
    assert good.effect_errors == pytest.approx([0.05, 0.0]) and good.held_out == pytest.approx(0.1)
    assert [(a.confidence, a.right) for a in good.additions] == [(0.95, True)] * 2 and good.peak == 300.0
    wrong = judged("pair", both, result("missing", added("backlash", "joint1"), *right[:1]))
    assert wrong.missed == ["torque_ripple:joint2"] and wrong.false == ["backlash:joint1"]
    assert wrong.right is False and wrong.first_right is False and wrong.verdict_right
    weak = judged("pair", both, result("nothing-missing"), weak=True)
    assert not weak.must and not weak.asked and good.asked
    lost = judged("pair", both, {"error": "no answer in 5 s", "cpu": 5, "wall": 5, "peak_mb": 1})
    assert lost.error and len(lost.missed) == 2 and lost.right is False and lost.held_out is None


def test_clean_and_unknown() -> None:
    clean = judged("clean", [], result("nothing-missing"))
    assert clean.right and clean.verdict_right and not clean.must
    alarm = judged("clean", [], result("missing", added("backlash", "joint1")))
    assert alarm.right is False and alarm.false == ["backlash:joint1"] and not alarm.verdict_right
    got = result("missing", added("backlash", "joint2"), last="unknown")
    found = judged("unknown", [BUMP], got)
    assert found.right and found.verdict_right and not found.false and found.imitations == ["backlash:joint2"]
    assert [(a.confidence, a.right) for a in found.additions] == [(0.95, False)]


def test_many_effects() -> None:
    hidden = [e | {"share": share} for e, share in ((COULOMB, 0.2), (RIPPLE, 0.02))]
    good = judged("filtered", hidden, result("missing", added("link_coulomb_friction", "joint1")))
    assert good.must == ["coulomb_friction:joint1"] and good.right and good.first_right
    wrong = judged("filtered", hidden, result("missing", added("torque_gain", "joint1"), last="unknown"))
    assert wrong.false == ["torque_gain:joint1"] and not wrong.verdict_right and wrong.right is False


def test_sets_and_report(tmp_path: Path) -> None:
    names = ("single-2r-000-a", "single-ur5-000-b", "clean-2r-000-plain")
    folder = tmp_path / "fresh-7" / "diagnosis"
    (folder / "truth").mkdir(parents=True)
    for name in (*names, "pair-2r-000-half-made"):
        effects = [] if "clean" in name else [COULOMB]
        (folder / "truth" / f"{name}.json").write_text(
            json.dumps({"case": name, "robot": "2r", "base": [], "effects": effects})
        )
    for name in names:
        (folder / "cases" / name).mkdir(parents=True)
    (tmp_path / "given" / "real" / "arm" / "a0").mkdir(parents=True)
    (tmp_path / "given" / "real" / "arm" / "a0" / "measurements.toml").touch()
    sets = find_sets(tmp_path, tmp_path / "given")
    assert [one.kind for one in sets] == ["planar-single", "arms-single", "clean", "real"]
    assert sets[-1].key == "real/arm-a0"
    assert [s.key for s in find_sets(tmp_path, classes=("clean",))] == [f"fresh-7/diagnosis/{names[2]}"]
    friction = result("missing", added("coulomb_friction", "joint1", coulomb=2.0))
    nothing = result("nothing-missing", cpu=1.0)
    for label, answers in (("old", (friction, friction, nothing)), ("new", (friction, nothing, nothing))):
        for one, answer in zip(sets, answers, strict=False):
            path = tmp_path / "results" / label / f"{one.key}.json"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(answer))
    text = report(tmp_path, sets[:-1], ["old", "new"])
    cells = {
        tuple(c.strip() for c in line.split("|")[1:3]): line for line in text.splitlines() if "|" in line
    }
    assert (
        "| 1/1 | 0 | 1/1 | 1/1 | 1/1 | 0.1 | 0, 0 | 1/1 | 2 | 2 | 1.00 | 300 |" in cells["arms-single", "old"]
    )
    assert "| 0/1 | 0 | 0/1 | 0/1 | 0/1 | 1 | – | – | 1 | 1 | 0.50 | 300 |" in cells["arms-single", "new"]
    assert "| 1.00 |" in cells["clean", "new"] and "| 2/3 |" not in cells["clean", "new"]
    assert "fresh-7/diagnosis/single-ur5-000-b (worse)" in text and text.count("(worse)") == 1
    assert stated_share(friction["diagnosis"]) == pytest.approx([0.1, 0.2])


FAKE = """
import json, os, pathlib, sys
assert sys.argv[2] == "diagnose" and sys.argv[4:6] == ["--apply", "--json"] and "PYTHONPATH" not in os.environ
document = {"verdict": sys.argv[1], "candidates": [], "steps": [], "model": {"effects": []}}
pathlib.Path(sys.argv[6]).write_text(json.dumps(document))
with open(pathlib.Path(sys.argv[3]).parent / "calls", "a") as calls:
    calls.write(sys.argv[1])
"""


def test_two_commands_take_turns_and_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "another/version")
    fake = tmp_path / "fake.py"
    fake.write_text(FAKE)
    folder = tmp_path / "fresh-1" / "robotlike"
    (folder / "truth").mkdir(parents=True)
    for name in ("x", "y"):
        (folder / "truth" / f"{name}.json").write_text("{}")
        (folder / "cases" / name).mkdir(parents=True)
    commands = [f"--command={letter}={sys.executable} {fake} {letter}" for letter in "ab"]
    for _ in range(2):
        assert main(["run", "--work", str(tmp_path), *commands]) == 0
    assert (folder / "cases" / "calls").read_text() == "abba"
    kept = read(result_file(tmp_path / "results" / "a", "fresh-1/robotlike/x"))
    assert kept["diagnosis"]["verdict"] == "a" and kept["cpu"] > 0
    assert named_command("a=b c") == ("a", ("b", "c"))
    with pytest.raises(Exception, match="NAME=CMD"):
        named_command("flexviz")


@pytest.mark.parametrize("name, left", [("butterworth", 0.5), ("low-pass", 0.5**0.5), ("average", 0.5**0.5)])
def test_filters_leave_what_they_say(name: str, left: float) -> None:
    rate, hertz = 500.0, 10.0
    time = np.arange(0.0, 4.0, 1 / rate)
    wave = 3.0 + np.sin(2 * np.pi * hertz * time)[:, None] * np.array([1.0, 2.0])
    out = FILTERS[name](wave, rate, hertz)[500:-500] - 3.0
    assert out.shape == (len(time) - 1000, 2)
    np.testing.assert_allclose(np.ptp(out, axis=0) / 2, left * np.array([1.0, 2.0]), rtol=0.02)
    still = FILTERS[name](np.full((300, 1), 7.0), rate, hertz)
    np.testing.assert_allclose(still, 7.0, rtol=1e-9)


def test_filtered_and_servo_sets(tmp_path: Path) -> None:
    case = RobotCase("servo-scale", "servo", 5, 3.0)
    plan = servo_joint.plan_of(case, "scale")
    filtered = filtered_logs.Filtered(case, "low-pass", 15.0, plan)
    write_case(tmp_path, case, plan, logged=filtered.logged)
    write_case(tmp_path, replace(case, name="plain"), plan)
    truth = json.loads((tmp_path / "truth" / "plain.json").read_text())
    assert {e["effect"] for e in truth["effects"]} == {
        "torque_gain", "coulomb_friction", "load_dependent_friction",
    }  # fmt: skip
    gain = next(e for e in truth["effects"] if e["effect"] == "torque_gain")
    smooth, plain = (read_set(tmp_path / "cases" / name) for name in ("servo-scale", "plain"))
    tau = next(g for g in plain.groups if g.validation).segments[0].tau[:, 0]
    assert gain["share"] == pytest.approx(0.375 * np.sqrt(np.mean(tau**2)) / tau.std(), rel=0.02)
    rough = [np.abs(np.diff(m.groups[0].segments[0].theta, 2, axis=0)).mean() for m in (smooth, plain)]
    assert rough[0] < 0.2 * rough[1]


SOURCE = """
from dataclasses import dataclass
HERTZ, NAME = 5.0, "five"
EDGE = 1 / HERTZ
SHARES = {"a": 0.1, "b": 0.2}
PAIRS: tuple[float, ...] = (1.0, -2.0)
LIMITS = THRESHOLDS.search
Size = float | int
KINDS = ("a", "b")

@dataclass(frozen=True)
class SearchThresholds:
    rounds: int = 5
    shares: tuple[float, ...] = (0.1, 0.2)
    on: bool = True

class Kind(IntEnum):
    ONE = 1

def search(step=0.5, *, name="x", most=3):
    return 7
"""


def test_constants_of_a_source(tmp_path: Path) -> None:
    folder = tmp_path / "flexviz" / "analysis" / "diagnosis"
    folder.mkdir(parents=True)
    (folder / "a.py").write_text(SOURCE)
    (folder.parents[1] / "b.py").write_text("A = 1\n")
    found = list(constants.module_constants(ast.parse(SOURCE), False))
    names = {kind: [name for k, name, _ in found if k == kind] for kind, _, _ in found}
    assert names == {
        "constant": ["HERTZ", "EDGE", "SHARES", "PAIRS"],
        "threshold": ["SearchThresholds.rounds", "SearchThresholds.shares"],
        "default": ["search(step)", "search(most)"],
    }
    text = constants.report(tmp_path)
    assert "flexviz/analysis/diagnosis/a.py:3: constant HERTZ = 5.0" in text
    assert (
        "flexviz: 22 lines in 2 files" in text and "flexviz/analysis/diagnosis: 21 lines in 1 files" in text
    )
    assert "6 numeric constants: 2 thresholds and 4 of modules; besides, 2 numbers as defaults" in text


@dataclass(frozen=True)
class Inner:
    share: float = 0.3
    on: bool = True


@dataclass(frozen=True)
class Outer:
    inner: Inner
    rounds: int = 1
    text: str = ""


def test_changed_constants() -> None:
    outer = Outer(Inner())
    found = list(changed_constant.fields(outer))
    assert [(path, name) for path, _, name in found] == [("inner.share", "share"), ("rounds", "rounds")]
    assert changed_constant.changed(0.3, 0.5) == 0.15
    assert [changed_constant.changed(n, 0.5) for n in (1, 5)] == [1, 2]
    said = {"verdict": "missing", "last": "unknown", "effects": ["a:1", "b:1"]}
    other = said | {"last": "nothing-missing", "effects": ["a:1", "c:2"]}
    lines = constant_worth.differences({"x/one": said, "x/two": said}, {"x/one": said, "x/two": other})
    assert lines == ["two: + c:2, − b:1, last unknown → nothing-missing"]
