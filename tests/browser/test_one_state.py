"""After another Run no text is of the model before; its residual is grey on the same axis."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.browser.page import (
    EXAMPLE_SET,
    SOON,
    button,
    chart,
    choose,
    dark,
    pin,
    press,
    row,
    status,
    tab,
    tick,
    until,
    well_laid_out,
)

pytestmark = pytest.mark.browser
STEPS = ("Data", "Observer", "Identify", "Diagnose")
TABS = ("Signals", "States", "Convergence", "Where it fails", "Compare")
# what is not struck through, and of the staircase only the row that is shown
TEXTS = """() => [...document.querySelectorAll('.fv')].filter(e => e.offsetParent).map(e => {
    const copy = e.cloneNode(true);
    copy.querySelectorAll('s, style').forEach(x => x.remove());
    if (copy.querySelector('.fv-stair')) copy.querySelectorAll('tr').forEach(x => {
        if (!x.textContent.includes('● shown')) x.remove(); });
    return copy.textContent;
}).join('\\n')"""
STYLES = """start => Object.values(window.__viserTestpoints.uplots).map(u => u.chart)
    .filter(u => u.root.offsetParent && u.root.querySelector('.u-title').textContent.startsWith(start))
    .map(u => ({lines: u.series.slice(1).map(s => [s.label, s.stroke && s.stroke(u, 1)]),
                axis: [u.scales.y.min, u.scales.y.max]}))[0]"""


def everything(page: Any) -> dict[str, str]:
    """What is said in every step, and in every tab."""
    found = {}
    for names, go in ((STEPS, lambda name: button(page, name)), (TABS, lambda name: tab(page, name))):
        for name in names:
            go(name).click()
            page.wait_for_timeout(500)
            found[name] = page.evaluate(TEXTS)
    return found


def residual(page: Any, start: str = "Residual, joint2") -> Any:
    """Lines (label, colour) and axis of the residual over time."""
    return page.evaluate(STYLES, start)


def in_both_themes(page: Any, shot: Any, name: str, step: str = "Diagnose") -> None:
    """Pictures of what is on the page in a step, in the dark theme and in the light one, which stays."""
    for theme in ("dark", "light"):
        dark(page, theme == "dark", back_to=step)
        shot(page, f"{name}-{theme}")
        well_laid_out(page)


@pytest.mark.slow
def test_after_a_run_no_text_is_of_the_model_before(
    serve: Callable[..., str], open_page: Any, shot: Any
) -> None:
    page = open_page(serve(EXAMPLE_SET), 1280, 800)
    pin(page)
    choose(page, "Joint", "joint2")
    button(page, "Diagnose").click()
    page.get_by_role("button", name="Find the missing effect").click()
    verdict = page.locator(".fv-verdict")
    until(lambda: verdict.count() and verdict.inner_text().startswith("Missing"), what="the verdict")
    until(lambda: not button(page, "Stop").is_enabled(), what="the end")
    tab(page, "Signals").click()
    first = until(lambda: residual(page), what="the residual of the first model")
    assert [label for label, _ in first["lines"]] == ["residual", "now"]
    page.get_by_role("button", name="Add and refit").first.click()
    until(lambda: verdict.inner_text().startswith("Nothing is missing"), what="the second look")
    until(lambda: not button(page, "Stop").is_enabled(), what="the end")

    # before and after on one axis, which the box zooms to the present one; the unit stays
    tab(page, "Signals").click()
    after = until(lambda: (r := residual(page)) and len(r["lines"]) == 3 and r, what="both residuals")
    assert [label for label, _ in after["lines"]] == ["before", "residual", "now"]
    assert [colour for _, colour in after["lines"]][:2] == ["#7b7b7b", "#009E73"]
    assert after["axis"] == pytest.approx(first["axis"])
    _, before, now, *_ = chart(page, "Residual, joint2 [Nm]")
    assert np.std(now) < np.std(before) / 20
    in_both_themes(page, shot, "before-after")
    tick(page, "Zoom to present")
    until(lambda: residual(page)["axis"][1] < first["axis"][1] / 5, SOON, "the zoom")
    chart(page, "Residual, joint2 [Nm]")
    in_both_themes(page, shot, "zoomed")
    tab(page, "Where it fails").click()
    assert row(page, "Zoom to present").get_by_role("checkbox").is_checked()
    tick(page, "Zoom to present", False)

    # a Run with another observer: the verdict is of an earlier model, also the rest of the page says so
    old = re.search(r"validation error [\d.]+ ×", status(page))
    assert old
    button(page, "Observer").click()
    choose(page, "Observer type", "eso")
    until(lambda: "of an earlier model" in status(page), SOON, "the error of an earlier model")
    assert "Run" in page.locator(".fv-next").inner_text()
    typed = row(page, "exactly").get_by_role("textbox")
    typed.fill("80")
    typed.press("Enter")
    button(page, "Identify").click()
    tick(page, "Refine", False)  # the refined values do not depend on the observer
    button(page, "Run").click()
    until(lambda: "iterations in" in status(page) and "validation error" in status(page), what="a result")
    bounds = "At the bound" in status(page) or "lower bound" in status(page)
    assert bounds != ("converged" in status(page))
    assert page.locator(".fv-status.warn").count() == bounds
    tab(page, "Compare").click()
    run = "Run with Coulomb friction on joint2: eso, 80 rad/s, plain fit"
    until(lambda: f"{run} ● shown" in page.inner_text("body"), 60, "the run in the staircase")
    in_both_themes(page, shot, "run-compare", "Identify")
    said = everything(page)
    for where, text in said.items():
        for of_old in ("Nothing is missing", "model 1 (", "Done", old[0], "not missing", "Diagnose ✓"):
            assert of_old not in text, (where, of_old, text)
    button(page, "Diagnose").click()
    assert "of an earlier model · look again" in verdict.inner_text()
    assert verdict.locator("s").inner_text().startswith("Nothing is missing")
    assert "▲ rises" in said["Compare"]
    in_both_themes(page, shot, "run-diagnose")

    # Compare with draws the other model's residual on that axis
    row(page, "Compare with").get_by_role("button", name="0", exact=True).click()
    until(lambda: page.locator(".fv-name").count() == 3, what="3 names")
    assert page.locator(".fv-name").all_inner_texts()[1].startswith("Run (")
    tab(page, "Signals").click()
    until(lambda: residual(page)["lines"][0][0].startswith("model 0 ("), SOON, "the other model's residual")
    assert residual(page)["axis"][1] >= 0.999 * first["axis"][1]
    in_both_themes(page, shot, "beside")

    # with the state the verdict comes back
    for action in ("identified", "bandwidth", "observer eso"):
        press(page, "Undo", lambda action=action: f"undone: {action}" in status(page))
    until(lambda: verdict.locator("s").count() == 0, SOON, "the verdict again")
    until(lambda: old[0] in status(page) and "earlier" not in status(page), SOON, "its error")
    assert "Done" in page.locator(".fv-next").inner_text()
