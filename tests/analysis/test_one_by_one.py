"""A model of many effects is reached one effect after another."""

from __future__ import annotations

import json

import numpy as np
import pytest
from shared_data import SHARED

from flexviz.analysis.identification import identify
from flexviz.analysis.motion import MotionContext, one_by_one
from flexviz.data.measurements import read_set
from flexviz.model.effects import ChosenEffect
from flexviz.model.equation import layout_of

CASE = "robotlike-2r-03"
FOLDER = SHARED / "robotlike" / "cases" / CASE
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="these recordings are not part of the project")


def hidden() -> list[tuple[str, str]]:
    truth = json.loads((SHARED / "robotlike" / "truth" / f"{CASE}.json").read_text())
    return [(e["effect"], e["joint"]) for e in truth["effects"] if e["effect"] != "unknown"]


def test_eight_effects_at_once_end_elsewhere() -> None:
    measurements = read_set(FOLDER)
    own = layout_of(measurements)
    effects = [ChosenEffect(effect, own.joints.index(joint)) for effect, joint in hidden()]
    layout = own.with_effects(effects)
    context = MotionContext(measurements, own.joints, stand_ins=True)
    at_once = context.fit(layout, context.start(layout).x)
    found = one_by_one(context, layout, lambda: None)
    assert found.layout == layout and len(effects) == 8
    assert found.objective < at_once.objective - 1000


def test_identify_reaches_the_model_of_a_diagnosis() -> None:
    measurements = read_set(FOLDER)
    result = identify(measurements, effects=[f"{effect}:{joint}" for effect, joint in hidden()])
    share = np.array(result.residual.rms_validation) / np.array(measurements.torque_spread)
    assert share[0] < 0.1 and share[1] < 0.01  # an unmodelled torque of 9 % acts on the first joint
