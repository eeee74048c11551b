"""The Python interface: folders and names as they are given, intervals, one word for one thing."""

from __future__ import annotations

import inspect
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flexviz
from flexviz.data.measurements import MeasurementSet

BEGINS = ("measurements", "source", "file", "robot", "design")  # what is worked on
ORDER = (
    *BEGINS,
    "result",
    "model",
    "group",
    "observer",
    "bandwidths",
    "out",
    "folder",
    "formats",
    "settings",
)
FUNCTIONS = ("design", "diagnose", "export", "identify", "import_logs", "record", "replay", "sweep",
             "write_design", "write_report")  # fmt: skip


@pytest.mark.parametrize("name", FUNCTIONS)
def test_one_order_of_arguments(name: str) -> None:
    """What is worked on, where it is written, settings; all else by name."""
    found = [p for p in inspect.signature(getattr(flexviz, name)).parameters.values() if p.name in ORDER]
    placed = [p.name for p in found if p.kind is not p.KEYWORD_ONLY and p.kind is not p.VAR_KEYWORD]
    assert placed[0] in BEGINS and placed == sorted(placed, key=ORDER.index)


def test_one_word_for_one_thing() -> None:
    words = {name: {*inspect.signature(getattr(flexviz, name)).parameters} for name in FUNCTIONS}
    assert "add_missing" not in set().union(*words.values())
    assert {name for name in FUNCTIONS if "apply" in words[name]} == {"diagnose", "record"}
    assert {name for name in FUNCTIONS if "guard" in words[name]} == {"diagnose", "write_report"}


def stopped(*_: Any) -> bool:
    return True


@pytest.mark.parametrize("given", ["demo", Path("demo")])
def test_sets_are_read_from_folders(given: Any) -> None:
    found, expected = (flexviz.identify(one, refine=False) for one in (given, flexviz.read_set("demo")))
    assert [p.value for p in found.parameters] == [p.value for p in expected.parameters]
    assert flexviz.diagnose(given, should_stop=stopped).set_name == "planar-2r-demo"
    with pytest.raises(flexviz.InputError, match="nowhere"):
        flexviz.identify("nowhere")


def test_one_name_is_a_list_of_one(demo: MeasurementSet) -> None:
    settings = flexviz.FitSettings(effects="coulomb_friction", groups="t1p1")  # type: ignore[arg-type]
    assert settings.effects == ("coulomb_friction",) and settings.groups == ("t1p1",)
    one = flexviz.identify(demo, refine=False, groups="t1p1", effects="coulomb_friction:joint2")
    assert one.groups == ("t1p1",) and one["coulomb_friction.coulomb", "joint2"].value > 0.0
    assert [group.name for group in demo.select("t2p2")[0]] == ["t2p2"]
    assert flexviz.Robot.load("robots:planar_2r", "joint2").joints == ("joint2",)
    segment = demo.groups[0].segments[0]
    run = {"time": segment.time, "theta": segment.theta[:, :1], "tau": segment.tau[:, :1]}
    given = {"a": run, "b": {**run, "tau": -run["tau"]}}
    made = MeasurementSet.from_arrays(
        "robots:planar_2r", given, joints="joint1", validation="b", effects="coulomb_friction"
    )
    assert made.joints == ("joint1",) and made.effects == ("coulomb_friction",)
    assert [group.name for group in made.validation_groups] == ["b"]


def test_a_diagnosis_takes_groups_and_effects(demo: MeasurementSet) -> None:
    settings = flexviz.FitSettings(groups=("t1p1",))
    found = flexviz.diagnose(demo, settings, effects="coulomb_friction:joint2", should_stop=stopped)
    assert [(e.effect, e.joint) for e in found.effects] == [("coulomb_friction", "joint2")]
    assert {error.name for error in found.steps[0].groups} == {"t1p1", "t4p2"}  # fitted, and held out
    with pytest.raises(flexviz.InputError, match='group "t4p2" is for validation'):
        flexviz.diagnose(demo, groups="t4p2")


@pytest.mark.parametrize(
    "options, says",
    [
        ({"observer": "eso"}, "observer has no meaning in a diagnosis"),
        ({"refine": False, "max_iterations": 3}, "refine and max_iterations have no meaning in a diagnosis"),
        ({"bandwidth": 60.0}, "expected groups and effects"),
    ],
)
def test_what_a_diagnosis_chooses_itself_is_refused(demo: MeasurementSet, options: Any, says: str) -> None:
    with pytest.raises(flexviz.InputError, match=says):
        flexviz.diagnose(demo, **options)


def test_the_old_word_of_a_stable_function_still_works(demo: MeasurementSet) -> None:
    with pytest.warns(DeprecationWarning, match="guard="):
        assert flexviz.diagnose(demo, guarded=False, should_stop=stopped).guard is None


def test_intervals_and_what_is_not_determined(demo: MeasurementSet) -> None:
    result = flexviz.identify(demo)
    one = result["stiffness", "joint1"]
    found = one.interval
    assert found.determined and one.value in found
    assert found.upper - found.lower == pytest.approx(2 * 1.96 * one.std)
    assert str(found).endswith(" Nm/rad") and " … " in str(found)
    unknown = next(p for p in result.parameters if p.identifiable == "no")
    assert str(unknown.interval) == "not determined" and not unknown.interval.determined
    assert math.isnan(unknown.interval.lower) and unknown.value not in unknown.interval
    document = flexviz.ResultDocument.from_dict(result.to_dict())
    assert document["stiffness", "joint1"].interval == found


def test_intervals_of_stiffness_without_a_limit_and_of_wide_ones() -> None:
    rigid = flexviz.ParameterEstimate(
        "stiffness", "joint1", 4e4, 9e4, "Nm/rad", identifiable="weak", rigid_above=950.0
    )
    assert rigid.interval.lower == 950.0 and rigid.interval.upper == np.inf
    assert not rigid.interval.determined and str(rigid.interval) == "not determined (above 950 Nm/rad)"
    wide = flexviz.ParameterEstimate("iyy", "joint1", 1.0, 2.0, "kg m²", identifiable="weak")
    assert str(wide.interval) == "not determined" and wide.interval.lower == pytest.approx(-2.92)
    none = flexviz.ParameterEstimate("offset", "joint1", 0.01, 0.02, "Nm", identifiable="yes")
    assert none.interval.determined and 0.0 in none.interval


def test_a_diagnosis_carries_the_numbers_of_its_criterion(diagnosed_demo: flexviz.Diagnosis) -> None:
    found = diagnosed_demo.criterion
    assert found is not None and found.joints == ("joint1", "joint2") and found.resolution == "fine"
    assert found.parameter_cost == pytest.approx(0.5 * np.log(sum(found.samples)))  # Schwarz
    assert all(least >= 1.0 for least in found.least)  # nothing below the noise counts
    assert found.effect_cost > 0.0
    document = flexviz.ResultDocument.from_dict(diagnosed_demo.to_dict())
    assert document.criterion == found
    older = {key: value for key, value in diagnosed_demo.to_dict().items() if key != "criterion"}
    assert flexviz.ResultDocument.from_dict(older).criterion is None
    assert "criterion" not in flexviz.ResultDocument.from_dict(older).to_dict()


def test_a_search_that_ends_above_the_noise_states_its_least_error_in_newton_metres(
    demo: MeasurementSet,
) -> None:
    found = flexviz.diagnose(demo, should_stop=stopped).criterion
    assert found is not None and found.resolution == "coarse"
    spread = np.array(demo.torque_spread)
    assert np.all(np.array(found.least) < 0.01 * spread) and min(found.least) > 0.0
