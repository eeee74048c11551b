"""The paragraph that ends an identification."""

import re
from dataclasses import replace

import numpy as np
import pytest

from flexviz.identification import identify
from flexviz.measurements import MeasurementSet, read_set
from flexviz.measurements.writing import GroupTable, write_set
from flexviz.results import ResultDocument, assessment
from tests.planar_arm import HELD_OUT, planar_set


@pytest.fixture(scope="module")
def clean(tmp_path_factory) -> MeasurementSet:
    return planar_set(tmp_path_factory.mktemp("clean") / "arm", ["none"], seed=3, groups=HELD_OUT)


def test_a_complete_model_is_good_and_needs_nothing(clean):
    text = assessment(identify(clean).document())
    assert text.startswith("Good: held-out error of all joints, at most ")
    assert "stiffness 2 of 2" in text
    assert "Weak" not in text and "diagnose" not in text and "Record" not in text
    assert "not the observer's bias" in text
    assert "bias" not in assessment(identify(clean, refine=True).document())


def test_a_missing_effect_is_weak_and_sends_to_the_diagnosis(demo):
    result = identify(demo)
    held_out = np.array(result.residual.rms_validation)
    torque = np.concatenate([s.tau for g in demo.groups for s in g.segments]).std(axis=0)
    text = assessment(result.document())
    found = re.search(r"Weak: held-out error of joint2 \((\d+) %\)", text)
    assert found and abs(float(found[1]) / 100 - held_out[1] / torque[1]) < 0.006
    assert "Next: diagnose with --apply" in text
    assert result.summary().endswith(text)


def test_refinement_of_an_incomplete_model_does_not_claim_noise_alone(demo, clean):
    assert "model error" in identify(demo, refine=True).message
    assert "measurement noise alone" in identify(clean, refine=True).message


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
