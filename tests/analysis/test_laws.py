"""The law of every effect through its data: the points lie on the right law and not on a wrong one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexviz.analysis.identification import identify
from flexviz.analysis.laws import VARIABLES, LawThroughData, laws_of, variable_of
from flexviz.analysis.laws.bins import binned, tukey
from flexviz.analysis.laws.variables import path_after
from flexviz.content.charts import COLOURS
from flexviz.content.view import law_chart, law_charts
from flexviz.data.measurements import MeasurementSet, read_set
from flexviz.model.effects import EFFECTS
from flexviz.model.simulation import make_plan, simulate_plan, write_plan
from tests.cases import with_slow
from tests.planar_arm import TWO, of_groups

SECONDS = 4.0  # of each of the two groups
RIGHT, WRONG = 8.0, 12.0  # mean square deviation in standard errors, at most and at least
OTHER = {"torque_gain": "directional_friction", "payload_error": "torque_ripple"}  # wrong: torque gain
CASES = {  # effect → what is simulated and identified; others on joint 2 alone
    "coupled_friction": ("coupled_friction:joint1",),
    "motor_coupling": ("motor_coupling:joint1",),
    "payload_error": ("payload_error:p2",),
    "torque_delay": ("torque_delay",),
    "base_tilt": ("base_tilt",),
    "stribeck_friction": ("coulomb_friction:joint2", "stribeck_friction:joint2"),
    "startup_friction": ("coulomb_friction:joint2", "startup_friction:joint2"),
    "external_contact": ("external_contact:joint2:torque=4:start=1.5:end=2.5",),
}
# the instants of their jumps are not measured exactly, or there is hardly a rest to start from
UNRESOLVED = {"backlash", "link_coulomb_friction", "coupled_friction", "startup_friction"}
QUICK = {
    "coulomb_friction", "torque_delay", "backlash", "torque_ripple", "gravity_compensator", "payload_error",
}  # fmt: skip


def simulated(effect: str, folder: Path) -> tuple[MeasurementSet, tuple[str, ...]]:
    """A set with the effect, and the effects of the right model."""
    wanted = CASES.get(effect, (f"{effect}:joint2",))
    robot, names = ("panda", ("t1p1",)) if effect == "base_tilt" else ("planar-2r", TWO)
    plan = of_groups(make_plan(robot, list(wanted)), names, SECONDS)
    right = tuple(":".join(text.split(":")[:2]) for text in wanted)
    if effect == "external_contact":
        right = (f"{right[0]}@t1p1",)
    return read_set(write_plan(plan, simulate_plan(plan, 1), folder, 1)), right


def last_law(measurements: MeasurementSet, effects: tuple[str, ...], refine: bool) -> LawThroughData:
    found = identify(measurements, effects=effects, refine=refine)
    return laws_of(measurements, found.model, effects, found.chance_covariance)[-1]


@pytest.mark.parametrize("effect", with_slow(EFFECTS, EFFECTS.keys() - QUICK))
def test_the_data_lie_on_the_right_law_only(effect: str, tmp_path: Path) -> None:
    measurements, right = simulated(effect, tmp_path / "set")
    law = last_law(measurements, right, refine=True)
    assert law.effect == effect and law.variable == variable_of(EFFECTS[effect]).name
    assert len(law.at) > 4 and np.all(np.diff(law.at) > 0) and np.all(law.data_std >= law.noise)
    at, line, _ = law.line
    rises = np.abs(np.diff(line)).sum()  # a line is drawn, not a scatter: at most two waves
    assert np.all(np.diff(at) > 0) and rises <= 4 * np.ptp(line) + 0.01 * np.abs(line).max()
    if effect in UNRESOLVED:  # what the sensors' noise does not explain is in the error of the data
        squares = (law.data - law.law) ** 2 / (law.data_std**2 + law.law_std**2)
        assert np.median(squares) < 0.5 * RIGHT
    else:
        assert law.chi_square < RIGHT and law.leftover < 1.2
    other = OTHER.get(effect, "torque_gain")
    wrong = last_law(measurements, (f"{other}:{measurements.joints[1]}",), refine=False)
    assert wrong.chi_square > WRONG and wrong.leftover > 1.5


def test_what_is_drawn_is_known() -> None:
    """Every effect names a variable, every variable is of some effect or of a free curve."""
    named = {effect.plot_against for effect in EFFECTS.values()}
    assert "" not in named and named <= VARIABLES.keys()
    assert VARIABLES.keys() - named <= {"velocity", "position", "torque", "time"}


def test_bins_and_paths() -> None:
    """Edges at zero, nothing where the weight is zero or the variable unknown; paths begin at each event."""
    at, per = np.array([-2.0, -1.0, -0.01, 0.01, 1.0, 3.0, np.nan, 2.0]), np.ones(8)
    per[7] = 0.0
    (index,) = binned([at], [per], 4)
    assert index[6] == index[7] == -1 and index[2] < index[3] and index.max() == 3 and index[0] == 0
    position, event = np.array([0.0, 1.0, 3.0, 2.0, 2.5]), np.array([False, True, False, True, False])
    np.testing.assert_allclose(path_after(position, event, 9.0), [np.nan, 0.0, 2.0, 0.0, 0.5])
    assert np.isnan(path_after(position, event, 1.0)[2])
    window = tukey(11, 4.0)
    assert window[5] == 1.0 and 0 < window[0] < 0.1 and np.array_equal(window, window[::-1])


def test_the_chart_says_what_is_drawn(tmp_path: Path) -> None:
    measurements, right = simulated("backlash", tmp_path / "set")
    law = last_law(measurements, right, refine=False)
    chart = law_chart(law)
    assert chart.x.text == "transmitted torque of joint2 [Nm]"
    assert chart.y.text == "deflection beyond s/K [mrad]"
    (line, data), (of_data, of_law) = chart.series, chart.ribbons
    assert (line.colour, data.colour) == (COLOURS.model, COLOURS.measured) and data.points and not line.points
    np.testing.assert_allclose(data.y, 1e3 * law.data)
    assert np.all(of_data.low <= data.y) and np.all(of_law.high >= line.y)
    assert "Data and law differ by" in chart.description
    assert len(law_charts(None, [law, law], "joint2")) == 1
    assert not law_charts(None, [law], "joint1")
