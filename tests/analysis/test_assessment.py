"""The paragraph that ends an identification."""

import re
from dataclasses import replace

import numpy as np
import pytest

from flexviz.analysis.identification import identify
from flexviz.content.results import ResultDocument, assessment, hints, lacks_effects
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.data.measurements.writing import GroupTable, write_set
from tests.planar_arm import HELD_OUT, planar_set


@pytest.fixture(scope="module")
def clean(tmp_path_factory) -> MeasurementSet:
    return planar_set(tmp_path_factory.mktemp("clean") / "arm", ["none"], seed=3, groups=HELD_OUT)


def test_a_complete_model_is_good_and_needs_nothing(clean):
    text = assessment(identify(clean, refine=False).document())
    assert text.startswith("Good: held-out error of all joints, at most ")
    assert "stiffness 2 of 2" in text
    assert "Weak" not in text and "diagnose" not in text and "Record" not in text
    assert "not the observer's bias" in text
    assert "bias" not in assessment(identify(clean).document())


def test_a_missing_effect_is_weak_and_sends_to_the_diagnosis(demo):
    result = identify(demo)
    held_out = np.array(result.residual.rms_validation)
    torque = np.concatenate([s.tau for g in demo.groups for s in g.segments]).std(axis=0)
    text = assessment(result.document())
    found = re.search(r"Weak: held-out error of joint2 \((\d+) %\)", text)
    assert found and abs(float(found[1]) / 100 - held_out[1] / torque[1]) < 0.006
    assert "Next: diagnose with --apply" in text
    assert result.summary().endswith(text)


@pytest.mark.slow
def test_refinement_of_an_incomplete_model_does_not_claim_noise_alone(demo, clean):
    model_errors = [identify(one).facts[0].values["model_error"] for one in (demo, clean)]
    assert model_errors[0] and not model_errors[1]


def test_joints_to_record_come_in_their_order():
    joints = ["one", "two", "three"]
    grades = [("stiffness", "three", "no"), ("stiffness", "two", "no"), ("motor_inertia", "one", "yes")]
    parameters = [
        {"name": name, "joint": joint, "value": 1.0, "std": 9.0, "unit": "", "identifiable": grade}
        for name, joint, grade in grades
    ]
    residual = {"joints": joints, "rms": [0.1] * 3, "rms_validation": None, "noise_floor": [0.1] * 3}
    document = ResultDocument.from_dict(
        {"format": 1, "set": "s", "parameters": parameters, "residual": residual}
    )
    assert "held-out group (validation = true) and faster reversals of two and three, with" in assessment(
        document
    )


def test_without_held_out_groups_one_is_asked_for(demo):
    groups = tuple(replace(g, validation=False) for g in demo.groups)
    text = assessment(identify(replace(demo, groups=groups)).document())
    assert "Record another motion as a held-out group" in text


def test_torque_behind_the_gear_is_recognised(clean, tmp_path):
    """The joint's own torque recorded as the motor's: what is left of the motor is nothing."""
    tables = [replace(t, tau=t.tau_joint, tau_joint=None) for t in map(GroupTable.of, clean.groups)]
    folder = tmp_path / "behind"
    write_set(folder, robot="robots:planar_2r", joints=clean.joints, groups=tables, payloads=clean.payloads)
    assert "joint torque sensor" in assessment(identify(read_set(folder)).document())


def document(rms, floor, between=(), parameters=(), **changes):
    residual = {"joints": ["a", "b"], "rms": rms, "rms_validation": rms, "noise_floor": floor,
                "torque_spread": [10.0, 10.0], "rms_between_reversals": list(between)}  # fmt: skip
    return ResultDocument.from_dict(
        {"format": 1, "set": "s", "parameters": list(parameters), "residual": residual, **changes}
    )


