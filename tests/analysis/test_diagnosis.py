"""Diagnosis on sets with a hidden effect, and its parts."""

import json
import re
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from flexviz.analysis.diagnosis import Diagnosis, diagnose
from flexviz.analysis.diagnosis.candidates import candidates, with_effects, without_effects
from flexviz.analysis.motion import Known
from flexviz.base.progress import Progress
from flexviz.base.resources import sessions_dir
from flexviz.content.wording import quantity
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.effects import ChosenEffect
from flexviz.model.equation import Layout
from flexviz.outlets.terminal import main
from tests.cases import slow
from tests.planar_arm import HELD_OUT, planar_set
from tests.unknown_laws import Uneven, set_with

SHARED = Path(__file__).resolve().parents[3] / "shared"
CASES = SHARED / "practice" / "cases"


@cache
def practised(case: str) -> Diagnosis:
    return diagnose(read_set(CASES / case), apply=True)


def test_demo_lacks_coulomb_friction(diagnosed_demo: Diagnosis) -> None:
    truth = json.loads((sessions_dir() / "planar-2r-demo" / "truth.json").read_text())["effects"][0]
    assert diagnosed_demo.verdict == "missing"
    first = diagnosed_demo.findings[0]
    assert (first.effect, first.joint) == ("coulomb_friction", "joint2")
    found = first.parameters["coulomb"]
    assert found.unit == "Nm" and found.value == pytest.approx(
        truth["parameters"]["coulomb"]["value"]
        if isinstance(truth["parameters"]["coulomb"], dict)
        else truth["parameters"]["coulomb"],
        rel=0.01,
    )
    assert found.std < 0.01 * found.value
    assert diagnosed_demo.steps[-1].verdict == "nothing-missing"
    assert (
        diagnosed_demo.steps[0].rms_validation is not None
        and diagnosed_demo.steps[-1].rms_validation is not None
    )
    assert sum(diagnosed_demo.steps[-1].rms_validation) < 0.3 * sum(diagnosed_demo.steps[0].rms_validation)


def test_the_trace_says_why(demo: MeasurementSet, diagnosed_demo: Diagnosis) -> None:
    """What the search tried, with what each move gains and its error."""
    assert all(move.error >= 0 and move.resolution in ("coarse", "fine") for move in diagnosed_demo.trace)
    own = replace(demo, effects=("coulomb_friction:joint1",))
    for move in diagnose(own, apply=True).trace:
        assert bool(move.why) != move.accepted
        assert "coulomb_friction:joint1" not in move.removed  # the set's own effects stay


def test_json_is_the_contract(diagnosed_demo: Diagnosis) -> None:
    document = json.loads(json.dumps(diagnosed_demo.to_dict()))
    assert document["format"] == 1 and document["verdict"] == "missing"
    candidate = document["candidates"][0]
    assert set(candidate) == {
        "effect", "joint", "group", "payload", "score", "confidence", "parameters", "inseparable_from",
        "absorbed", "share", "family",  # beside the contract's keys
    }  # fmt: skip
    assert 0 <= candidate["score"] <= 1 and 0 <= candidate["confidence"] <= 1
    assert (
        document["steps"][0]["added"] is None
        and document["steps"][1]["added"]["effect"] == "coulomb_friction"
    )
    assert document["model"]["effects"][0]["effect"] == "coulomb_friction"
    assert {p["name"] for p in document["model"]["parameters"]} >= {"stiffness", "motor_inertia"}
    assert set(document["where"][0]) == {"joint", "variable", "explained", "range"}


def test_words(diagnosed_demo: Diagnosis) -> None:
    said = diagnosed_demo.summary().splitlines()
    assert said[0].startswith("Missing: Coulomb friction on joint2: > 99 % of the error")
    assert said[1].startswith("  1. Coulomb friction on joint2 (coulomb_friction): coulomb ")
    assert any("nothing-missing" in line for line in said)


def test_the_best_model_so_far_is_told_early_and_kept_by_a_stop(diagnosed_demo: Diagnosis) -> None:
    news: list[Progress] = []

    def said() -> list[str]:
        return list(dict.fromkeys(str(one.so_far.running) for one in news if one.so_far is not None))

    result = diagnose(
        read_set(sessions_dir() / "planar-2r-demo"),
        apply=True,
        progress=news.append,
        should_stop=lambda: len(said()) == 2,
    )
    own, fitted = said()
    friction = "Coulomb friction on joint2 (being checked):"
    found = re.fullmatch(
        f"so far: {re.escape(friction)} validation error ([\\d.]+) % → ([\\d.]+) % of the torque \\(.*Nm\\)",
        fitted,
    )
    present = re.match(r"so far: validation error of the present model ([\d.]+) % of the torque \(", own)
    # standstill is set apart in between, so that fewer samples count
    assert found and present and float(present[1]) == pytest.approx(float(found[1]), rel=0.05)
    # the error is the one that the finished diagnosis states
    for share, step in zip(found.groups(), diagnosed_demo.steps, strict=True):
        assert step.rms_validation is not None
        mean = 100 * np.mean(np.divide(step.rms_validation, diagnosed_demo.torque_spread))
        assert float(share) == pytest.approx(mean, rel=0.1)
    # what the search had found by then is kept
    assert result.stopped and [f.text for f in result.findings] == ["coulomb_friction:joint2"]
    shares = [one.share for one in news if one.share is not None]
    assert all(a <= b for a, b in pairwise(shares))


