"""Tuning the observer: what a person reads while the bandwidth is dragged and gains are set by hand."""

from __future__ import annotations

import re
from typing import Any

import pytest

from tests.browser.page import (
    SOON,
    button,
    chart,
    choose,
    labels,
    pause,
    row,
    tick,
    unfold,
    until,
    well_laid_out,
)

pytestmark = pytest.mark.browser


def cards(page: Any) -> dict[str, tuple[float, float, float]]:
    """Joint -> rms in noise floors, rms and floor [Nm], as the small multiples say."""
    out = {}
    for text in page.locator(".fv-multiple").all_inner_texts():
        found = re.search(
            r"(\w+)\s+([\d.e]+) × floor\s+([\d.e−-]+) / ([\d.e−-]+) Nm", text.replace("\n", " ")
        )
        if found:
            times, rms, floor = (float(part.replace("−", "-")) for part in found.groups()[1:])
            out[found[1]] = times, rms, floor
    return out


def width(page: Any) -> float:
    """The bandwidth in use [rad/s]."""
    found = re.search(r"bandwidth ([\d.]+) rad/s", page.inner_text("body"))
    return float(found[1]) if found else float("nan")


def test_the_trade_is_seen_while_dragging(page: Any, shot: Any) -> None:
    pause(page)
    button(page, "Observer").click()
    until(lambda: "After Run (step 3, Identify)" in page.inner_text("body"), 60, "the hint")
    button(page, "Identify").click()
    button(page, "Run").click()
    until(lambda: not button(page, "Stop").is_enabled() and "converged" in page.inner_text(".fv-status"))
    # a click is lost where the page is just drawn anew with the result
    first = until(lambda: cards(page) or button(page, "Observer").click(), 60, "the residuals")
    assert list(first) == ["joint1", "joint2"]
    for times, rms, floor in first.values():
        assert times == pytest.approx(rms / floor, rel=0.02)
    assert first["joint2"][0] > first["joint1"][0] > 1  # joint2 lacks its friction
    before = width(page)

    # a wider band lets more noise in; the residual follows, and Undo takes it back
    slider = row(page, "Bandwidth [rad/s]").get_by_role("slider")
    slider.focus()
    page.keyboard.press("End")
    until(lambda: width(page) == 2000, 60, "the slider")
    until(lambda: cards(page)["joint1"][2] > 1e3 * first["joint1"][2], 60, "the noise floor")
    until(lambda: len(chart(page, "What a bandwidth costs, joint1")[0]) > 12, 60, "the trade")
    w, rms, floor, *_ = chart(page, "What a bandwidth costs, joint1")
    assert min(w) <= 10 and max(w) >= 2000 and all(a > 0.9 * b for a, b in zip(rms, floor, strict=True))
    shot(page, "trade")
    button(page, "Undo").click()
    until(lambda: cards(page) == first and width(page) == before, 60, "the bandwidth before the drag")


def test_gains_are_set_by_hand(address: str, open_page: Any, shot: Any) -> None:
    page = open_page(address + "/?darkMode", 1280, 800)
    pause(page)
    button(page, "Observer").click()
    choose(page, "Observer type", "eso")
    unfold(page, "Gains of the ESO", labels(page, "β5 θ"))
    field = row(page, "β5 θ").locator("input").first
    until(lambda: field.input_value() == "1.92e7", 60, "6 · 20⁵")
    body = lambda: page.inner_text("body")  # noqa: E731
    until(lambda: "Poles of θ: −20.0 (6 times); of τ: the same" in body().replace("\n", " "), 60, "the poles")
    until(button(page, "Use these gains").is_disabled, SOON, "no use of these")

    # unstable is said, drawn, and cannot be used
    field.fill("1e8")
    until(lambda: "makes the observer unstable" in body() or "make the observer unstable" in body(), 60)
    until(button(page, "Use these gains").is_disabled, SOON, "no use of these")
    shot(page, "gains-unstable")
    field.fill("two")
    until(lambda: 'β5 is "two", expected a number' in body(), 60, "the refusal")

    # stable ones are used, for τ apart, and Undo takes them back
    field.fill("2.2e7")
    tick(page, "Same gains for θ and τ", False)
    row(page, "β1 τ").locator("input").first.fill("130")
    until(lambda: button(page, "Use these gains").is_enabled(), 60, "usable gains")
    well_laid_out(page)
    shot(page, "gains")
    button(page, "Use these gains").click()
    until(lambda: "gains set by hand" in body(), 60, "the gains in use")
    until(lambda: row(page, "β1 τ").locator("input").first.input_value() == "130", SOON, "β1 of τ")
    button(page, "Undo").click()
    until(lambda: "gains set by hand" not in body() and field.input_value() == "1.92e7", 60, "the undo")
    button(page, "Redo").click()
    until(lambda: "gains set by hand" in body(), 60, "the redo")
    button(page, "Back to (s+w)^6").click()
    until(lambda: "gains set by hand" not in body() and field.input_value() == "1.92e7", 60, "(s+w)⁶")
