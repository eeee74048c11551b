"""The texts of the page can be read and understood: contrast, size, order, terms explained on the spot."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest

from tests.browser.contrast import faint, texts
from tests.browser.page import SOON, button, pause, pin, press, status, tab, until, within

pytestmark = pytest.mark.browser
RESULT = 13.0  # [px] least size of sentences that carry a result
STEPS = {"Data": "Signals", "Observer": "States", "Identify": "Convergence", "Diagnose": "Where it fails"}
TERMS = """() => [...document.querySelectorAll('.fv-first')].map(term => [
    [...document.querySelectorAll('[role=tabpanel], [data-dock-group]')].indexOf(
        term.closest('[role=tabpanel], [data-dock-group]')),
    term.textContent, term.dataset.told])"""


def sized(page: Any, selector: str) -> list[float]:
    """Sizes of the texts in the elements of this selector [px]."""
    return page.eval_on_selector_all(
        selector, "all => all.map(one => parseFloat(getComputedStyle(one).fontSize))"
    )


def top(page: Any, selector: str) -> float:
    """Where an element begins [px]."""
    return page.locator(selector).first.bounding_box()["y"]


def the_finding_comes_first(page: Any) -> None:
    """The sentence about the error stands above its button, and no hint above it."""
    wrong = page.locator(".fv-wrong")
    until(wrong.is_visible, SOON, "the first sentence")
    assert re.match(r"This arm's model is wrong by 1\d % on joint2", wrong.inner_text())
    assert page.locator(".fv-next").count() == 0
    assert top(page, ".fv-wrong") < button(page, "Find the missing effect").bounding_box()["y"]
    button(page, "Data").click()
    until(lambda: "Step Data" in status(page), SOON, "the step")
    until(lambda: page.locator(".fv-next").count(), SOON, "the hint")
    assert top(page, ".fv-status") < top(page, ".fv-next")  # first how large the error is


def every_text_is_readable(page: Any, where: str) -> None:
    assert len(texts(page)) > 30
    seen = within(SOON, lambda: faint(page), lambda found: not found)
    assert not seen, (where, seen)
    carrying = ".fv-status, .fv-verdict, .fv-wrong, .fv-finding, .fv-so-far, .fv-next"
    assert min(sized(page, carrying)) >= RESULT, where


def terms(page: Any) -> list[tuple[int, str, str]]:
    """Panel, word and explanation of every underlined term."""
    return [tuple(one) for one in page.evaluate(TERMS)]


def no_term_is_underlined_twice_in_a_panel(page: Any) -> None:
    seen = [(panel, told) for panel, _, told in terms(page)]
    assert seen and len(set(seen)) == len(seen)


@pytest.mark.slow
@pytest.mark.parametrize("dark", [False, True])
def test_everything_is_readable_on_every_step(
    serve: Callable[..., str], open_page: Any, shot: Any, dark: bool
) -> None:
    page = open_page(serve() + ("/?darkMode" if dark else ""), 1280, 800)
    pause(page)
    name = "dark" if dark else "light"
    the_finding_comes_first(page)
    pin(page)
    for step, plots in STEPS.items():
        button(page, step).click()
        tab(page, plots).click()
        until(lambda step=step: f"Step {step}" in status(page), SOON, step)
        every_text_is_readable(page, f"{step}, {name}")
        no_term_is_underlined_twice_in_a_panel(page)
        shot(page, f"texts-{step.lower()}-{name}")
    verdict = page.locator(".fv-verdict")
    press(page, "Find the missing effect", lambda: verdict.count() or "off" in status(page))
    until(lambda: verdict.count() and verdict.inner_text().startswith("Missing"), what="the verdict")
    until(lambda: not button(page, "Stop").is_enabled(), what="the end")
    until(lambda: page.locator(".fv-heat").count(), what="the shares of the residual")
    every_text_is_readable(page, f"verdict, {name}")
    no_term_is_underlined_twice_in_a_panel(page)
    shot(page, f"texts-verdict-{name}")
    tab(page, "Compare").click()
    every_text_is_readable(page, f"compare, {name}")
    if not dark:
        terms_open_under_pointer_and_keys(page, shot)


def terms_open_under_pointer_and_keys(page: Any, shot: Any) -> None:
    tip, term = (
        page.locator("#fv-told"),
        page.locator(".fv-status .fv-first").filter(has_text="% of the torque"),
    )
    until(lambda: term.count() == 1, SOON, "the term")
    assert not tip.is_visible()
    term.hover()
    until(tip.is_visible, SOON, "its explanation")
    assert tip.inner_text().startswith("The size of an error: the rms residual of a joint in per cent")
    box, width = tip.bounding_box(), page.viewport_size["width"]
    assert box["x"] >= 0 and box["x"] + box["width"] <= width
    shot(page, "texts-term")
    page.mouse.move(600, 300)
    until(lambda: not tip.is_visible(), SOON, "the end of it")
    # the keyboard reaches it, and Escape closes it
    page.locator(".fv-status .fv-first").first.focus()
    until(tip.is_visible, SOON, "its explanation")
    page.keyboard.press("Tab")
    until(lambda: "noise alone" in tip.inner_text(), SOON, "the next term")
    page.keyboard.press("Escape")
    assert not tip.is_visible()
