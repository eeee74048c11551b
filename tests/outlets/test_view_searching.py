"""What is shown while the missing effect is looked for: the matrix that fills in, the residual so far."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from flexviz.analysis.diagnosis import BestModel
from flexviz.content.view import alone_html, search_charts, worst_joint_so_far

JOINTS = ("arm_joint1", "arm_joint2", "arm_joint3")
TIME = np.linspace(0.0, 2.0, 50, dtype=np.float32)
ALONE = {
    "coulomb_friction:arm_joint1": 0.621,
    "coulomb_friction:arm_joint2": 0.04,
    "backlash:arm_joint2": 0.3,
    "base_tilt": 0.11,
    "payload_error:p2": 0.2,
    "torque_ripple:arm_joint1": 0.001,
}


def best(effects: tuple[str, ...], scale: float) -> BestModel:
    residual = np.float32(scale) * np.stack((0.1 * TIME, -TIME, 0.5 * TIME), axis=1)
    parameters: Any = None
    return BestModel((), {}, effects, parameters, {"g1": (TIME, residual)})


def rows(html: str) -> dict[str, list[str]]:
    """Name → cells of every row of the matrix."""
    lines = (re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row) for row in re.findall(r"<tr>(.*?)</tr>", html))
    return {name: cells for name, *cells in lines}


def test_the_matrix_has_the_largest_shares_first_and_ticks_the_leading_candidate() -> None:
    html = alone_html(ALONE | {"backlash:arm_joint3": 0.0}, ("backlash:arm_joint2",), JOINTS)
    assert rows(html) == {
        "": ["1", "2", "3"],
        "Coulomb friction": ["62", "4", "·"],
        "Backlash": ["·", "30✓", "0"],
        "Payload error on p2": ["20"],
        "Base tilt": ["11"],
    }
    assert (
        'title="Coulomb friction, arm_joint1: 62.1 %"' in html and "1 more effect would remove less" in html
    )


def test_a_joint_that_is_still_to_come_has_dots() -> None:
    html = alone_html({"coulomb_friction:arm_joint1": 0.621}, (), JOINTS)
    assert rows(html)["Coulomb friction"] == ["62", "…", "…"]
    assert alone_html({}, (), JOINTS) == ""


def test_long_names_of_joints_stand_upright() -> None:
    joints = ("shoulder_pan_joint", "elbow_joint")
    html = alone_html({"coulomb_friction:elbow_joint": 0.5}, (), joints)
    assert rows(html)[""] == ["shoulder_pan_joint", "elbow_joint"] and "fv-tall" in html


def test_the_search_begins_at_the_worst_joint_so_far() -> None:
    assert worst_joint_so_far(best((), 1.0), (1.0, 1.0, 1.0)) == 1
    assert worst_joint_so_far(best((), 1.0), (1.0, 100.0, 1.0)) == 2  # relative to the torque


def test_the_residual_falls_on_the_axis_of_the_first_model() -> None:
    first, span = best((), 1.0), (0.0, 2.0)
    (chart,) = search_charts(first, first, None, 1, "arm_joint2", "g1", span)
    (line,) = chart.series
    assert line.y == pytest.approx(-TIME) and chart.y.limits == pytest.approx((-2.1, 2.1))
    (later,) = search_charts(first, best(("backlash:arm_joint2",), 0.1), None, 1, "arm_joint2", "g1", span)
    grey, present = later.series
    assert later.y.limits == chart.y.limits and present.y == pytest.approx(-0.1 * TIME)
    assert grey.y == pytest.approx(-TIME) and (grey.label, present.label) == (
        "the model so far",
        "with the leading candidate",
    )
