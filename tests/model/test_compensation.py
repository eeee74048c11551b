"""Compensation: tables against closed forms, in the simulator's loop, and what a second recording says."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexviz.base.errors import InputError
from flexviz.content.comparing import compare_friction
from flexviz.content.session import is_session
from flexviz.data.measurements import read_set
from flexviz.model.compensation import (
    FrictionTable,
    deflection,
    elasticity_text,
    friction_table,
    read_friction_table,
    sliding_friction,
)
from flexviz.model.effects import EFFECT_FAMILIES
from flexviz.model.simulation import make_plan, simulate_plan, write_plan
from flexviz.outlets.terminal import main
from flexviz.robot.model import EffectValue, FlexibleModel
from tests.planar_arm import of_groups, shorten_presets

FRICTION = (
    EffectValue("coulomb_friction", "joint1", {"coulomb": 2.5}),
    EffectValue("stribeck_friction", "joint1", {"stribeck": 1.0, "velocity": 0.1}),
    EffectValue("driving_friction", "joint1", {"motor_driving": 0.04, "load_driving": 0.07}),
    EffectValue("link_coulomb_friction", "joint2", {"coulomb": 0.6}),
    EffectValue("presliding_hysteresis", "joint2", {"presliding_stiffness": 300.0, "coulomb": 1.5}),
    EffectValue("quadratic_friction", "joint2", {"quadratic": 0.2}),
    EffectValue("directional_friction", "joint2", {"directional": 0.1}),
    EffectValue("thinning_friction", "joint2", {"thinning": 0.4, "velocity": 0.2}),
    EffectValue("load_dependent_friction", "joint2", {"coefficient": 0.05}),
    EffectValue("stiffness_hardening", "joint2", {"cubic_stiffness": 4e6}),
    EffectValue("backlash", "joint2", {"half_width": 1e-3}),
    EffectValue("torque_ripple", "joint2", {"amplitude": 0.3, "order": 9.0, "phase": 0.0}),
)
CHECKED = {one.effect for one in FRICTION} - {"torque_ripple"}  # in the tables
MODEL = FlexibleModel(
    ("joint1", "joint2"), np.array([2000.0, 1500.0]), np.ones(2), np.array([0.4, 0.3]), np.array([0.6, 0.2]),
    np.zeros((2, 10)), FRICTION,
)  # fmt: skip
HIDDEN = ("coulomb_friction:joint1:coulomb=2.5", "load_dependent_friction:joint1:coefficient=0.05")
DRY = "coulomb_friction:joint2:coulomb="


def by_hand(v: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Friction of both joints (N, 2) while they slide, from the laws as a textbook has them."""
    sign = np.tanh(v / 0.005)
    share = np.where(load * v > 0, 0.04, 0.07)
    first = v + (2.5 + np.exp(-((v / 0.1) ** 2))) * sign + share * np.abs(load) * sign
    second = 0.5 * v + (2.1 + 0.05 * np.abs(load)) * sign
    second += 0.2 * v * np.abs(v) + 0.1 * np.abs(v) + 0.4 * np.arcsinh(v / 0.2)
    return np.stack((first, second), axis=-1)


