"""Presets, hidden effects, truth.json, whole sets, existing sets repeated."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexviz.base.errors import Cancelled, InputError
from flexviz.base.resources import sessions_dir
from flexviz.data.measurements import read_set
from flexviz.model.simulation import (
    PRESETS,
    PDController,
    Plan,
    Sensors,
    Sinusoid,
    make_plan,
    move,
    record,
    simulate_plan,
    simulate_preset,
    write_plan,
)
from flexviz.model.simulation.effect_laws import LAWS
from flexviz.model.simulation.presets import (
    PAPER_GROUPS,
    PLANAR_TRUTH,
    paper,
    paper_payloads,
    planar_inertial,
)
from flexviz.model.simulation.sets import truth
from flexviz.robot._pinocchio import pin
from flexviz.robot.robot import SETTINGS, Robot, load_settings


def short(plan: Plan, duration: float = 0.3) -> Plan:
    return replace(plan, groups=tuple(replace(group, duration=duration) for group in plan.groups))


def regrouped_torque(values: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Closed form of the planar arm's torques from [Izz1, mx1, my1, Izz2, mx2, my2], l1 = 1 m, g = 9.81."""
    izz1, mx1, my1, izz2, mx2, my2 = values
    c, s = np.cos(q[1]), np.sin(q[1])
    along, across = c * mx2 - s * my2, -(s * mx2 + c * my2)
    up1, up2 = (
        9.81 * np.array([np.cos(q[0]), -np.sin(q[0])]),
        9.81 * np.array([np.cos(q.sum()), -np.sin(q.sum())]),
    )
    fall2 = up2 @ [mx2, my2]
    m11, m12, m22 = izz1 + izz2 + 2 * along, izz2 + along, izz2
    first = m11 * a[0] + m12 * a[1] + across * (2 * v[0] * v[1] + v[1] ** 2) + up1 @ [mx1, my1] + fall2
    return np.array([first, m12 * a[0] + m22 * a[1] - across * v[0] ** 2 + fall2])


def test_paper_payloads_change_the_regrouped_parameters() -> None:
    robot = Robot.load("robots:planar_2r")
    base = np.array(list(PLANAR_TRUTH.values()))
    changes = {"p1": [0] * 6, "p2": [2, 2, 0, 1, 1, 0], "p3": [4, 2, 0, 2, 2, 0]}
    data = robot.model.createData()
    rng = np.random.default_rng(0)
    for name, bodies in paper_payloads().items():
        gamma = planar_inertial() + robot.payload_parameters(bodies)
        for q, v, a in rng.normal(size=(5, 3, 2)):
            expected = regrouped_torque(base + changes[name], q, v, a)
            regressor = pin.computeJointTorqueRegressor(robot.model, data, q, v, a)
            np.testing.assert_allclose(regressor @ gamma.ravel(), expected, rtol=1e-12)
            model = robot.model_with(planar_inertial(), bodies)
            np.testing.assert_allclose(pin.rnea(model, model.createData(), q, v, a), expected, rtol=1e-10)


@pytest.mark.parametrize("name", PRESETS)
def test_presets(name: str) -> None:
    plan = make_plan(name)
    fit = [group.name for group in plan.groups if not group.validation]
    held_out = [group for group in plan.groups if group.validation]
    assert len(held_out) == 1 and held_out[0].name not in fit
    if name.startswith("paper-"):
        assert tuple(fit) == PAPER_GROUPS[name[-1]]
        assert all(group.duration == 10.0 and group.record_step is None for group in plan.groups)
        assert plan.controller.cycle == 0.00025 and plan.sensors.theta_noise[0] == 2e-5  # type: ignore[index]
    # bodies that could exist: mass and inertia positive, triangle inequality
    for row in plan.model.inertial:
        moments = np.linalg.eigvalsh(pin.Inertia.FromDynamicParameters(row).inertia)
        assert row[0] > 0 and moments[0] > 0 and moments[0] + moments[1] >= moments[2]
    off = (
        plan.model.inertial / np.where(plan.robot.cad_parameters == 0, np.inf, plan.robot.cad_parameters) - 1
    )
    assert np.abs(off).max() > 0.02  # the robot given with the set is not the true one
    for group in plan.groups:
        time = np.linspace(0, group.duration, 500)
        position, velocity = group.reference.sample(time)
        assert (position > plan.robot.lower_limit).all() and (position < plan.robot.upper_limit).all()
        assert (np.abs(velocity) < plan.robot.velocity_limit).all()


