"""Tuning the observer: what a person reads while the bandwidth is dragged and gains are set by hand."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from tests.browser.page import (
    SOON,
    button,
    chart,
    choose,
    dark,
    labels,
    pause,
    pixels,
    row,
    status,
    tick,
    unfold,
    until,
    well_laid_out,
)

pytestmark = pytest.mark.browser


CARD = re.compile(r"(\w+)\s+(?:([\d.]+) × least|(noise > torque))\s+([\d.]+) / ([\d.]+) ([mkM]?)Nm")


def cards(page: Any) -> dict[str, tuple[float, float, float]]:
    """Joint -> rms ÷ least (NaN: the noise exceeds the torque), rms and noise [Nm], as the cards say."""
    out = {}
    for text in page.locator(".fv-multiple").all_inner_texts():
        if found := CARD.search(text.replace("\n", " ")):
            name, times, _, rms, floor, prefix = found.groups()
            unit = {"m": 1e-3, "": 1.0, "k": 1e3, "M": 1e6}[prefix]
            out[name] = float(times or "nan"), unit * float(rms), unit * float(floor)
    return out


def headline(page: Any, joint: str) -> np.ndarray:
    """The colours of the headline of a card, (M, 3)."""
    card = page.locator(".fv-multiple").filter(has_text=joint)
    return pixels(page, card.locator("b").bounding_box()).reshape(-1, 3)


def red(seen: np.ndarray) -> int:
    """How many of these colours are red."""
    return int(np.count_nonzero((seen[:, 0] > 140) & (seen[:, 1] < 0.65 * seen[:, 0])))


LINES = """start => Object.values(window.__viserTestpoints.uplots).map(u => u.chart)
    .filter(u => u.root.querySelector('.u-title').textContent.startsWith(start))
    .map(u => u.series.slice(1).map(s => s.label))[0]"""


def width(page: Any) -> float:
    """The bandwidth in use [rad/s]."""
    found = re.search(r"bandwidth ([\d.]+) rad/s", page.inner_text("body"))
    return float(found[1]) if found else float("nan")


@pytest.mark.slow
def test_the_trade_is_seen_while_dragging(page: Any, shot: Any) -> None:
    pause(page)
    button(page, "Observer").click()
    until(lambda: "After Run (step Identify)" in page.inner_text("body"), 60, "the hint")
    identified(page)
    # a click is lost where the page is just drawn anew with the result
    first = until(lambda: cards(page) or button(page, "Observer").click(), 60, "the residuals")
    assert list(first) == ["joint1", "joint2"]
    before = width(page)
    # the smallest residual of the bandwidths that are tried meanwhile is the measure
    until(lambda: max(chart(page, "What a bandwidth costs, joint1")[0]) >= 2000, 60, "the trade")
    w, rms, noise, *_ = chart(page, "What a bandwidth costs, joint1")
    assert min(w) <= 10 and max(w) >= 2000 and all(a > 0.9 * b for a, b in zip(rms, noise, strict=True))
    first = cards(page)
    assert first["joint1"][0] == pytest.approx(first["joint1"][1] / min(rms), rel=0.02)
    assert 1.0 <= first["joint1"][0] < 1.5 and not red(headline(page, "joint1"))
    assert page.evaluate(LINES, "Residual, joint1")[:2] == ["as identified", "with this observer"]
    shot(page, "trade")

    # the widest band leaves noise only, which is red; the large plot follows, and Undo takes it back
    largest = max(map(abs, chart(page, "Residual, joint1")[2]))
    slider = row(page, "Bandwidth [rad/s]").get_by_role("slider")
    slider.focus()
    page.keyboard.press("End")
    until(lambda: width(page) == 2000, 60, "the slider")
    until(lambda: np.isnan(cards(page)["joint1"][0]), 60, "the verdict on it")
    _, loud, floor = cards(page)["joint1"]
    assert floor > 1e3 * first["joint1"][2] and loud == pytest.approx(floor, rel=0.1)
    until(lambda: red(headline(page, "joint1")) > 20, SOON, "a red headline")
    until(lambda: max(map(abs, chart(page, "Residual, joint1")[2])) > 1e3 * largest, SOON, "the large plot")
    shot(page, "noise")
    button(page, "Undo").click()
    until(lambda: cards(page) == first and width(page) == before, 60, "the bandwidth before the drag")
    until(lambda: max(map(abs, chart(page, "Residual, joint1")[2])) == largest, SOON, "the plot before")
    button(page, "Identify").click()
    until(lambda: page.evaluate(LINES, "Residual, joint1")[0] == "residual", SOON, "the fit's own residual")


POLES = """() => [...document.querySelectorAll('.fv-poles [data-pole]')].map(g => {
    const r = g.lastChild.getBoundingClientRect();
    return [(r.left + r.right) / 2, (r.top + r.bottom) / 2];
})"""
FRAME = """() => [...document.querySelectorAll('.fv-poles text')].map(t => {
    const r = t.getBoundingClientRect(), box = t.ownerSVGElement.getBoundingClientRect();
    return [t.textContent, Math.round(r.left - box.left), Math.round(r.top - box.top)];
})"""
MIDDLE = "() => document.querySelector('.fv-poles').scrollIntoView({block: 'center'})"


def resting(page: Any) -> list[list[float]]:
    """Where the poles are on the page, once nothing above them moves any more."""
    found: list[list[float]] = []

    def rests() -> bool:
        page.evaluate(MIDDLE)
        before, found[:] = list(found), page.evaluate(POLES)
        page.wait_for_timeout(500)
        return bool(found) and before == found

    until(rests, 60, "poles that rest")
    return found


def identified(page: Any) -> None:
    """Identify the model, unless another test has."""
    if "no model yet" in status(page):
        button(page, "Identify").click()
        button(page, "Run").click()
        until(lambda: not button(page, "Stop").is_enabled() and "converged" in status(page), what="a result")


def factor(page: Any, gain: int, signal: str = "θ") -> float:
    """A multiplier, as its slider says."""
    return float(row(page, f"β{gain} {signal} ×").get_by_role("textbox").first.input_value())


def body(page: Any) -> str:
    return page.inner_text("body").replace("\n", " ")


@pytest.mark.slow
def test_gains_are_set_by_hand(address: str, open_page: Any, shot: Any) -> None:
    page = open_page(address, 1280, 800)
    identified(page)
    button(page, "Observer").click()
    choose(page, "Observer type", "eso")
    unfold(page, "Gains of the ESO", labels(page, "β5 θ ×"))
    until(lambda: "Poles of θ: −20.0 (6 times); of τ: the same" in body(page), 60, "the poles")
    until(button(page, "Use these gains").is_disabled, SOON, "no use of these")
    until(lambda: cards(page) or button(page, "Observer").click(), 60, "the residuals")
    assert [factor(page, i) for i in range(1, 7)] == [1.0] * 6
    a_pole_is_dragged(page, shot, "light")
    the_pole_stays_where_no_gain_places_it(page)
    unstable_gains_cannot_be_used(page, shot, "light")
    stable_ones_can(page, shot, "light")
    button(page, "Use these gains").click()
    until(lambda: "gains set by hand" in body(page) and factor(page, 1, "τ") == 1.1, 60, "the gains in use")
    button(page, "Undo").click()
    until(lambda: "gains set by hand" not in body(page), 60, "the undo")
    button(page, "Redo").click()
    until(lambda: "gains set by hand" in body(page), 60, "the redo")
    back(page)
    until(lambda: "gains set by hand" not in body(page), 60, "(s+w)⁶")
    # what is coloured, in the dark theme
    until(row(page, "Same gains for θ and τ").get_by_role("checkbox").is_checked, SOON, "its tick")
    dark(page, back_to="Observer")
    unfold(page, "Gains of the ESO", labels(page, "β5 θ ×"))
    a_pole_is_dragged(page, shot, "dark")
    back(page)
    unstable_gains_cannot_be_used(page, shot, "dark")
    stable_ones_can(page, shot, "dark")


def back(page: Any) -> None:
    """Back to (s+w)⁶."""
    button(page, "Back to (s+w)^6").click()
    until(lambda: "−20.0 (6 times)" in body(page), SOON, "(s+w)⁶")
    until(lambda: all(factor(page, gain) == 1.0 for gain in range(1, 7)), SOON, "its factors")


def a_pole_is_dragged(page: Any, shot: Any, theme: str) -> None:
    """Off the axis: its conjugate, the sliders and the large plot follow, the frame stays."""
    fitted = chart(page, "Residual, joint1")
    x, y = resting(page)[0]
    frame = page.evaluate(FRAME)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 10, y - 20, steps=3)
    page.mouse.move(x + 20, y - 40, steps=3)
    pair = r"Poles of θ: −1\d\.\d ± 1\d\.\di, −20\.0 \(4 times\)"
    until(lambda: re.search(pair, body(page)), SOON, "a pair")
    until(lambda: chart(page, "Residual, joint1")[2] != fitted[2], SOON, "the large plot, still dragging")
    shot(page, f"dragging-{theme}")
    page.mouse.up()
    # w − a and b of the pair by the picture's scale; the closed form of (u² + 2au + a² + b²)(u + 1)⁴
    a, b = (float(part) for part in re.search(r"θ: −([\d.]+) ± ([\d.]+)i", body(page)).groups())  # type: ignore[union-attr]
    assert factor(page, 1) == pytest.approx((2 * a / 20 + 4) / 6, abs=0.02)
    assert factor(page, 6) == pytest.approx((a**2 + b**2) / 400, abs=0.02)
    assert page.evaluate(FRAME) == frame
    lower, upper = sorted(point[1] for point in page.evaluate(POLES))[::5]
    assert (lower + upper) / 2 == pytest.approx(y, abs=1.5)


def the_pole_stays_where_no_gain_places_it(page: Any) -> None:
    """No gain from .3 to 3; why is said."""
    x, y = max(resting(page), key=lambda point: -point[1])
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 120, y - 40, steps=4)
    page.mouse.up()
    why = r"The pole stays: β\d would be [\d.]+ times that of \(s\+w\)⁶"
    until(lambda: re.search(why, body(page)), SOON, "why")
    back(page)


def unstable_gains_cannot_be_used(page: Any, shot: Any, theme: str) -> None:
    for gain, end in ((2, "Home"), (4, "End")):
        row(page, f"β{gain} θ ×").get_by_role("slider").focus()
        page.keyboard.press(end)
    until(lambda: "make the observer unstable" in body(page), SOON, "the refusal")
    until(button(page, "Use these gains").is_disabled, SOON, "no use of these")
    shot(page, f"gains-unstable-{theme}")
    back(page)


def stable_ones_can(page: Any, shot: Any, theme: str) -> None:
    """For τ apart; they are not used yet."""
    tick(page, "Same gains for θ and τ", False)
    typed = row(page, "β1 τ ×").get_by_role("textbox").first
    typed.fill("1.1")
    typed.press("Enter")
    until(lambda: button(page, "Use these gains").is_enabled(), 60, "usable gains")
    well_laid_out(page)
    shot(page, f"gains-{theme}")