def test_stopped_at_once_nothing_is_found() -> None:
    result = diagnose(read_set(sessions_dir() / "planar-2r-demo"), apply=True, should_stop=lambda: True)
    assert result.stopped and len(result.steps) == 1 and not result.findings
    assert result.model is not None and not result.model.effects


@pytest.mark.parametrize(
    ("hidden", "place", "values"),
    [
        slow("torque_gain:joint2:gain_error=0.25", "torque_gain:joint2", {"gain_error": 0.25}),
        (
            "external_contact:joint2:group=t1p1:torque=8:start=2.2:end=3.1",
            "external_contact:joint2@t1p1",
            {"torque": 8.0, "start": 2.2, "end": 3.1},
        ),
        ("payload_error:p2:relative_mass_error=0.04", "payload_error:p2", {"relative_mass_error": 0.04}),
    ],
)
def test_one_hidden_effect(hidden: str, place: str, values: dict[str, float], tmp_path: Path) -> None:
    result = diagnose(planar_set(tmp_path / "set", (hidden,), 7, groups=HELD_OUT), apply=True, guard=False)
    (found,) = result.findings
    assert found.text == place and found.confidence > 0.9
    assert {name: p.value for name, p in found.parameters.items()} == pytest.approx(values, rel=0.02)
    assert [step.verdict for step in result.steps] == ["missing", "nothing-missing"]


@pytest.mark.slow
def test_what_only_resembles_an_effect_is_not_found(tmp_path: Path) -> None:
    """A spring that is softer at some angles is neither backlash nor a hardening one."""
    measurements, _ = set_with(lambda _: Uneven(1500.0, 0.4), 1, tmp_path / "set", 7)
    result = diagnose(measurements, apply=True)
    assert result.verdict == "unknown" and len(result.steps) == 1 and not result.findings
    (place,) = (note for note in result.notes if note.kind == "place")
    assert place.joints == ("joint2",) and place.values["side"] == "transmission"
    assert result.where[0].joint == "joint2"


def test_candidates_respect_what_goes_with_what():
    bare = Layout(("a", "b"))
    names = {(c.effect, c.joint) for c in candidates(bare, [])}
    assert ("coulomb_friction", 0) in names and ("stribeck_friction", 0) not in names
    assert ("torque_delay", None) in names and not any(n == "payload_error" for n, _ in names)
    coulomb = Layout(("a", "b"), (ChosenEffect("coulomb_friction", 1),))
    names = {(c.effect, c.joint) for c in candidates(coulomb, [])}
    assert ("stribeck_friction", 1) in names and ("coulomb_friction", 1) not in names


def test_adding_replaces_and_removing_undoes():
    layout = Layout(("a", "b"), (ChosenEffect("coulomb_friction", 1), ChosenEffect("torque_offset", 0)))
    x = np.arange(1.0, layout.size + 1)
    dahl = ChosenEffect("presliding_hysteresis", 1)
    added = with_effects(Known(layout, x), {dahl: np.array([50.0, 2.0])})
    larger, start = added.layout, added.x
    assert ChosenEffect("coulomb_friction", 1) not in larger.effects and dahl in larger.effects
    np.testing.assert_allclose(start[larger.effect_slices()[-1][1]], [50.0, 2.0])
    left = without_effects(added, [dahl])
    smaller, rest = left.layout, left.x
    assert smaller.effects == (ChosenEffect("torque_offset", 0),)
    np.testing.assert_allclose(rest[smaller.effect_start :], x[-1:])


@pytest.mark.skipif(not CASES.exists(), reason="the practice cases are not beside this checkout")
@pytest.mark.parametrize("case", ["2r-torque_gain", "2r-none-19"])
def test_practice(case):
    truth = json.loads((CASES.parent / "truth" / f"{case}.json").read_text())
    result = practised(case)
    if not truth["effects"]:
        assert result.verdict == "nothing-missing" and len(result.steps) == 1
        return
    wanted = truth["effects"][0]
    assert (result.findings[0].effect, result.findings[0].joint) == (wanted["effect"], wanted["joint"])
    for name, value in wanted["parameters"].items():
        assert result.findings[0].parameters[name].value == pytest.approx(value, rel=0.01)


@pytest.mark.slow
@pytest.mark.skipif(not CASES.exists(), reason="the practice cases are not beside this checkout")
def test_an_error_that_pulses_leave_is_explained():
    result = diagnose(read_set(CASES / "2r-backlash"), apply=True)
    error, floor = np.array(result.steps[-1].rms), np.array(result.steps[-1].noise_floor)
    assert result.steps[-1].verdict == "nothing-missing" and (error / floor).max() > 5
    (note,) = [note for note in result.notes if note.kind == "pulses"]
    assert quantity(error[(error / floor).argmax()], "Nm") in note.text
    clean = practised("2r-none-19")
    assert not any(note.kind == "pulses" for note in clean.notes)


def test_without_apply_the_terminal_says_how_to_add_what_is_missing(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["diagnose", str(sessions_dir() / "planar-2r-demo")]) == 0
    said = capsys.readouterr()
    assert "Missing: Coulomb friction on joint2" in said.out and "of the last model" not in said.out
    assert "model 0" in said.out and "mNm" in said.out
    assert said.err.splitlines()[-1].endswith("see how the error falls, use --apply")