def test_panda_is_about_fifteen_percent_off() -> None:
    plan = make_plan("panda")
    ratio = plan.model.inertial[:, 0] / plan.robot.cad_parameters[:, 0]
    np.testing.assert_allclose(np.abs(ratio - 1), 0.15, atol=1e-12)


def test_settings() -> None:
    for name in SETTINGS:
        settings = load_settings(name)
        assert Robot.load(settings.robot, settings.joints).joints == settings.joints
        assert (settings.stiffness > 0).all() and (settings.motor_inertia > 0).all()
    with pytest.raises(InputError, match='settings "pand" do not exist; did you mean "panda"'):
        load_settings("pand")


def test_seed_repeats_the_numbers() -> None:
    plan = short(make_plan("paper-a"))
    one, same, other = (simulate_plan(plan, seed) for seed in (3, 3, 4))
    for name in one:
        np.testing.assert_array_equal(one[name].tau, same[name].tau)
        np.testing.assert_array_equal(one[name].theta, same[name].theta)
        assert not np.array_equal(one[name].theta, other[name].theta)
        np.testing.assert_array_equal(one[name].q, other[name].q)  # the noise is in the record only
    np.testing.assert_array_equal(record(plan, move(plan), 4)["t1p1"].tau, other["t1p1"].tau)
    difference = one["t1p1"].theta - other["t1p1"].theta
    np.testing.assert_allclose(difference.std(axis=0), 2e-5 * np.sqrt(2), rtol=0.1)
    difference = one["t1p1"].tau - other["t1p1"].tau
    np.testing.assert_allclose(difference.std(axis=0), 2e-3 * np.sqrt(2), rtol=0.1)


def test_noise_and_resolution_in_the_loop() -> None:
    plan = short(make_plan("paper-a"))
    sensors = Sensors(2e-5, 2e-3, resolution=1e-5, feedback=True)
    runs = simulate_plan(replace(plan, sensors=sensors), 1)
    other = simulate_plan(replace(plan, sensors=sensors), 2)
    theta = runs["t1p1"].theta
    np.testing.assert_allclose(theta / 1e-5, np.round(theta / 1e-5), atol=1e-6)
    assert np.abs(runs["t1p1"].q - other["t1p1"].q).max() > 1e-9  # the controller felt it
    assert np.abs(runs["t1p1"].q - other["t1p1"].q).max() < 1e-3


def test_torque_filter_smooths_and_still_controls() -> None:
    plan = short(make_plan("paper-a", start="moving"), 1.0)
    controller = plan.controller
    smooth = PDController(controller.kp, controller.kd, controller.cycle, torque_filter=50.0)
    plain, filtered = (plan.run(plan.groups[0]), replace(plan, controller=smooth).run(plan.groups[0]))
    assert np.abs(filtered.theta - plain.theta).max() < 0.01
    assert not np.array_equal(plain.tau, filtered.tau)


