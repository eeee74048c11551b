"""Free curves as terms of the model: law, prior, identification, a diagnosis's last step, export."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.diagnosis_study.laws import FrictionBump
from flexviz.analysis.diagnosis import Diagnosis, Step, why_no_curve, with_free_curve
from flexviz.analysis.diagnosis.candidates import candidates
from flexviz.analysis.estimation.prior import Prior, physically_consistent
from flexviz.analysis.identification import Identification, identify
from flexviz.base.errors import InputError
from flexviz.content.records import FreeCurve, ResidualLocation
from flexviz.content.results import read_result
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.effects import (
    CURVES,
    EFFECTS,
    EffectTarget,
    JointState,
    choose_effects,
    free_curve,
)
from flexviz.model.effects.trial import TrialMotion, TrialSignal
from flexviz.model.equation import Layout
from flexviz.model.simulation import Plan, make_plan, simulate_plan, write_plan
from flexviz.outlets.exporting import export
from flexviz.outlets.exporting.parameters import curve_files
from flexviz.outlets.terminal import main
from flexviz.robot.model import EffectValue, FlexibleModel
from tests.planar_arm import HELD_OUT, of_groups

TRIAL = TrialMotion(
    np.linspace(0.0, 6.0, 3001),
    motor=TrialSignal(((0.6, 1.3, 0.2), (0.3, 3.1, 1.0)), constant=0.4),
    torque=TrialSignal(((40.0, 1.1, 0.5), (25.0, 4.3, 2.0)), constant=5.0),
)
BUMP = FrictionBump(peak=4.0, position=0.2, width=0.3)
EFFECT = "free_curve_direction"


def short(**changed: Any) -> Plan:
    """The planar arm, with short groups."""
    plan = of_groups(make_plan("planar-2r"), HELD_OUT)
    return replace(plan, groups=tuple(replace(group, duration=8.0) for group in plan.groups), **changed)


@pytest.fixture(scope="module")
def bumpy(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    """A planar arm with a rough spot in joint 2, a law of no library."""
    plan = short(laws=(("joint2", BUMP),))
    return read_set(write_plan(plan, simulate_plan(plan), tmp_path_factory.mktemp("sets") / "bumpy"))


@pytest.fixture(scope="module")
def plain(bumpy: MeasurementSet) -> Identification:
    return identify(bumpy, refine=False)


@pytest.fixture(scope="module")
def curved(bumpy: MeasurementSet) -> Identification:
    return identify(bumpy, effects=[f"{EFFECT}:joint2"])


def found(bumpy: MeasurementSet, plain: Identification, variable: str = "position") -> Diagnosis:
    """As `diagnose` finds it: "unknown", with a free curve."""
    errors = plain.residual
    curve = FreeCurve(
        "joint2", variable, "rad", ("forward", "backward"), np.linspace(-1, 1, 5), np.zeros((2, 5)),
        np.ones((2, 5)), 0.9, 0.01, 1.0,
    )  # fmt: skip
    step = Step(
        None, errors.rms, errors.rms_validation, (), errors.noise_floor, plain.model, verdict="unknown"
    )
    return Diagnosis(
        set_name=bumpy.name, verdict="unknown", findings=(), steps=(step,), effects=(), seconds=1.0,
        where=(ResidualLocation("joint2", "position", 0.9, (-1.0, 1.0)),), parameters=plain.parameters,
        model=plain.model, free_curve=curve, torque_spread=bumpy.torque_spread,
    )  # fmt: skip


@pytest.fixture(scope="module")
def longer(bumpy: MeasurementSet, plain: Identification) -> Diagnosis:
    return with_free_curve(bumpy, found(bumpy, plain))


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: c.name)
def test_law(curve) -> None:
    """The torque at the nodes is that of the parameters, and the simulated one is the same law."""
    values = curve.sizes()
    assert all(p.given for p in curve.parameters[:2]) and not any(p.given for p in curve.parameters[2:])
    (motion,) = TRIAL.motions(0)
    u, slopes = curve.law(motion, values)
    np.testing.assert_allclose(values[2:] @ slopes[2:], u)
    assert not slopes[:2].any() and np.ptp(u) > 1.0
    at, torque = curve.fine(values)
    np.testing.assert_allclose(torque[:, ::20], curve.node_values(values), atol=1e-12)
    np.testing.assert_allclose(at[::20], curve.node_places(values))
    simulated = curve.simulation(values)
    for k in range(0, len(u), 211):
        state = JointState(
            motion.time[k], motion.position[k], motion.velocity[k], motion.link_position[k],
            motion.link_velocity[k], motion.torque[k],
        )  # fmt: skip
        assert simulated(state) == pytest.approx(u[k], abs=0.01)


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: c.name)
def test_range_is_that_of_the_data(curve) -> None:
    reach = {"position": (-0.7312, 1.1), "velocity": (-2.51, 1.9), "load": (-31.2, 77.0), "time": (0, 9.97)}
    low, high = curve.constants(reach)
    wanted = (0.0, 2.51) if curve.variable == "velocity" else reach[curve.variable]
    assert low <= wanted[0] and high >= wanted[1] and high - low < 1.11 * (wanted[1] - wanted[0])


def test_joints_whose_names_differ_in_punctuation_have_a_table_each() -> None:
    curve = EFFECTS[EFFECT]
    values = {p.name: float(size) for p, size in zip(curve.parameters, curve.sizes(), strict=True)}
    effects = [EffectValue(EFFECT, joint, values) for joint in ("arm.1", "arm 1", "arm/1", "arm_1")]
    robot: Any = SimpleNamespace(model=SimpleNamespace(effects=effects))
    files = curve_files(robot)
    assert len(files) == 4 and not any("/" in name for name in files)


def test_never_a_candidate() -> None:
    names = {c.name for c in CURVES}
    assert len(names) == 10 and not names & set(EFFECTS) and all(c.stopgap for c in CURVES)
    assert EFFECTS[EFFECT] is EFFECTS.get(EFFECT) is free_curve(EFFECT) and EFFECT in EFFECTS
    assert EFFECTS.get("nothing") is None and "nothing" not in EFFECTS
    with pytest.raises(KeyError):
        EFFECTS["nothing"]
    layout = Layout(("joint1", "joint2"))
    assert not names & {c.effect for c in candidates(layout, (), many=True)}
    (chosen,) = choose_effects([f"{EFFECT}:joint2"], layout.joints)
    assert chosen.place == EffectTarget(joint=1)


def test_prior_has_the_derivatives_of_its_value(bumpy: MeasurementSet) -> None:
    layout = Layout(bumpy.joints, choose_effects(["free_curve_time:joint1"], bumpy.joints))
    where = layout.effect_slices()[0][1]
    rng = np.random.default_rng(0)
    cad = physically_consistent(bumpy.robot.cad_parameters)
    x = rng.random(layout.size)
    x[layout.inertial] = cad.ravel()
    precision = EFFECTS["free_curve_time"].precision(20.0)
    assert precision is not None and np.linalg.eigvalsh(precision[2:, 2:])[0] > 1 / (0.1 * 20.0) ** 2 - 1e-9
    prior = Prior(layout, cad, np.zeros(layout.size), np.ones(layout.size), coupled=((where, precision),))
    gradient, hessian = prior.gradient_and_hessian(x)
    for k in range(where.start, where.stop, 5):
        ends = [x + step * np.eye(layout.size)[k] for step in (1e-5, -1e-5)]
        assert gradient[k] == pytest.approx((prior.value(ends[0]) - prior.value(ends[1])) / 2e-5, rel=1e-4)
        slopes = (prior.gradient_and_hessian(ends[0])[0] - prior.gradient_and_hessian(ends[1])[0]) / 2e-5
        np.testing.assert_allclose(slopes[where], hessian[where, k], rtol=1e-4, atol=1e-6)


def truth(position: np.ndarray) -> np.ndarray:
    """The bump's torque in each direction, shape (2, N)."""
    bump = BUMP.peak * np.exp(-(((position - BUMP.position) / BUMP.width) ** 2))
    return np.stack((bump, -bump))


