"""Multipliers of the gains of (s + w)⁶ and poles moved by hand, against closed forms; their picture."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from flexviz.analysis.identification import ObservedResidual
from flexviz.base.errors import InputError
from flexviz.content.view import pole_at, poles_html, residuals_html
from flexviz.content.view.poles import place_of
from flexviz.content.view.tuning import pair, score
from flexviz.model.observers import (
    EsoGains,
    binomial_gains,
    eso_poles,
    move_pole,
    multiplied,
    multipliers,
    multipliers_of_poles,
    why_unusable,
)

W = 40.0
SIX = np.full(6, -W, complex)


def test_all_multipliers_are_one_at_six_equal_poles() -> None:
    assert multipliers(binomial_gains(W), W) == pytest.approx(np.ones(6))
    assert multipliers_of_poles(SIX, W) == pytest.approx(np.ones(6))
    assert multiplied(np.ones(6), W) == pytest.approx(tuple(binomial_gains(W)))
    assert multiplied([1, 1, 1, 1, 1, 2], W)[-1] == pytest.approx(2 * W**6)


def test_multipliers_of_a_pair_and_four_poles_by_hand() -> None:
    # (u² + 2u + 2)(u + 1)⁴ = u⁶ + 6u⁵ + 16u⁴ + 24u³ + 21u² + 10u + 2, in units of w
    poles = W * np.array([-1 + 1j, -1 - 1j, -1, -1, -1, -1])
    by_hand = np.array([6, 16, 24, 21, 10, 2]) / np.array([6, 15, 20, 15, 6, 1])
    assert multipliers_of_poles(poles, W) == pytest.approx(by_hand)
    again = eso_poles(multiplied(by_hand, W))
    assert np.poly(again).real == pytest.approx(np.poly(poles).real)
    assert sorted(again.imag)[::5] == pytest.approx([-W, W])
    assert why_unusable(multiplied(by_hand, W)) is None


def test_a_pole_at_three_bandwidths_is_the_end_of_what_is_offered() -> None:
    # (u + a)(u + 1)⁵ has the constant term a
    far = multipliers_of_poles(move_pole(SIX, 0, complex(-3 * W), W), W)
    assert far[-1] == pytest.approx(3.0) and far.max() == far[-1]
    with pytest.raises(InputError, match=r"β5 would be 3\.08 times that of \(s\+w\)⁶, expected 0\.3 to 3"):
        multipliers_of_poles(move_pole(SIX, 0, complex(-3.5 * W), W), W)
    with pytest.raises(InputError, match="β6"):
        multipliers_of_poles(move_pole(SIX, 0, complex(-0.2 * W), W), W)


def test_moved_poles_stay_stable_and_conjugate() -> None:
    rng = np.random.default_rng(4)
    poles = SIX
    for _ in range(300):
        to = W * complex(rng.uniform(-3, 1), rng.uniform(-1.5, 1.5))
        poles = move_pole(poles, int(rng.integers(6)), to, W)
        assert len(poles) == 6 and poles.real.max() < 0
        gains = np.poly(poles)
        assert np.abs(gains.imag).max() <= 1e-9 * np.abs(gains).max()
        assert why_unusable(gains.real[1:].tolist()) is None


def test_a_pair_moves_together_leaves_the_axis_and_returns() -> None:
    up = move_pole(SIX, 2, W * (-0.9 + 0.5j), W)
    assert sorted(up.imag) == pytest.approx([-0.5 * W, 0, 0, 0, 0, 0.5 * W])
    lower = int(np.argmin(up.imag))
    moved = move_pole(up, lower, W * (-1.2 - 0.7j), W)  # the other one of the pair is dragged
    assert {complex(p) for p in moved if p.imag} == {W * (-1.2 + 0.7j), W * (-1.2 - 0.7j)}
    back = move_pole(moved, int(np.argmax(moved.imag)), W * (-0.8 + 0.01j), W)
    assert not back.imag.any() and sorted(back.real)[-2:] == pytest.approx([-0.8 * W] * 2)
    # only the real pole that is dragged along the axis moves
    alone = move_pole(SIX, 5, complex(-2 * W), W)
    assert sorted(alone.real) == pytest.approx([-2 * W, *[-W] * 5])
    # beyond the imaginary axis it stops before it
    assert move_pole(SIX, 0, complex(W, W), W).real.max() == pytest.approx(-0.02 * W)


def places(html: str) -> dict[str, tuple[float, float]]:
    """What the frame consists of: texts of the picture and their places."""
    found = re.findall(r'<text x="([\d.-]+)" y="([\d.-]+)"[^>]*>([^<]*)<', html)
    return {text: (float(x), float(y)) for x, y, text in found}


def test_the_picture_of_the_poles_keeps_its_frame() -> None:
    for pole in (-W + 0j, -2.5 * W + 1j * W, 0.5 * W - 0.3j * W):
        assert pole_at(*place_of(pole, W), W) == pytest.approx(pole)
    x, y = place_of(-90 * W + 0j, W)  # beyond the picture: at its edge
    assert 0 < x < 20 and y == 100
    before = poles_html(SIX, SIX, W)
    wild = eso_poles(multiplied([3, 0.3, 1, 1, 1, 3], W))
    assert places(before) == places(poles_html(wild, wild, W))
    assert before.count("data-pole=") == 6 and 'data-pole="τ' not in before
    both = poles_html(SIX, wild, W)
    assert both.count('data-pole="θ') == 6 and both.count('data-pole="τ') == 6
    assert "−40.0 (6 times)" in both


def test_the_score_is_the_residual_against_the_smallest_one() -> None:
    assert ">1.00 × least<" in score(0.2, 0.2, 0.1, 5.0) and ">1.50 × least<" in score(0.3, 0.2, 0.1, 5.0)
    assert "> 1000 × least" in score(5e3, 0.2, 0.1, 1e9) and score(0.2, math.nan, 0.1, 5.0) == ""
    # however close to its noise floor, a residual of noise is not praised
    loud = score(382.0, 0.2, 440.0, 12.0)
    assert "noise &gt; torque" in loud and "fv-bad" in loud and "least" not in loud
    assert 'title="noise 440 Nm, torque 12.0 Nm"' in loud
    assert pair(5.32, 0.0689) == "5.32 / 0.0689 Nm" and pair(0.0122, 0.0119) == "12.2 / 11.9 mNm"
    time = np.linspace(0.0, 1.0, 50)
    found = ObservedResidual(time, np.ones((50, 2)), np.array([1.0, 1.0]), np.array([0.1, 9.0]))
    html = residuals_html(found, ("a", "b"), 0, (), (0.5, 0.5), (5.0, 5.0))
    first, second = html.split("<svg")[:2]
    assert "2.00 × least" in first and "noise &gt; torque" in second
    assert EsoGains.of(multiplied(np.ones(6), W)).bandwidth == pytest.approx(W)
