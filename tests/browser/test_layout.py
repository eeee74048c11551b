"""The layout at usual sizes of screens: nothing lies over a plot or a tab, and both robots are in view."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from benchmarks.screens import WINDOWS
from tests.browser.boxes import boxes, overlaps, robots_in_view
from tests.browser.page import (
    EXAMPLE_SET,
    FRAMES,
    SOON,
    button,
    dark,
    pause,
    play,
    press,
    row,
    status,
    tab,
    tick,
    until,
    well_laid_out,
    within,
)

pytestmark = pytest.mark.browser


def fits(page: Any, face_on: bool = True) -> None:
    """Nothing covers anything, both robots are in view, as soon as what moves has come to rest."""
    wrong = within(SOON, lambda: overlaps(page) + robots_in_view(page, face_on), lambda wrong: not wrong)
    assert not wrong, wrong


def kinds(page: Any) -> set[str]:
    return {box.kind for box in boxes(page)}


def column(page: Any, name: str) -> None:
    """Turn to a column of a narrow page."""
    page.locator("#fv-columns").get_by_role("tab", name=name, exact=True).click()


def turned(page: Any, name: str) -> None:
    """The tab of the plots has turned to this one."""
    until(lambda: tab(page, name).get_attribute("aria-selected") == "true", SOON, f"the tab {name}")


def test_nothing_is_covered_at_any_size(address: str, open_page: Any, shot: Any) -> None:
    page = open_page(address, 1440, 900)
    every_size(page, shot, "light")
    page.set_viewport_size({"width": 1440, "height": 900})
    dark(page)
    every_size(page, shot, "dark")
    page.set_viewport_size({"width": 1440, "height": 900})
    dark(page, False)


def every_size(page: Any, shot: Any, theme: str) -> None:
    for name, (width, height) in WINDOWS.items():
        page.set_viewport_size({"width": width, "height": height})
        for one in ("Robots", "Plots") if width < 1000 else ("",):
            if one:
                column(page, one)
            until(lambda one=one: (one == "Robots") != ("plot" in kinds(page)), SOON, "the column")
            fits(page)
            well_laid_out(page)
            assert ("bar" in kinds(page)) == (width < 1280) == ("panel" not in kinds(page))
            shot(page, f"layout-{name}-{one or 'all'}-{theme}")


def test_a_page_opened_narrow_shows_both_robots_face_on(address: str, open_page: Any) -> None:
    for width, height in ((1024, 768), (683, 512)):
        page = open_page(address, width, height)
        if width < 700:
            column(page, "Robots")
        fits(page)
        # the arm's plane is that of the picture: its tip is as far away as its base
        depth = """() => { const scene = window.__viserMutable, at = name => scene.camera.position.clone()
            .setFromMatrixPosition(scene.nodeRefFromName[name].matrixWorld).applyMatrix4(
            scene.camera.matrixWorldInverse); return [at('/measured'), at('/measured/joint2'),
            at('/identified')].map(v => v.z) }"""
        base, elbow, other = page.evaluate(depth)
        assert abs(base - elbow) < 0.3 and abs(base - other) < 1e-2


def test_the_bar_plays_and_opens_the_panels_over_the_robots_only(page: Any, shot: Any) -> None:
    page.set_viewport_size({"width": 1024, "height": 768})
    until(lambda: "bar" in kinds(page) and "panel" not in kinds(page), SOON, "the bar")
    (bar,) = [box for box in boxes(page) if box.kind == "bar"]
    (view,) = [box for box in boxes(page) if box.kind == "view"]
    assert bar.bottom - bar.top == 40 and (bar.left, bar.right) == pytest.approx(
        (view.left, view.right), abs=1.5
    )
    assert bar.top == pytest.approx(view.bottom, abs=1.5)
    pause(page)
    instant = page.locator("#fv-bar output")
    rest = instant.inner_text()
    play(page)
    until(lambda: instant.inner_text() != rest, SOON, "the motion")
    pause(page)
    page.locator("#fv-bar input").fill("3")
    until(lambda: instant.inner_text() == "3.00 s", SOON, "the instant that was asked for")
    for opened, own in (("Legend", ".fv-joints"), ("Playback", "label:text('Speed')")):
        button(page, opened).click()
        until(lambda own=own: page.locator(own).is_visible(), SOON, f"the panel {opened}")
        assert "panel" in kinds(page)
        fits(page)
        shot(page, f"layout-bar-{opened.lower()}")
    button(page, "Playback").click()
    until(lambda: "panel" not in kinds(page), SOON, "the panel's end")
    page.set_viewport_size({"width": 1440, "height": 900})
    until(lambda: "panel" in kinds(page), SOON, "the panels")
    assert float(row(page, "Time [s]").locator("input:not([type=hidden])").first.input_value()) == 3


def test_the_camera_that_was_moved_keeps_its_direction(page: Any) -> None:
    """Until a view is asked for by its name."""
    pause(page)
    towards = """() => { const m = window.__viserMutable.camera.matrixWorld.elements;
        return [m[8], m[9], m[10]] }"""

    def turned_by() -> float:
        return sum(a * b for a, b in zip(page.evaluate(towards), first, strict=True))

    fits(page)
    first = page.evaluate(towards)

    def dragged() -> bool:
        """As by a hand: drawn between its moves, and again where the view was just being fitted."""
        page.mouse.move(680, 330)
        page.mouse.down()
        for x in range(690, 770, 10):
            page.mouse.move(x, 330)
            page.evaluate(FRAMES)
        page.mouse.up()
        return within(SOON, lambda: turned_by() < 0.98)

    def rests() -> bool:
        before = turned_by()
        page.evaluate(FRAMES)
        return abs(turned_by() - before) < 1e-6

    until(dragged, 3 * SOON, "a turned camera")
    until(rests, SOON, "its rest")
    mine = turned_by()
    for size in ((1280, 800), (1920, 1080), (1440, 900)):
        page.set_viewport_size(dict(zip(("width", "height"), size, strict=True)))
        fits(page, face_on=False)
        until(lambda: abs(turned_by() - mine) <= 0.01, SOON, "the same direction")
    tab(page, "View").click()
    button(page, "Front").click()
    until(lambda: turned_by() > 0.9999, SOON, "the view from the front")
    fits(page)


@pytest.mark.slow
def test_the_tab_follows_the_task_unless_it_is_pinned(serve: Callable[..., str], open_page: Any) -> None:
    page = open_page(serve(EXAMPLE_SET), 1440, 900)

    def idle() -> bool:
        return not button(page, "Stop").is_enabled()

    turned(page, "Signals")
    button(page, "Observer").click()
    turned(page, "States")
    button(page, "Identify").click()
    tick(page, "Refine", False)
    until(lambda: "Step Identify" in status(page), SOON, "the step")
    press(page, "Run", lambda: button(page, "Stop").is_enabled() or "validation error" in status(page))
    until(lambda: "validation error" in status(page) and idle(), what="a result")
    turned(page, "Convergence")
    button(page, "Diagnose").click()
    button(page, "Find the missing effect").click()
    verdict = page.locator(".fv-verdict")
    until(
        lambda: verdict.count() and verdict.inner_text().startswith("Missing") and idle(), what="the verdict"
    )
    turned(page, "Where it fails")
    page.get_by_role("button", name="Add and refit").first.click()
    until(lambda: verdict.inner_text().startswith("Nothing is missing") and idle(), what="the second verdict")
    turned(page, "Compare")
    button(page, "Undo").click()
    until(lambda: verdict.inner_text().startswith("Missing"), SOON, "the first verdict")
    pin = page.get_by_role("button", name="Pin the tab")
    pin.click()
    assert pin.get_attribute("aria-pressed") == "true"
    button(page, "Observer").click()
    until(lambda: "Step Observer" in status(page), SOON, "the step")
    page.get_by_role("button", name="Diagnose", exact=True).click()
    page.get_by_role("button", name="Add and refit").first.click()
    until(lambda: verdict.inner_text().startswith("Nothing is missing") and idle(), what="the verdict again")
    turned(page, "Compare")  # still
    pin.click()
    button(page, "Observer").click()
    turned(page, "States")
