"""Tables, sentences, colours, shapes and stage: what else is on the screen."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.base.facts import Fact
from flexviz.content.charts import palette as colours
from flexviz.content.rendering import panel
from flexviz.content.results import LinkSide
from flexviz.content.scene import RobotMotion
from flexviz.content.session import Analysis
from flexviz.content.topics import parameter_panel, set_blocks
from flexviz.content.view import (
    joint_effects,
    joints_html,
    joints_with,
    legend_html,
    link_colours,
    matrix_html,
    status,
    truth_values,
    with_joints,
)
from flexviz.content.wording import number, plain_name, short_names
from flexviz.content.wording.numbers import with_error
from flexviz.data.measurements import read_set
from tests.small_set import write_small_set


@pytest.mark.parametrize(
    "value, text",
    [
        (1000.0, "1000"),
        (0.012344, "0.01234"),
        (-3.2e-7, "−3.200e−7"),
        (0.0, "0"),
        (None, "–"),
        (float("nan"), "–"),
    ],
)
def test_numbers_as_people_read_them(value: Any, text: str) -> None:
    assert number(value) == text


@pytest.mark.parametrize(
    "value, error, texts",
    [
        (1000.234, 0.82, ("1000.2", "0.8")),
        (100.234, 0.82, ("100.23", "0.82")),
        (0.00123456, 0.0000123, ("0.001235", "0.000012")),
        (5.0, None, ("5.000", "–")),
        (5.0, float("inf"), ("5.000", "–")),
        (-2.5, 0.31, ("−2.50", "0.31")),
    ],
)
def test_value_and_error_end_at_the_same_digit(value: float, error: Any, texts: tuple[str, str]) -> None:
    assert with_error(value, error) == texts


def test_titles() -> None:
    assert plain_name("coulomb_friction.coulomb") == "coulomb friction"
    assert plain_name("torque_ripple.amplitude") == "torque ripple · amplitude"
    assert plain_name("motor_inertia") == "motor inertia"


@dataclass
class Parameter:
    name: str
    joint: str | None
    value: float = 1.0
    std: float | None = 0.1
    unit: str = "Nm/rad"
    start: float = 2.0
    identifiable: str = "yes"
    tied_to: tuple[str, ...] = ()
    at_bound: bool = False
    payload: str | None = None


@dataclass
class Residual:
    joints: tuple[str, ...]
    rms: Any
    rms_validation: Any
    noise_floor: Any = ()
    torque_spread: Any = ()
    groups: Any = ()
    units: Any = ()


@dataclass
class Result:
    parameters: tuple[Parameter, ...]
    residual: Any = None
    residuals: Any = None
    refined: bool = False
    link_side: tuple[LinkSide, ...] = ()


def parameters_of(*given: Any) -> str:
    return panel(parameter_panel(*given))


def test_parameter_table_says_everything_and_escapes() -> None:
    evil = '<img src=x onerror="alert(1)">'
    result: Any = Result(
        (
            Parameter("stiffness", evil, 1000.0, 0.5),
            Parameter(
                "link_viscous_friction", evil, identifiable="weak", tied_to=("motor_viscous_friction:j",)
            ),
            Parameter("izz", evil, identifiable="no", at_bound=True),
            Parameter("base_tilt.tilt_x", None),
        )
    )
    text = parameters_of(result)
    assert "<img" not in text and "&lt;img" in text
    for part in (
        "<b>1.0000</b></td><td>0.0010</td><td>kNm/rad",
        "weak",
        "tied to f_mv of j",
        "all joints",
        "Inertial parameters (1)",
        "⚑",
        "Refine removes the observer&#x27;s bias",
    ):
        assert part in text
    assert "truth" not in text and "Refine" not in parameters_of(replace(result, refined=True))
    shown = parameters_of(result, {("stiffness", evil): 1001.5})
    assert "truth" in shown and ">1.002<" in shown
    assert "after Run" in parameters_of(None)


def test_link_encoder_stands_below_the_stiffness() -> None:
    entry = LinkSide(
        joint="j",
        torque="computed",
        stiffness=1e7,
        low=8e6,
        high=1.2e7,
        hysteresis=0.0,
        lag=0.0,
        agrees=False,
    )
    result: Any = Result((Parameter("stiffness", "j", 1e6, 1e5),), link_side=(entry,))
    shown = parameters_of(result)
    assert "10.0 (8.00 … 12.0) MNm/rad, do not trust the motor side</b>" in shown
    agreeing = parameters_of(replace(result, link_side=(replace(entry, agrees=True),)))
    assert "link encoder" in agreeing and "do not trust" not in agreeing


def test_truth_values_from_a_simulation() -> None:
    document = {
        "parameters": [
            {"name": "stiffness", "joint": "a", "value": 900},
            {"name": "link_viscous_friction", "joint": "a", "value": 1.0},
            {"name": "motor_viscous_friction", "joint": "a", "value": 0.5},
        ],
        "effects": [{"effect": "backlash", "joint": "a", "parameters": {"half_width": {"value": 0.002}}}],
    }
    tipped = {"effect": "payload_error", "payload": "p2", "parameters": {"relative_mass_error": 0.1}}
    document["effects"].append(tipped)
    values = truth_values(document)
    assert values["payload_error.relative_mass_error", "p2"] == 0.1
    assert values["stiffness", "a"] == 900.0 and values["backlash.half_width", "a"] == 0.002
    assert values["viscous_friction_sum", "a"] == 1.5


def test_set_summary(tmp_path: Path) -> None:
    measurements = read_set(write_small_set(tmp_path / "small"))
    text = panel(set_blocks(measurements))
    for part in ("2 joints", "3 groups", "500 Hz", "coulomb friction", "given: replayed"):
        assert part in text
    assert (
        "simulated" not in text
        and "simulated data" in panel(set_blocks(replace(measurements, simulated=True))).lower()
    )
    warned = replace(measurements, warnings=(Fact("x", values={"text": "<b>x</b>"}),))
    assert "<b>x</b>" not in panel(set_blocks(warned))


def test_status_names_step_and_error() -> None:
    assert status.error_text(None, None) == "no model yet"
    result: Any = Result((), Residual(("a", "b"), [9.0, 9.0], [9.0, 9.0]))
    validated: Any = Residual(("a", "b"), [0.3, 0.4], [0.012, 0.012])
    assert status.error_text(result, validated) == "validation error 12.0 mNm, most on a: 12.0 mNm"
    result.residual.torque_spread = (0.1, 0.4)
    assert status.error_text(result, validated) == (
        "validation error 7.50 % of the torque, most on a: 12.0 % (12.0 mNm)"
    )
    measured: Any = Residual(("a", "b"), [0.3, 0.4], [0.012, 0.012], noise_floor=(0.01, 0.002))
    text, hover = status.stated_error(result, measured)
    assert text == "validation error 7.50 % of the torque, most on a: 12.0 %"
    assert hover == "12.0 mNm; noise: 5.25 %, 7.21 mNm"
    line = status.status_html("Identify", "", text, "", hover)
    assert f'title="{hover}"' in line and "<span>12.0 %</span>" in line
    result.residual.torque_spread = ()
    fitted: Any = Residual(("a", "b"), [0.3, 0.4], None)
    assert status.error_text(result, fitted).startswith("fit error 0.354 Nm")
    unknown: Any = Residual(("a", "b"), [0.3, 0.4], [float("nan"), 1.0])
    assert status.error_text(result, unknown).startswith("fit error")
    assert status.error_text(result, None) == "computing the error"
    assert "cannot" in status.stated_error(result, None, failed=True)[0]
    line = status.status_html("Identify", "<script>", "validation error 0.012 Nm", "busy")
    assert "Step Identify" in line and "<script>" not in line and "busy" in line

    # the first number counts down when an effect is added
    assert re.findall(r'data-fv-count="error">([^<]*)<', line) == ["0.012"]
    assert "data-fv-count" not in status.status_html("Data", "12 s", "no model yet")


def test_the_first_sentence_says_how_wrong_the_model_is() -> None:
    fitted: Any = Analysis(Path("set"), roles=(("g", "fit"),))
    residual = Residual(("a<1>", "b"), (0.1, 0.6), None, torque_spread=(1.0, 4.0))
    result: Any = Result((), residual)
    assert status.worst_joint(None) == 0 and status.worst_joint(result) == 1
    errors = errors_of(0.1, 0.6)
    spread = (1.0, 4.0)
    assert status.wrong_html(fitted, errors, ("a<1>", "b"), spread) == ""  # no model yet
    fitted = fitted.with_identification(result, fitted.settings)
    said = status.wrong_html(fitted, errors, ("a<1>", "b"), spread)
    assert re.sub("<[^>]*>", "", said) == "This arm's model is wrong by 15 % on b. Find out why."
    other = status.wrong_html(fitted, errors_of(0.3, 0.6), ("a<1>", "b"), spread)
    assert "30 % on a&lt;1&gt;" in other
    assert "0.600 Nm on b" in status.wrong_html(fitted, errors, ("a<1>", "b"), ())
    # near the noise nothing is wrong; of an earlier model nothing is said
    assert status.wrong_html(fitted, errors_of(0.02, 0.06), ("a<1>", "b"), spread) == ""
    assert status.wrong_html(fitted, None, ("a<1>", "b"), spread) == ""
    assert status.wrong_html(fitted.with_fit(observer="eso"), errors, ("a<1>", "b"), spread) == ""


def test_step_line_marks_where_one_is() -> None:
    line = status.step_line_html(("Data", "Observer", "Identify", "Diagnose"), "Observer", ("Data",))
    assert "1 Data ✓" in line and "2 Observer ●" in line and "4 Diagnose<" in line


def errors_of(*rms: float) -> Any:
    """Errors of two joints in group g<1>, above a noise of 0.01 and 0.02 Nm."""
    return Residual(("a", "b"), rms, None, groups=(("g<1>", rms, False),), noise_floor=(0.01, 0.02))


def test_links_at_the_noise_are_dark_and_the_scale_keeps_its_end() -> None:
    spread = (2.0, 4.0)  # [Nm]
    bad = link_colours(errors_of(0.011, 0.4), spread)
    assert bad is not None and bad.end == pytest.approx(10.0)  # % of the torque
    assert bad.colours[1] == colours.cividis(1.0) and sum(bad.colours[0]) < sum(colours.cividis(0.1))
    good = link_colours(errors_of(0.0101, 0.021), spread, [errors_of(0.011, 0.4)])
    assert good is not None and good.end == bad.end
    assert all(sum(colour) < sum(colours.cividis(0.1)) for colour in good.colours)
    # without an earlier model, errors near the noise are not stretched over the whole scale
    alone = link_colours(errors_of(0.0101, 0.021), spread)
    assert alone is not None and all(sum(colour) < sum(colours.cividis(0.3)) for colour in alone.colours)
    assert link_colours(None, spread) is None


def test_the_brightest_link_has_the_largest_share_of_its_torque() -> None:
    # as in the status line: 11 % against 10 %, whatever the noise
    found = link_colours(errors_of(0.11, 0.4), (1.0, 4.0))
    assert found is not None and found.errors.shares == pytest.approx([11.0, 10.0])
    assert found.colours == [colours.cividis(one / 11.0) for one in found.errors.shares]
    unknown = replace(errors_of(0.11, 0.4), noise_floor=())
    shares = link_colours(unknown, (1.0, 4.0))
    assert shares is not None and shares.colours[0] == colours.cividis(1.0)
    constant = link_colours(unknown, (0.0, 4.0))
    assert constant is not None and constant.colours[0] == colours.COLOURS.body


def test_legend_has_numbers_and_colours() -> None:
    assert "after Run" in legend_html(None)
    found = link_colours(errors_of(0.1, 0.25), (2.0, 4.0))
    text = legend_html(found, ("model 0", "model <1>"))
    assert "model &lt;1&gt;" in text and "Link: error [% of the torque]" in text
    motion = RobotMotion("g", np.array([0.0, 1.0]), np.zeros((2, 2)), None, "unknown")
    html = joints_html(("a", "b"), found, motion, 0.5)
    table = re.sub(r"<[^>]*>", " ", html).split()
    assert table[table.index("a") + 1] == "5.00" and table[table.index("b") + 1] == "6.25"
    assert 'title="0.250 Nm; noise: 0.500 %, 20.0 mNm"' in html
    assert "error 6.25 % of the torque (0.250 Nm)" in html and "◂" not in html
    marked = joints_html(("a", "b"), found, motion, 0.5, missing={"b": "Backlash"})
    first, second = marked.split("<tr ")[1:]
    assert "◂" not in first and "◂" in second and "missing: Backlash" in second


def test_a_deflection_that_is_not_determined_is_hatched() -> None:
    deflection = np.full((2, 2), 0.01)
    motion = RobotMotion(
        "g", np.array([0.0, 1.0]), np.zeros((2, 2)), deflection, "identified", torque=deflection,
        determined=np.array([True, False]),
    )  # fmt: skip
    html = joints_html(("a", "b"), None, motion, 0.5)
    first, second = html.split("<tr ")[1:]
    assert "fv-hatched" not in first and "deflection 10.0 mrad" in first
    assert "fv-hatched" in second and "deflection not determined" in second
    measured, _ = motion.pose(0.5, deflection=10.0)
    assert measured == pytest.approx([-0.1, 0.0])


def test_joints_are_named_shortly_where_that_is_clear() -> None:
    assert short_names(("panda_joint1", "panda_joint2")) == ["joint1", "joint2"]
    assert short_names(("joint_1", "joint_2")) == ["joint_1", "joint_2"]
    assert short_names(("only_one",)) == ["only_one"]


def test_truth_is_told_only_when_asked_for() -> None:
    truth: dict[tuple[str, str | None], float]
    truth = {("stiffness", "j1"): 900.0, ("coulomb_friction.coulomb", "j1"): 3.0}
    assert "Truth" not in parameters_of(None)
    assert "coulomb friction of j1 3" in parameters_of(None, truth)
    assert "no effect was hidden" in parameters_of(None, {("stiffness", "j1"): 900.0})


def test_effects_joint_by_joint() -> None:
    joints = ("a", "b", "c")
    one = with_joints("coulomb_friction", ("b",), ("torque_offset",), joints)
    assert one == ("torque_offset", "coulomb_friction:b") and joints_with(
        "coulomb_friction", one, joints
    ) == ("b",)
    every = with_joints("coulomb_friction", joints, one, joints)  # ticked on all joints it has one name
    assert every == ("torque_offset", "coulomb_friction")
    assert with_joints("coulomb_friction", ("a", "c"), every, joints)[1:] == (
        "coulomb_friction:a",
        "coulomb_friction:c",
    )
    assert with_joints("coulomb_friction", (), every, joints) == ("torque_offset",)
    text = matrix_html(("torque_ripple",), one, joints)
    rows = {row[0]: row[1:] for row in (re.findall(r"<td>(.*?)</td>", row) for row in text.split("<tr>")[2:])}
    assert rows == {
        "Torque ripple": ["●"] * 3,
        "Torque offset": ["✓"] * 3,
        "Coulomb friction": ["·", "✓", "·"],
    }
    assert matrix_html((), (), joints) == "" and "base_tilt" not in joint_effects()