def test_identified_curve_is_the_law(plain: Identification, curved: Identification) -> None:
    assert curved.converged and curved.residual.rms_validation and plain.residual.rms_validation
    assert curved.residual.rms_validation[1] < 0.1 * plain.residual.rms_validation[1]
    assert curved.residual.rms_validation[0] < 1.2 * plain.residual.rms_validation[0]
    assert curved["stiffness", "joint2"].value == pytest.approx(1100, rel=0.01)
    (table,) = curved.document().curves
    assert (table.effect, table.joint, table.directions) == (EFFECT, "joint2", ("forward", "backward"))
    known = truth(np.array(table.at, float))
    value, std = np.array(table.value, float), np.array(table.std, float)
    seen = std < 0.2 * BUMP.peak
    assert seen.sum() > 30
    # forward and backward are known up to what gravity and a constant torque may absorb: compare the halves
    assert np.abs((value[0] - value[1]) / 2 - known[0])[seen.all(axis=0)].max() < 0.06 * BUMP.peak
    assert (np.abs(value - known) < 4 * std + 0.05 * BUMP.peak)[seen].mean() > 0.9


def test_a_curve_takes_nothing_that_is_explained(demo: MeasurementSet) -> None:
    complete = identify(demo, effects=["coulomb_friction:joint2"])
    beside = identify(demo, effects=["coulomb_friction:joint2", "free_curve_position:joint2"])
    (table,) = beside.document().curves
    assert np.abs(np.array(table.value, float)).max() < 0.03 * 3.0  # [Nm] of the Coulomb friction
    for name in ("stiffness", "motor_inertia", "coulomb_friction.coulomb"):
        before, after = complete[name, "joint2"], beside[name, "joint2"]
        assert abs(after.value - before.value) < 3 * max(before.std, after.std) + 1e-3 * abs(before.value)


