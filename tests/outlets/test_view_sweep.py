"""The sweep's bandwidths and plots, and the words about effects, without a screen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexviz.analysis.identification import SweepResult
from flexviz.content.view.effects import (
    COMMON_EFFECTS,
    addable_effects,
    effects_note,
    more_effects,
    why_fixed,
)
from flexviz.content.view.fit_charts import (
    MIN_STIFFNESS_SPAN,
    SWEEP_COUNT,
    rounded,
    scaled,
    stiffness_limits,
    sweep_bandwidths,
    sweep_charts,
    sweep_html,
)
from flexviz.model.effects import EFFECTS
from flexviz.outlets.app.uplot import columns


def result(order: list[int] | None = None) -> SweepResult:
    """A sweep of two joints whose minima lie at 20 and 40 rad/s."""
    rows = order or [0, 1, 2, 3]
    w = np.array([10.0, 20.0, 40.0, 80.0])[rows]
    validation = np.array([[2.0, 5.0], [1.0, 4.0], [1.5, 3.0], [3.0, 9.0]])[rows]
    stiffness = np.array([[1000.0, 500.0], [1000.1, 510.0], [999.9, 520.0], [1000.0, 530.0]])[rows]
    return SweepResult("eso", w, 0.9 * validation, validation, stiffness, np.ones((4, 2)), 40.0)


@pytest.mark.parametrize("present", [5.0, 31.4, 700.0, 2000.0])
def test_bandwidths_surround_the_present_one_within_the_limits(present: float) -> None:
    widths = sweep_bandwidths(present, 5.0, 2000.0)
    assert len(set(widths)) == SWEEP_COUNT and list(widths) == sorted(widths)
    assert widths[0] >= 5.0 and widths[-1] <= 2000.0 and widths[0] <= present <= widths[-1]
    if present == 31.4:
        assert widths[SWEEP_COUNT // 2] == present


@pytest.mark.parametrize("order", [None, [3, 1, 0, 2]])
@pytest.mark.parametrize(("joint", "least"), [(0, 20.0), (1, 40.0)])
def test_the_mark_is_a_vertical_line_at_the_joints_minimum(
    order: list[int] | None, joint: int, least: float
) -> None:
    residual, stiffness = sweep_charts(result(order), joint, "j")
    assert residual.marker == stiffness.marker == least
    x, *_, mark = drawn = columns(residual)
    at = int(mark.argmax())
    assert mark.sum() == 1 and list(x[at - 1 : at + 2]) == [least] * 3
    assert list(x) == sorted(x) and len(drawn) == 4
    assert [series.label for series in residual.series] == ["fit", "validation"]
    assert f"{least:g}" in sweep_html(result(order), joint, "j")


def test_without_validation_the_fit_decides() -> None:
    alone = replace(result(), rms_validation=np.full((4, 2), np.nan))
    residual, _ = sweep_charts(alone, 0, "<j>")
    assert [series.label for series in residual.series] == ["fit"]
    assert "least fit residual" in sweep_html(alone, 0, "<j>") and "<j>" not in sweep_html(alone, 0, "<j>")


def test_one_bandwidth_is_a_plot_too() -> None:
    full = result()
    one = replace(
        full,
        bandwidths=full.bandwidths[:1],
        rms_fit=full.rms_fit[:1],
        rms_validation=full.rms_validation[:1],
        stiffness=full.stiffness[:1],
        best=10.0,
    )
    for chart in sweep_charts(one, 0, "j"):
        low, high = chart.x.limits or (0.0, 0.0)
        assert low <= 10.0 <= high and low < high
    assert "end of the sweep" not in sweep_html(one, 0, "j")


def test_axes_have_round_limits_and_do_not_enlarge_what_stands_still() -> None:
    assert rounded(10.47, 94.2) == pytest.approx((8.0, 100.0))
    assert rounded(5.0, 15.0) == pytest.approx((4.0, 20.0))
    low, high, logarithmic = stiffness_limits(np.array([999.9, 1000.1]))
    assert not logarithmic
    assert high - low == pytest.approx(MIN_STIFFNESS_SPAN * 1000.0)
    low, high, _ = stiffness_limits(np.array([900.0, 1100.0]))
    assert low < 900.0 and high > 1100.0
    assert stiffness_limits(np.array([900.0, 1000.0, 5e9])) == (
        100.0,
        1e10,
        True,
    )  # the last one at its bound


def test_large_numbers_get_a_prefix() -> None:
    large = replace(result(), stiffness=1000.0 * result().stiffness)
    chart = sweep_charts(large, 0, "j")[1]
    assert "[kNm/rad]" in chart.heading and chart.series[0].y == pytest.approx(1000.0, rel=1e-3)
    assert scaled(5e9) == (1e-6, "M") and scaled(50.0) == (1.0, "")


def test_every_effect_is_offered_once_except_episodes() -> None:
    listed = [*COMMON_EFFECTS, *(name for names in more_effects().values() for name in names)]
    assert sorted(listed) == sorted(addable_effects()) == sorted(set(EFFECTS) - {"external_contact"})


def test_what_is_said_about_effects() -> None:
    assert "replaces Coulomb friction" in effects_note(("presliding_hysteresis",), ("coulomb_friction",))
    assert "needs Coulomb friction in the model" in effects_note(("stribeck_friction",), ())
    assert effects_note(("stribeck_friction", "coulomb_friction"), ()) == ""
    assert why_fixed("payload_error", (), payloads=False) and not why_fixed(
        "payload_error", (), payloads=True
    )
    assert "stays in" in why_fixed("torque_offset", ("torque_offset",), payloads=True)
