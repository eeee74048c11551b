"""The study of the diagnosis: its cases, its rules, its tables. Nothing is diagnosed here."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.diagnosis_study import document, robots, tables
from benchmarks.diagnosis_study.__main__ import main
from benchmarks.diagnosis_study.cases import TWINS, Case, cases, selected
from benchmarks.diagnosis_study.judging import Addition, judge, same, stated_confidence
from benchmarks.diagnosis_study.laws import EXTRA_LAWS, place
from benchmarks.diagnosis_study.making import make, plan_of
from benchmarks.diagnosis_study.oracle import final_model, true_model, with_hidden
from benchmarks.diagnosis_study.report import calibration_rows, value_rows
from benchmarks.diagnosis_study.sizes import SIZES
from benchmarks.running import case_folder, truth_file
from benchmarks.tables import Share
from flexviz.data.measurements import read_set
from flexviz.model.effects import EFFECTS, ChosenEffect, JointState
from flexviz.model.equation import Layout
from flexviz.model.simulation.effect_laws import LAWS


def hidden(effect: str, joint: str | None = "joint1", **parameters: float) -> dict[str, Any]:
    entry = {"effect": effect, "joint": joint, "parameters": parameters, "kind": effect, "payload": None}
    return entry | {"group": None, "size": 1.0, "natural": 2.0}


def truth(*effects: dict[str, Any], kind: str = "single", base: tuple[str, ...] = ()) -> dict[str, Any]:
    out = {
        "case": f"{kind}-2r-000",
        "kind": kind,
        "robot": "2r",
        "effects": list(effects),
        "base": list(base),
    }
    out |= {"stiffness": [1000.0, 1500.0], "motor_inertia": [2.0, 1.0]}
    return out | {"noise_scale": 1.0, "seed": 1, "joints": ["joint1", "joint2"], "torque_rms": [10.0, 5.0]}


def known(gain: float = 1e4, **parameters: float) -> dict[str, Any]:
    effects = [{"effect": "coulomb_friction", "joint": "joint1", "payload": None, "parameters": parameters}]
    return {"gain": gain, "gains": [gain], "effects": effects, "errors": [0.003, 0.004], "chi": [1.0, 0.9]}


def found(effect: str, joint: str | None = "joint1", *ties: str) -> dict[str, Any]:
    out = {
        "effect": effect,
        "joint": joint,
        "payload": None,
        "group": None,
        "score": 0.9,
        "confidence": SURE,
    }
    return out | {"inseparable_from": [{"effect": tie, "joint": joint, "correlation": 1.0} for tie in ties]}


def answer(
    verdict: str, *added: dict[str, Any], final: str = "", where: str = "joint1", **more: Any
) -> dict[str, Any]:
    steps = [{"added": None, "verdict": verdict}, *({"added": a, "verdict": "missing"} for a in added)]
    steps[-1]["verdict"] = final or ("nothing-missing" if added else verdict)
    effects = [a | {"parameters": {"coulomb": {"value": 2.02, "std": 0.01}}} for a in added]
    estimated = [
        {"name": "stiffness", "joint": "joint2", "value": 1530.0, "std": 10.0},
        {"name": "motor_inertia", "joint": "joint1", "value": 2.0, "std": 0.001},
        {"name": "viscous_friction_sum", "joint": "joint1", "value": 1.0, "std": 0.001},
    ]
    document = {
        "verdict": verdict, "steps": steps, "candidates": list(added[:1]),
        "model": {"effects": effects, "parameters": estimated},
        "where": [{"joint": where, "variable": "position"}],
    }  # fmt: skip
    spent = {"wall": 3.0, "cpu": 2.5, "errors": [0.003, 0.004]}
    return {"diagnosis": document} | spent | more


SURE = 0.92  # of what was found
COULOMB = hidden("coulomb_friction", coulomb=2.0)


def test_cases_are_many_and_different() -> None:
    every = cases()
    assert len({case.name for case in every}) == len(every)
    count = Counter((case.kind, case.robot == "2r") for case in every)
    assert count["single", True] >= 220 and count["single", False] >= 45
    assert sum(count["pair", planar] for planar in (True, False)) >= 40
    assert sum(count["clean", planar] for planar in (True, False)) >= 150
    assert sum(count["unknown", planar] for planar in (True, False)) >= 64
    # three have studies of their own: these sets state no temperatures, and their torques are not clipped
    tried = {name for name in LAWS if not EFFECTS[name].only_among_many} - {
        "temperature_friction",
        "driving_friction",
        "torque_limit",
    }
    assert {case.effects[0] for case in every if case.kind == "single"} == tried == set(SIZES)
    assert {case.extra_law for case in every if case.extra_law} == set(EXTRA_LAWS) and len(EXTRA_LAWS) >= 5
    assert {case.noise for case in every if case.effects == ("backlash",)} == {0.5, 1.0, 3.0}


def test_cases_keep_when_others_are_left_out() -> None:
    some = selected(1, "pair", of_each=2)
    assert [case.name for case in some] == [case.name for case in cases(1) if case in some] and len(some) == 6
    numbers = some[0].rng("robot").random(3)
    np.testing.assert_array_equal(numbers, some[0].rng("robot").random(3))
    assert not np.array_equal(numbers, some[1].rng("robot").random(3))


def test_pairs_can_be_told_apart() -> None:
    for case in cases(2):
        if case.kind == "pair":
            assert len(set(case.effects)) == 2 and frozenset(case.effects) not in TWINS
        if "stribeck_friction" in case.effects:
            assert "coulomb_friction" in (*case.base, *case.effects)
        assert not set(case.base) & set(case.effects)


def test_plans_are_of_the_kind_that_was_said() -> None:
    for case in (c for c in cases(3) if c.kind in ("single", "unknown") and c.name.split("-")[2] < "008"):
        plan, size = plan_of(case)
        held_out = [g for g in plan.groups if g.validation]
        fitted = [(g.trajectory, g.payload) for g in plan.groups if not g.validation]
        assert len(held_out) == 1 and (held_out[0].trajectory, held_out[0].payload) not in fitted
        assert held_out[0].trajectory in {t for t, _ in fitted} and held_out[0].payload in {
            p for _, p in fitted
        }
        masses = plan.model.inertial[:, 0] / plan.robot.cad_parameters[:, 0]
        assert np.abs(masses - 1.0).max() > 0.01 and (masses > 0.7).all() and (masses < 1.4).all()
        assert (size.torque > 0).all() and len(plan.laws) == (case.kind == "unknown")
        for effect in plan.model.effects:
            specs = EFFECTS[effect.effect].parameters
            assert all(p.lower <= effect.parameters[p.name] <= p.upper for p in specs)


@pytest.mark.parametrize("name", list(EXTRA_LAWS))
def test_extra_laws(name: str) -> None:
    """They pull back, and are smooth where they depend on velocity."""
    plan, size = plan_of(Case("x", "clean", "2r", (), "", (), 1.0, 4))
    law = EXTRA_LAWS[name](place(plan, 0, size, np.random.default_rng(0)))

    def pull(speed: float) -> np.ndarray:
        state = JointState(2.0, 0.31, speed, 0.30, speed, 4.0, (0.01,) * law.states)
        got = law.pull(state)
        assert len(got.rates) == law.states
        return np.array(got[:3])

    assert np.isfinite(pull(0.5)).all() and np.abs(pull(0.5)).max() > 0
    assert np.abs(pull(1e-7) - pull(-1e-7)).max() < 1e-2


def test_made_set_does_not_tell_its_truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robots, "DURATIONS", (2.0,))
    case = selected(1, "pair-2r", of_each=1)[0]
    make(tmp_path, case)
    folder = case_folder(tmp_path, case.name)
    text = (folder / "measurements.toml").read_text(encoding="utf-8")
    assert not any(effect in text for effect in case.effects)
    assert {path.name for path in folder.iterdir()} - {f"g{k}.parquet" for k in range(1, 5)} == {
        "measurements.toml", "robot.urdf",
    }  # fmt: skip
    measurements = read_set(folder)
    assert measurements.groups[0].q is None and measurements.groups[0].theta_ref is None
    written = json.loads(truth_file(tmp_path, case.name).read_text(encoding="utf-8"))
    assert [e["effect"] for e in written["effects"]] == list(case.effects)
    model = true_model(written)
    assert len(model.effects) == 2 + 2 * len(case.base) - (
        "presliding_hysteresis" in case.effects and "coulomb_friction" in case.base
    )
    first = measurements.groups[0].segments[0].theta
    make(tmp_path, case)
    np.testing.assert_array_equal(first, read_set(folder).groups[0].segments[0].theta)


def test_hidden_effects_in_a_layout() -> None:
    base = Layout(("a", "b"), (ChosenEffect("coulomb_friction", 0), ChosenEffect("coulomb_friction", 1)))
    layout = with_hidden(base, [ChosenEffect("presliding_hysteresis", 1)])
    assert [e.effect for e in layout.effects] == ["coulomb_friction", "presliding_hysteresis"]


def test_final_model_is_read_from_the_json() -> None:
    names = ("mass", "mx", "my", "mz", "ixx", "ixy", "iyy", "ixz", "iyz", "izz", "stiffness", "motor_inertia",
             "link_viscous_friction", "motor_viscous_friction")  # fmt: skip
    parameters = [
        {"name": n, "joint": j, "value": k + 0.5 * (j == "b")} for k, n in enumerate(names) for j in "ab"
    ]
    effects = [{"effect": "torque_offset", "joint": "b", "parameters": {"offset": {"value": 2.0}}}]
    model = final_model({"model": {"parameters": parameters, "effects": effects}}, ("a", "b"))
    np.testing.assert_array_equal(model.inertial[1], np.arange(10) + 0.5)
    assert model.stiffness.tolist() == [10.0, 10.5] and model.effects[0].parameters == {"offset": 2.0}


def test_twins_count_only_where_the_tie_is_reported() -> None:
    twin = hidden("link_coulomb_friction")
    assert same(found("coulomb_friction", "joint1", "link_coulomb_friction"), twin)
    assert not same(found("coulomb_friction", "joint1"), twin)
    assert not same(found("coulomb_friction", "joint2", "link_coulomb_friction"), twin)
    assert not same(found("cable_spring", "joint1", "torque_offset"), hidden("torque_offset"))


def test_where_members_of_a_family_tie_the_family_is_the_finding() -> None:
    family = {"name": "dry_friction", "tied": True, "confidence": 0.97,
              "members": ["coulomb_friction", "presliding_hysteresis"]}  # fmt: skip
    one = found("coulomb_friction", "joint1", "presliding_hysteresis") | {"family": family}
    assert same(one, hidden("presliding_hysteresis")) and not same(one, hidden("stribeck_friction"))
    assert stated_confidence(one) == 0.97 and stated_confidence(found("backlash")) == SURE
    loose = one | {"family": family | {"tied": False}, "inseparable_from": []}
    assert stated_confidence(loose) == SURE and not same(loose, hidden("presliding_hysteresis"))


def test_one_effect() -> None:
    case = tables.outcome(truth(COULOMB), known(coulomb=2.001), answer("missing", found("coulomb_friction")))
    said = case.said
    assert said.right and said.first_right and case.decidable and said.named == ("coulomb_friction", "joint1")
    values = {value.name: value for value in said.values}
    assert values["coulomb_friction.coulomb"].error == pytest.approx(0.01)
    assert values["coulomb_friction.coulomb"].covered is False  # two standard errors off
    assert [value.error for value in case.best] == [pytest.approx(0.0005)]
    assert values["2r joint 2: stiffness"].error == pytest.approx(0.02)
    assert values["2r joint 1: motor inertia"].error == 0.0 and values["2r joint 1: motor inertia"].covered
    assert len(values) == 3
    unexplained = answer("missing", found("coulomb_friction"), final="unknown")
    assert [value.name for value in judge(truth(COULOMB), unexplained).values] == ["coulomb_friction.coulomb"]
    assert case.held_out == pytest.approx(0.0)
    (addition,) = said.additions
    assert (addition.confidence, addition.right, addition.name) == (SURE, True, "coulomb_friction:joint1")


@pytest.mark.parametrize(
    "result",
    [
        answer("missing", found("coulomb_friction", "joint2")),
        answer("missing", found("torque_ripple")),
        answer("missing", found("coulomb_friction"), found("torque_ripple")),
        answer("missing", found("coulomb_friction"), final="unknown"),
        answer("nothing-missing"),
        answer("unknown"),
        {"error": "ValueError: no"},
    ],
)
def test_wrong_answers(result: dict[str, Any]) -> None:
    assert not judge(truth(COULOMB), result).right


def test_two_effects() -> None:
    both = truth(COULOMB, hidden("backlash", "joint2"), kind="pair")
    case = judge(both, answer("missing", found("backlash", "joint2"), found("coulomb_friction")))
    assert case.right and not case.missed and len(case.additions) == 2
    assert judge(both, answer("missing", found("backlash", "joint2"))).missed == ["coulomb_friction:joint1"]


def test_clean_and_unknown() -> None:
    clean = truth(kind="clean")
    assert judge(clean, answer("nothing-missing")).right
    assert not judge(clean, answer("missing", found("backlash"))).right
    foreign = truth(hidden("unknown", "joint2") | {"kind": "vibration"}, kind="unknown")
    assert judge(foreign, answer("unknown", where="joint2")).right
    assert judge(foreign, answer("missing", found("backlash"), final="unknown", where="joint2")).right
    assert not judge(foreign, answer("unknown", where="joint1")).right


def test_smallest_size_found() -> None:
    cases = [(float(k), float(k), k > 3) for k in range(1, 21)]
    assert tables.smallest(cases) == (4.0, 4.0)
    assert tables.smallest([*cases, (15.5, 15.5, False)]) == (4.0, 4.0)  # one in eighteen missed
    assert tables.smallest([(1.0, 1.0, False)]) is None


def test_calibration() -> None:
    stated = [(0.92, k % 10 != 0) for k in range(20)] + [(0.3, False), (1.0, True)]
    rows = calibration_rows(Addition("a", "a:1", p, right, False) for p, right in stated)
    cells = {row[0]: row[1:4] for row in rows}
    assert sum(int(row[1]) for row in rows[1:]) == 22
    assert cells["0.9 to 0.95"] == ["20", "0.920", "18/20 (90.0 %)"] and cells["0.95 to 1"][0] == "1"


def outcomes() -> list[tables.Outcome]:
    foreign = truth(hidden("unknown", "joint2") | {"kind": "vibration"}, kind="unknown")
    rows = [
        (truth(COULOMB), answer("missing", found("coulomb_friction"))),
        (truth(COULOMB), answer("missing", found("coulomb_friction", "joint2"))),
        (truth(kind="clean"), answer("nothing-missing")),
        (foreign, answer("unknown", where="joint2")),
    ]
    return [tables.outcome(t, known(coulomb=2.0), r) for t, r in rows]


def test_tables_and_page(tmp_path: Path) -> None:
    judged = outcomes()
    matrix = tables.confusion(judged)
    assert "1+1✗" in matrix[1]
    assert [row[0] for row in tables.wrong(judged)[1:]] == ["single-2r-000"]
    rows = {row[0]: row[1:] for row in value_rows([v for o in judged for v in o.said.values])}
    assert rows["coulomb_friction.coulomb"][-1] == "0/1 (0.0 %)"  # two standard errors off
    assert rows["2r joint 2: stiffness"] == ["3", "2 %", "2 %", "0/3 (0.0 %)"]
    table, passed = tables.figures(judged)
    got = {row[0]: row[1:] for row in table}
    assert got["2-DOF, one effect, first named right"][1] == "1/2 (50.0 %)"
    assert got["clean sets without a false alarm"][2] == "**fail**" and not passed  # too few
    page = tmp_path / "page.md"
    document.write(document.parts(judged), page)
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# What the diagnosis finds") and text.rstrip().endswith(document.TAIL)
    assert "| single-2r-000 |" in text and document.text(document.parts(judged))


def test_command_without_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["table", "--work", str(tmp_path), "--only", "clean-2r-000"]) == 1
    assert "0 of 1 cases have a result" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("hits", "count", "text"), [(48, 49, "48/49 (97.9 %)"), (7, 7, "7/7 (100.0 %)"), (0, 0, "–")]
)
def test_a_share_below_a_limit_does_not_look_like_it(hits: int, count: int, text: str) -> None:
    assert Share(hits, count).text == text