def test_friction_and_its_table_are_those_of_the_laws(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    v, load = rng.uniform(-2, 2, 500), rng.uniform(-40, 40, 500)
    for j in range(2):
        np.testing.assert_allclose(sliding_friction(MODEL, j, v, load), by_hand(v, load)[:, j], rtol=1e-12)
    file = tmp_path / "friction.csv"
    file.write_text(friction_table(MODEL, np.array([2.0, 2.0])).text)
    table = read_friction_table(file, MODEL.joints)
    both = np.stack((v, v), axis=1), np.stack((load, load), axis=1)
    np.testing.assert_allclose(table.torque(*both), by_hand(v, load), atol=0.02)
    still = table.torque(np.zeros(2), np.array([30.0, 30.0]))
    np.testing.assert_allclose(still, 0.0, atol=1e-12)  # a joint at rest is not pushed


def test_deflection_inverts_the_spring() -> None:
    x = np.linspace(-0.02, 0.02, 41)
    torque = 1500 * x + 4e6 * x**3
    found = deflection(MODEL, 1, torque)
    np.testing.assert_allclose(found, x + 1e-3 * np.sign(x), atol=1e-6)
    rows = list(csv.DictReader(elasticity_text(MODEL, np.array([10.0, 20.0])).splitlines()))
    first = [(float(r["torque"]), float(r["deflection"])) for r in rows if r["joint"] == "joint1"]
    assert first[0][0] == -10.0 and first[-1] == (10.0, pytest.approx(10.0 / 2000.0))


@pytest.mark.parametrize(
    "text, says",
    [
        ("joint,speed\n", "found the columns joint, speed, expected joint, velocity, friction"),
        ("{head}joint3,0,0,0,0\n", 'row 2, column joint: joint "joint3" is not in the set'),
        ("{head}joint1,0,x,0,0\n", 'row 2, column friction: found "x", expected a finite number'),
        ("{head}joint1,0,nan,0,0\n", 'found "nan", expected a finite number'),
        (
            "{head}joint1,0,0,0,0\njoint1,0,0,0,0\n",
            "row 3, column velocity: found 0 after 0",
        ),
        ("{head}joint1,0,0\n", "row 2: 3 cells, expected 5"),
        ("{head}", "has no rows"),
    ],
)
def test_wrong_tables_are_refused(text: str, says: str, tmp_path: Path) -> None:
    file = tmp_path / "friction.csv"
    file.write_text(text.format(head="joint,velocity,friction,per_load_driving,per_load_driven\n"))
    with pytest.raises(InputError) as refused:
        read_friction_table(file, MODEL.joints)
    assert says in str(refused.value)


def test_compensation_acts_on_the_motor_and_is_not_recorded() -> None:
    """From the true motion: the friction left, and the equation of the motors."""
    plan = of_groups(make_plan("planar-2r", [*HIDDEN, f"{DRY}1.5"]), ("t1p1",), 4.0)
    table = friction_table(plan.model, np.array([3.0, 3.0]))
    run = simulate_plan(replace(plan, compensation=table))["t1p1"]
    plain = simulate_plan(plan)["t1p1"]
    v, load = run.theta_velocity, run.tau_joint
    true = np.stack([sliding_friction(plan.model, j, v[:, j], load[:, j]) for j in range(2)], axis=1)
    wanted = plan.groups[0].reference.sample(run.time)[1]
    left = true - table.torque(wanted, run.tau)
    removed = 1 - np.sqrt(np.mean(left**2, axis=0) / np.mean(true**2, axis=0))
    assert np.all(removed > 0.8)
    # τ + compensation = B θ̈ + friction + τ_j, with the viscous friction of the motor alone
    acceleration = np.gradient(v, run.time, axis=0)
    link = plan.model.link_viscous_friction * v
    needed = plan.model.motor_inertia * acceleration + true - link + load
    inside = slice(200, -200)
    error = np.sqrt(np.mean((run.tau + table.torque(wanted, run.tau) - needed)[inside] ** 2, axis=0))
    assert np.all(error < 0.1 * np.sqrt(np.mean(true**2, axis=0)))
    assert np.all(np.std(run.tau - plain.tau, axis=0) > 0.5 * np.std(true, axis=0))


def test_removed_by_speed_is_that_of_the_models(tmp_path: Path) -> None:
    plan = of_groups(make_plan("planar-2r", [f"{DRY}2"]), ("t1p1",), 3.0)
    measurements = read_set(write_plan(plan, simulate_plan(plan), tmp_path / "set"))
    before = replace(plan.model, link_viscous_friction=np.zeros(2), motor_viscous_friction=np.zeros(2))
    after = replace(before, effects=(EffectValue("coulomb_friction", "joint2", {"coulomb": 0.5}),))
    first, second = compare_friction(measurements, before, after)
    assert (first.before, first.removed) == (0.0, 0.0)
    assert second.removed == pytest.approx(0.75, abs=1e-9) and len(second.speeds) == 5
    assert all(one.removed == pytest.approx(0.75) for one in second.speeds)
    assert second.speeds[-1].before == pytest.approx(2.0) and second.speeds[-1].after == pytest.approx(0.5)
    assert "joint2: 75 % of the friction torque removed" in second.text
    with pytest.raises(InputError, match="expected the same robot"):
        compare_friction(measurements, before, replace(after, joints=("a", "b")))


def test_a_joint_without_rows_is_not_compensated(tmp_path: Path) -> None:
    file = tmp_path / "friction.csv"
    file.write_text(
        "joint,velocity,friction,per_load_driving,per_load_driven\njoint2,0,0,0,0\njoint2,1,3,0,0\n"
    )
    table = read_friction_table(file, MODEL.joints)
    assert isinstance(table, FrictionTable)
    np.testing.assert_allclose(table.torque(np.array([0.5, 0.5]), np.ones(2)), [0.0, 1.5])
    np.testing.assert_allclose(table.torque(np.array([9.0, 9.0]), np.ones(2)), [0.0, 3.0])  # held at the end


@pytest.mark.slow
def test_compensate_record_compare(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Commands only; in the second recording the friction of joint 2 has grown by 0.4 Nm."""
    shorten_presets(monkeypatch)
    a, b, out = tmp_path / "a", tmp_path / "b", tmp_path / "out.json"
    hidden = [word for text in HIDDEN for word in ("--effect", text)]
    assert (
        main(["simulate", "planar-2r", *hidden, "--effect", f"{DRY}1.5", "--seed", "1", "--out", str(a)]) == 0
    )
    assert main(["diagnose", str(a), "--apply", "--json", str(tmp_path / "a.json")]) == 0
    table = ["--result", str(tmp_path / "a.json"), "--to", "table", "--out", str(tmp_path / "x")]
    assert main(["export", str(a), *table]) == 0
    again = ["--compensate", str(tmp_path / "x" / "friction.csv"), "--seed", "2", "--out", str(b)]
    assert main(["simulate", "planar-2r", *hidden, "--effect", f"{DRY}1.9", *again]) == 0
    assert not is_session(b)
    capsys.readouterr()
    assert main(["compare", str(a), str(b), "--json", str(out)]) == 0
    shown, document = capsys.readouterr().out, json.loads(out.read_text())
    assert [one["joint"] for one in document["joints"]] == ["joint1", "joint2"]
    assert all(one["removed"] > 0.8 for one in document["joints"])
    assert "What is left, by the diagnosis of the second set:" in shown
    dry = EFFECT_FAMILIES["dry_friction"]  # its members differ at reversals, where the reference turns first
    (left,) = [c for c in document["left"]["candidates"] if c["effect"] in dry]
    assert left["joint"] == "joint2"
    assert left["parameters"]["coulomb"]["value"] == pytest.approx(0.4, rel=0.15)