def test_record_of_a_filtered_and_rounded_torque() -> None:
    plan = short(make_plan("paper-a"))
    bandwidth, step = 900.0, np.array([0.5, 0.25])
    sensors = Sensors(torque_filter=bandwidth, torque_resolution=step)
    plain = plan.run(plan.groups[0])
    seen = replace(plan, sensors=sensors).run(plan.groups[0])
    np.testing.assert_array_equal(seen.theta, plain.theta)  # only the record is filtered
    assert seen.torque_hold == 0.0 and plain.torque_hold == plan.controller.cycle
    # y(t_k) = τ_0 e^(−w t_k) + Σ_j τ_j [e^(−w (t_k − t_{j+1})) − e^(−w (t_k − t_j))]
    t = plain.time
    for k in (0, 1, 7, 400, len(t) - 1):
        since = np.exp(-bandwidth * (t[k] - t[: k + 1]))
        expected = plain.tau[0] * since[0] + np.diff(since) @ plain.tau[:k]
        np.testing.assert_allclose(seen.tau[k], expected, rtol=1e-9, atol=1e-9)
    rounded = seen.measured(sensors, 0).tau
    np.testing.assert_allclose(rounded / step, np.round(rounded / step), atol=1e-9)
    assert np.all(np.abs(rounded - seen.tau) <= step / 2 + 1e-9)


def test_set_and_truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(PRESETS, "paper-f", lambda: short(paper("f"), 0.5))
    shares: list[float] = []
    done = simulate_preset(
        "paper-f",
        tmp_path / "set",
        ["coulomb_friction:joint2:coulomb=2.5", "torque_offset"],
        seed=7,
        start="moving",
        progress=lambda news: shares.append(news.share or 0.0),
    )
    assert shares == sorted(shares) and shares[-1] == 1.0
    found = read_set(done.folder)
    assert [g.name for g in found.fit_groups] == ["t1p1"] and found.simulated and not found.warnings
    assert found.torque_hold == 0.00025 and found.groups[0].samples == 2000
    assert found.effects == () and found.kp is not None
    np.testing.assert_allclose(found.robot.cad_parameters, done.plan.robot.cad_parameters)
    saved = json.loads((done.folder / "truth.json").read_text())
    assert saved["format"] == 1 and saved["simulated"] is True and saved["seed"] == 7
    names = {(p["name"], p["joint"]): p["value"] for p in saved["parameters"]}
    assert len(names) == 2 * 15
    assert names["stiffness", "joint1"] == 1000.0
    assert names["viscous_friction_sum", "joint2"] == pytest.approx(2.06)
    assert names["izz", "joint1"] + names["mass", "joint2"] == pytest.approx(2.5)
    assert [(e["effect"], e["joint"]) for e in saved["effects"]] == [
        ("coulomb_friction", "joint2"),
        ("torque_offset", "joint1"),
        ("torque_offset", "joint2"),
    ]
    assert saved["effects"][0]["parameters"] == {"coulomb": {"value": 2.5, "unit": "Nm"}}
    with pytest.raises(InputError, match="already there"):
        simulate_preset("paper-f", done.folder)


def test_an_existing_set_is_repeated(tmp_path: Path) -> None:
    plan = short(make_plan("planar-2r"), 0.5)
    folder = write_plan(plan, simulate_plan(plan, 1), tmp_path / "first")
    (folder / "truth.json").unlink()
    again = make_plan(folder, ["backlash:joint1:half_width=0.001"])
    first = read_set(folder)
    wanted = first.groups[0].theta_ref
    assert wanted is not None
    np.testing.assert_allclose(again.groups[0].reference.sample(first.groups[0].time)[0], wanted)
    np.testing.assert_allclose(np.asarray(again.sensors.theta_noise), 2e-5, rtol=0.15)
    second = read_set(write_plan(again, simulate_plan(again, 2), tmp_path / "second"))
    assert [g.name for g in second.groups] == [g.name for g in first.groups]
    assert second.groups[0].segments[0].theta.shape == first.groups[0].segments[0].theta.shape
    assert second.payloads.keys() == first.payloads.keys()
    assert truth(again, 2)["effects"][0]["effect"] == "backlash"


def test_a_set_without_reference_is_repeated(tmp_path: Path) -> None:
    plan = replace(short(make_plan("planar-2r"), 0.8), extra=False)
    runs = simulate_plan(plan, 1)
    bare = {name: replace(run, theta_ref=np.full_like(run.theta, np.nan)) for name, run in runs.items()}
    plan = replace(plan, initial_stiffness=None, initial_motor_inertia=None)
    again = make_plan(write_plan(plan, bare, tmp_path / "first"))
    position, _ = again.groups[0].reference.sample(runs["t1p1"].time)
    assert np.abs(position - runs["t1p1"].theta).max() < 5e-4
    assert (again.model.stiffness > 0).all()
    simulate_plan(short(again, 0.1))