def test_what_only_reversals_leave_is_not_a_missing_effect():
    lacking = document([2.0, 0.1], [0.01, 0.01])
    assert (
        "error of a is 20.0 % of the torque (2.00 Nm), far above the noise of 0.100 %: the model lacks"
        in (assessment(lacking))
    )
    reversals = document([2.0, 0.1], [0.01, 0.01], between=[0.012, 0.02], iterations=9)
    text = assessment(reversals)
    assert "lacks effects" not in text and lacks_effects(reversals) == "" and "bias" in text
    assert "far above the noise of 0.100 %, but only around reversals and crossings of a gap" in text
    # more than reversals stays
    assert "lacks effects" in assessment(document([2.0, 0.1], [0.01, 0.01], between=[0.3, 0.02]))
    quiet = document([0.012, 0.01], [0.01, 0.01], between=[0.01, 0.01])
    assert "reversals" not in assessment(quiet)
    assert "rms_between_reversals" not in lacking.to_dict()["residual"]


@pytest.mark.slow
def test_backlash_that_the_model_has_leaves_only_reversals(tmp_path):
    """The crossings of the gap stay far above the noise although nothing is missing."""
    hidden = planar_set(tmp_path / "gap", ["backlash:joint1"], seed=7, groups=HELD_OUT)
    complete = identify(hidden, effects=["backlash:joint1"])
    floor, between = complete.residual.noise_floor, complete.residual.rms_between_reversals
    assert complete.residual.rms[0] > 30 * floor[0] and between[0] < 0.3 * complete.residual.rms[0]
    assert "only around reversals" in assessment(complete.document())
    without = identify(hidden)
    assert without.residual.rms_between_reversals == () and "lacks effects" in assessment(without.document())


def test_a_small_error_is_not_good_where_nothing_is_determined():
    """Neither a value that the data leave open nor one at its bound is a result."""
    lost = [parameter("stiffness"), parameter("torque_gain.gain_error") | {"identifiable": "yes"}]
    lost[1]["at_bound"] = True
    text = assessment(document([0.1, 0.2], [0.01, 0.01], parameters=lost))
    assert text.startswith("Nothing is determined, although the error is at most 2.0 % of the torque")
    assert "Good" not in text and "Weak" not in text
    found = [*lost, parameter("motor_inertia") | {"identifiable": "weak"}]
    assert assessment(document([0.1, 0.2], [0.01, 0.01], parameters=found)).startswith("Good: ")


def parameter(name, joint="a", value=1.0, start=1.0, at_bound=False):
    return {"name": name, "joint": joint, "value": value, "std": None, "unit": "", "start": start,
            "identifiable": "no", "at_bound": at_bound}  # fmt: skip


def test_a_value_at_its_bound_is_no_estimate():
    held = [parameter("stiffness", at_bound=True), parameter("motor_inertia", "b"),
            parameter("link_viscous_friction", at_bound=True),
            parameter("backlash.half_width", "b", at_bound=True)]  # fmt: skip
    found = document([1.0, 1.0], [1.0, 1.0], parameters=held)
    said = "At the bound of what is possible: stiffness of a and backlash · half width of b; their values are"
    assert said in assessment(found) and hints(found.all_parameters)[0].startswith(said)
    assert hints([]) == [] and "bound" not in assessment(document([1.0, 1.0], [1.0, 1.0]))


def test_a_diagnosis_gives_the_hints_of_an_identification():
    """The joint's own torque as the motor's: nothing is left of the motor inertias, in any model."""
    low = [parameter("motor_inertia", joint, 1e-3, 1.0) for joint in ("a", "b")]
    found = document([1.0, 1.0], [1.0, 1.0], parameters=low, verdict="unknown")
    assert "joint torque sensor" in hints(found.all_parameters)[0]
    assert "The motor inertias end at their lower bound" in found.summary()
    assert not hints(document([1.0, 1.0], [1.0, 1.0], parameters=[*low[:1], parameter("motor_inertia", "b")])
                     .all_parameters)  # fmt: skip
