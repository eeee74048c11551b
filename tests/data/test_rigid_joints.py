"""Rigid joints and joints without a torque: stated, found and said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_set import write_small_set

from benchmarks.rigid_joints import make_case, rigid_outcome, spoilt, torque_outcome
from flexviz import identify, read_set
from flexviz.base.errors import InputError
from flexviz.base.facts import Remedy
from flexviz.checks import AllSamples, GroupSamples, Issue, silent_joints
from flexviz.checks.masks.silent import silent_torques
from flexviz.content.results import hints
from flexviz.data.logs.proposals import Proposal, proposed
from flexviz.data.measurements import MeasurementSet
from flexviz.model.equation import Equation, build_signals, layout_of
from flexviz.model.observers import make_observer


@pytest.fixture(scope="module")
def rigid(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    """A planar arm whose second joint's motor is locked to the link."""
    folder = tmp_path_factory.mktemp("rigid")
    make_case(41, "none", "2r", folder, rigid=(1,), duration=6.0)
    return read_set(folder)


def test_a_rigid_joint_is_said_to_be_rigid_and_gets_no_stiffness_yes(rigid: MeasurementSet) -> None:
    found = identify(rigid)
    own = found["stiffness", "joint2"]
    assert own.identifiable == "no"
    assert own.rigid_above is not None and own.rigid_above > 1e4
    (said,) = [text for text in hints(found.parameters) if text.startswith("Rigid within")]
    assert "joint2 (K above" in said and 'rigid = ["joint2"]' in said and "joint1" not in said
    assert found.to_dict()["parameters"] and any("rigid_above" in p for p in found.to_dict()["parameters"])


def test_a_stated_rigid_joint_has_no_stiffness(rigid: MeasurementSet) -> None:
    stated = identify(replace(rigid, rigid=("joint2",)), refine=True)
    assert stated.converged
    assert [p.joint for p in stated.parameters if p.name == "stiffness"] == ["joint1"]
    assert np.isinf(stated.model.stiffness[1])
    assert not any(text.startswith("Rigid") for text in hints(stated.parameters))
    series = next(iter(stated.residuals.values()))
    signals = build_signals(
        rigid, rigid.fit_groups[:1], make_observer(stated.observer_name, float(np.max(stated.bandwidth)))
    )
    np.testing.assert_allclose(series.q[:, 1], signals.theta[0, :, 1], atol=1e-9)  # motor and link are one


@pytest.mark.slow
def test_elastic_joints_beside_a_rigid_one() -> None:
    one = rigid_outcome(42, "2r", (0,))
    assert one.false == 0 and one.said == 1.0
    assert len(one.errors) == 1 and abs(one.errors[0]) < 0.02


def test_effects_of_the_spring_are_refused_on_a_rigid_joint(rigid: MeasurementSet) -> None:
    stated = replace(rigid, rigid=("joint2",))
    with pytest.raises(InputError, match="joint2 is rigid"):
        layout_of(stated, ["backlash:joint2"])
    both = layout_of(stated, ["joint_damping", "coulomb_friction"])
    assert [e.text(both.joints) for e in both.effects] == [
        "joint_damping:joint1",
        "coulomb_friction:joint1",
        "coulomb_friction:joint2",
    ]


def test_the_file_states_them(tmp_path: Path) -> None:
    file = write_small_set(tmp_path) / "measurements.toml"
    text = file.read_text()
    own = '[model]\nrigid = ["joint1"]\nno_torque = ["joint2"]\n'
    file.write_text(text.replace("[model]\n", own) if "[model]\n" in text else f"{text}\n{own}")
    measurements = read_set(tmp_path)
    assert measurements.rigid == ("joint1",) and measurements.no_torque == ("joint2",)
    assert not measurements.groups[0].segments[0].tau[:, 1].any()
    for wrong, said in (('["joint9"]', "joint9"), ('["joint1", "joint2"]', "no joint has a torque")):
        file.write_text(file.read_text().replace('no_torque = ["joint2"]', f"no_torque = {wrong}"))
        with pytest.raises(InputError, match=said):
            read_set(tmp_path)
        file.write_text(file.read_text().replace(f"no_torque = {wrong}", 'no_torque = ["joint2"]'))


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> MeasurementSet:
    folder = tmp_path_factory.mktemp("arm")
    make_case(43, "none", "2r", folder, duration=6.0)
    return read_set(folder)


@pytest.mark.parametrize("channel", ["three values", "constant", "noise"])
def test_a_torque_that_is_no_signal_is_found_and_told(arm: MeasurementSet, channel: str) -> None:
    without = spoilt(arm, 1, channel, np.random.default_rng(0))
    assert list(silent_joints(without)) == ["joint2"]
    assert silent_joints(arm) == {}
    facts = identify(without, max_iterations=3, refine=False).facts
    (silent,) = [fact for fact in facts if fact.kind == "no-torque"]
    assert silent.remedy == Remedy("model.no_torque", ("joint2",), "set")


def test_a_joint_at_rest_needs_no_torque(arm: MeasurementSet) -> None:
    group = arm.groups[0]
    theta = group.joined("theta").copy()
    theta[:, 1] = theta[0, 1]
    tau = group.joined("tau").copy()
    tau[:, 1] = 0.0
    still = GroupSamples("a", (), group.joined("time"), theta, tau)
    assert silent_torques(AllSamples(arm.robot, (still,))) == {}


@pytest.mark.slow
def test_other_joints_do_not_suffer() -> None:
    named, ratio = torque_outcome(44, "ur5", 4, "three values")
    assert named
    assert ratio < 1.1


@pytest.mark.slow
def test_the_equation_of_a_joint_without_torque_is_left_out(arm: MeasurementSet) -> None:
    stated = replace(spoilt(arm, 1, "constant", np.random.default_rng(0)), no_torque=("joint2",))
    layout = layout_of(stated)
    signals = build_signals(stated, stated.fit_groups, make_observer("butterworth-zero-phase", 40.0))
    x = layout.vector(identify(stated).model)
    found = Equation(stated.robot, signals, layout).evaluate(x)
    assert not found.residual[:, 1].any() and not found.jacobian[:, 1].any()
    assert found.residual[:, 0].any()
    # the joint bends under the torque that its link takes
    bend = x[layout.compliance][1] * found.torque[0, :, 1]
    assert np.abs(bend).max() > 1e-4
    np.testing.assert_allclose(found.q[0, :, 1], signals.theta[0, :, 1] - bend, atol=1e-9)
    wanted = found.residual[:, 0].std() / signals.tau[0, :, 0].std()
    assert wanted < 5e-3
    names = {p.name for p in identify(stated).parameters if p.joint == "joint2"}
    assert not names & {"motor_inertia", "motor_viscous_friction", "viscous_friction_sum"}


def test_the_proposal_is_a_key_of_the_model() -> None:
    key = Proposal(("model",), "no_torque", ["j7"])
    assert str(key) == 'no_torque = ["j7"] in [model]'
    assert proposed({"logs": []}, [key])["model"] == {"no_torque": ["j7"]}
    issue = Issue("no_torque", "odd", ("j7",), "tau", {"what": {"j7": {"values": (0.0,)}}}, proposals=(key,))
    assert issue.remedies == (key,)