def test_step_of_a_diagnosis(
    bumpy: MeasurementSet, plain: Identification, longer: Diagnosis, tmp_path: Path
) -> None:
    first, last = longer.steps
    assert last.added is not None and last.added.stopgap and last.verdict == "unknown"
    assert last.added.text in (f"{EFFECT}:joint2", "free_link_curve_direction:joint2")
    assert first.rms_validation and last.rms_validation
    assert last.rms_validation[1] < 0.2 * first.rms_validation[1] and last.added.score > 0.9
    assert longer.model is not None and [e.text for e in longer.model.effects] == [last.added.text]
    document = longer.to_dict()
    (table,) = document["curves"]
    assert table["variable"] == "position" and np.shape(table["value"]) == (2, len(table["at"]))
    assert "a bump of" in table["form"]
    file = tmp_path / "result.json"
    file.write_text(json.dumps(document))
    assert read_result(file).to_dict()["curves"] == document["curves"]
    assert "not physics" in longer.summary()
    (note,) = (note.text for note in longer.notes if note.kind == "stopgap")
    assert note.startswith(f"not physics, but in the model: {last.added.text}")


def test_why_there_is_no_curve(bumpy: MeasurementSet, plain: Identification) -> None:
    good = found(bumpy, plain)
    assert why_no_curve(good) is None and good.free_curve is not None
    complete = replace(good, steps=(replace(good.steps[0], verdict="nothing-missing"),))
    poor = replace(good.free_curve, explained=0.08, explained_std=0.07)
    own = replace(plain.model, effects=(EffectValue(EFFECT, "joint2"),))
    for why, diagnosis in (
        ("verdict", complete),
        ("no-such-curve", found(bumpy, plain, "acceleration")),
        ("stopped", replace(good, free_curve=None)),
        ("uncertain", replace(good, free_curve=poor)),
        ("has-this-one", replace(good, model=own)),
    ):
        fact = why_no_curve(diagnosis)
        assert fact is not None and fact.values["why"] == why and fact.text
    with pytest.raises(InputError, match="no free curve is added"):
        with_free_curve(bumpy, replace(good, free_curve=None))


def test_exported_table_is_the_torque(bumpy: MeasurementSet, curved: Identification, tmp_path: Path) -> None:
    done = export(bumpy, curved, tmp_path / "out")
    assert all("not physics" in done.left_out[name][0] for name in ("urdf", "mjcf", "c", "python"))
    assert not done.left_out["json"]
    file = tmp_path / "out" / f"{EFFECT}_joint2.csv"
    with file.open() as lines:
        rows = list(csv.DictReader(lines))
    at, forward, backward = (
        np.array([float(row[name]) for row in rows])
        for name in ("position", "forward_torque", "backward_torque")
    )
    segment = bumpy.group("t1p1").segments[0]
    theta = segment.theta[:, 1]
    moving = np.gradient(theta, segment.step)
    torque = np.where(moving > 0, np.interp(theta, at, forward), np.interp(theta, at, backward))
    known = np.where(moving > 0, *truth(theta))
    used = np.abs(moving) > 0.05
    assert np.sqrt(np.mean((torque - known)[used] ** 2)) < 0.1 * np.sqrt(np.mean(known[used] ** 2))
    document = json.loads((tmp_path / "out" / "parameters.json").read_text())
    assert document["curves"][0]["at"][0] == pytest.approx(at[0])
    again = export(bumpy, read_result(tmp_path / "out" / "parameters.json"), tmp_path / "twice", ["json"])
    assert (again.folder / file.name).read_bytes() == file.read_bytes()


@pytest.mark.slow
def test_an_identified_curve_is_simulated(curved: Identification) -> None:
    plan = short()
    (value,) = curved.model.effects
    model: FlexibleModel = replace(plan.model, effects=(value,))
    group = plan.groups[0]
    with_law = replace(plan, laws=(("joint2", BUMP),)).run(group)
    with_curve, without = replace(plan, model=model).run(group), plan.run(group)
    missing = np.std((with_law.tau - without.tau)[:, 1])
    assert np.std((with_law.tau - with_curve.tau)[:, 1]) < 0.2 * missing


def test_command_refuses_a_curve_without_apply(bumpy: MeasurementSet, capsys: Any) -> None:
    assert main(["diagnose", str(bumpy.path), "--free-curve"]) == 2
    assert "--apply" in capsys.readouterr().err