@pytest.mark.parametrize("name", LAWS)
def test_default_sizes_show(name: str) -> None:
    plan = replace(short(make_plan("planar-2r", [name]), 0.7), start="moving")
    assert plan.model.effects
    group = next(g for g in plan.groups if g.payload == "p3")  # the heaviest payload
    group = replace(group, reference=Sinusoid(0.6, 3.0))
    effects = [
        replace(e, group=None, parameters=e.parameters | ({"start": 0.1} if "start" in e.parameters else {}))
        for e in plan.model.effects
    ]
    hidden = replace(plan, model=replace(plan.model, effects=tuple(effects)))
    clean = replace(plan, model=replace(plan.model, effects=()))
    difference = hidden.run(group).tau - clean.run(group).tau
    assert np.abs(difference).max() > 0.005  # well above the torque's noise of 0.002 Nm
    assert np.abs(difference).max() < 200.0


def test_none_hides_nothing() -> None:
    assert make_plan("planar-2r", ["none"]).model.effects == ()


@pytest.mark.parametrize(
    ("effect", "message"),
    [
        ("backlas", 'effect "backlas" does not exist; did you mean "backlash"'),
        ("backlash:joint3", 'joint "joint3" does not exist'),
        ("backlash:joint1:width=1", 'no parameter "width"; did you mean'),
        ("backlash:joint1:half_width", "not of the form param=value"),
        ("backlash:joint1:half_width=wide", "half_width=wide is not a number"),
        ("backlash:joint1:half_width=nan", "expected a finite number"),
        ("backlash:joint1:half_width=-1", "expected a number ≥ 0"),
        ("stribeck_friction:joint1:velocity=0", "expected a positive number"),
        ("base_tilt:joint1", "belongs to no joint"),
        ("payload_error:p7", 'payload "p7" does not exist'),
        ("payload_error:p1", 'payload "p1" has no mass, expected one that has'),
        ("external_contact:joint1:group=g7", 'group "g7" does not exist'),
        ("external_contact:joint1:start=99,end=100", r"from 99 to 100 s, expected .* within the 12 s"),
        ("external_contact:joint1:start=3,end=2", "from 3 to 2 s, expected a start before the end"),
        ("external_contact:joint1:start=-2,end=-1", "from -2 to -1 s, expected"),
    ],
)
def test_bad_effect_options(effect: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make_plan("planar-2r", [effect])


def test_effects_given_twice_and_unknown_presets() -> None:
    with pytest.raises(InputError, match='"backlash" is given twice on joint1'):
        make_plan("planar-2r", ["backlash", "backlash:joint1"])
    with pytest.raises(InputError, match='neither a preset nor a measurement set; did you mean "paper-'):
        make_plan("paper-g")
    with pytest.raises(InputError, match='start "sitting" does not exist'):
        make_plan("paper-a", start="sitting")


def test_stopping_writes_nothing(tmp_path: Path) -> None:
    with pytest.raises(Cancelled):
        simulate_preset("paper-a", tmp_path / "set", should_stop=lambda: True)
    assert not any(tmp_path.iterdir())


def test_the_bundled_example() -> None:
    folder = sessions_dir() / "planar-2r-demo"
    found = read_set(folder)
    assert found.simulated and found.kp is not None and not found.warnings
    assert len(found.fit_groups) == 3 and len(found.validation_groups) == 1
    assert all(group.theta_ref is not None and group.q is not None for group in found.groups)
    assert sum(file.stat().st_size for file in folder.iterdir()) < 3e6
    hidden = json.loads((folder / "truth.json").read_text())["effects"]
    assert [(e["effect"], e["joint"]) for e in hidden] == [("coulomb_friction", "joint2")]
