"""The app in real Chromium: load, tune, run, stop, look."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.browser.page import (
    button,
    chart,
    charts,
    choose,
    dark,
    error,
    ghost,
    labels,
    node,
    pause,
    pin,
    place,
    play,
    press,
    row,
    status,
    tab,
    tick,
    unfold,
    until,
    well_laid_out,
    within,
)

KUKA = Path(__file__).resolve().parents[3] / "shared" / "real" / "kuka_kr300"
pytestmark = pytest.mark.browser


def canvas_colours(picture: bytes, width: int) -> int:
    """How many colours the middle of a screenshot has, between the docks and above the playback panel."""
    image = pytest.importorskip("PIL.Image").open(io.BytesIO(picture)).convert("RGB")
    middle = np.asarray(image.crop((345, 60, width - 445, image.height // 2)))
    return len(np.unique(middle.reshape(-1, 3), axis=0))


def at_rest(page: Any) -> list[float] | None:
    """Where the measured robot stands once it has stopped."""

    def stands() -> bool:
        before = node(page, "/measured/joint2")
        page.wait_for_timeout(500)
        return node(page, "/measured/joint2") == before

    until(stands, 60, "the end of the motion")
    return node(page, "/measured/joint2")


def test_both_robots_move_and_stop(page: Any, shot: Any) -> None:
    assert "Step Data" in status(page) and "no model yet" in status(page)
    until(lambda: node(page, "/measured/joint1"), what="the measured robot")
    assert node(page, "/identified/joint1") is not None
    before = node(page, "/measured/joint2")
    play(page)
    until(lambda: node(page, "/measured/joint2") != before, what="motion")
    pause(page)
    still = at_rest(page)
    page.wait_for_timeout(1000)
    assert node(page, "/measured/joint2") == still
    assert canvas_colours(shot(page, "1-data"), 1440) > 50, "the canvas is blank"
    button(page, "Step ▶").click()
    until(lambda: node(page, "/measured/joint2") != still, what="one step")  # and it stays at rest


def test_the_bandwidth_slider_redraws_the_states_and_is_swept(page: Any, shot: Any) -> None:
    button(page, "Observer").click()
    tab(page, "States").click()
    until(lambda: any(title.startswith("θ̈") for title in charts(page)), what="the states")
    before = chart(page, "θ⁗")
    slider = row(page, "Bandwidth [rad/s]").get_by_role("slider")
    slider.focus()
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    until(lambda: chart(page, "θ⁗") != before, what="new states")
    assert all(np.isfinite(column).all() for data in charts(page).values() for column in data)
    shot(page, "2-observer")
    choose(page, "Observer type", "eso")
    until(lambda: any(title.startswith("disturbance") for title in charts(page)), what="the disturbance")
    button(page, "Use the observer's own bandwidth").click()
    choose(page, "Observer type", "butterworth-zero-phase")
    until(lambda: "Butterworth" in page.inner_text("body"), what="the first observer again")
    the_sweep_shows_residual_and_stiffness_against_bandwidth(page, shot)


def the_sweep_shows_residual_and_stiffness_against_bandwidth(page: Any, shot: Any) -> None:
    button(page, "Sweep bandwidth").click()
    until(lambda: "swept 11 bandwidths" in status(page), what="the sweep")
    residual = until(
        lambda: any(title.startswith("Residual of") for title in charts(page)) and chart(page, "Residual of"),
        what="its chart",
    )
    bandwidth, _, validation, mark = residual
    assert bandwidth == sorted(bandwidth) and max(bandwidth) > 5 * min(bandwidth)
    assert bandwidth[mark.index(1.0)] == bandwidth[validation.index(min(validation))]
    stiffness = chart(page, "Stiffness of")[1]
    assert all(value > 0 for value in stiffness)
    pause(page)
    pin(page)
    page.locator(".uplot").filter(has_text="Stiffness of").scroll_into_view_if_needed()
    shot(page, "2-sweep")
    well_laid_out(page)
    button(page, "Data").click()


def more_effects_open_and_are_added(page: Any, shot: Any) -> None:
    button(page, "Identify").click()
    until(lambda: "Torque offset" in page.inner_text("body"), what="the common effects")
    unfold(page, "More effects", labels(page, "Transmission error"))
    tick(page, "Transmission error")
    until(lambda: "Also in the model: Transmission error" in page.inner_text("body"), 60, "the note")
    shot(page, "3-effects")
    well_laid_out(page)
    tick(page, "Transmission error", False)
    until(lambda: "Also in the model" not in page.inner_text("body"), what="the model without it")


def test_run_shows_convergence_table_residual_and_the_models_motion(page: Any, shot: Any) -> None:
    more_effects_open_and_are_added(page, shot)
    tab(page, "Convergence").click()
    button(page, "Run").click()
    until(lambda: "validation error" in status(page) and "converge" in status(page), what="a result")
    until(lambda: error(page) > 0, what="its error")
    cost = until(lambda: len(chart(page, "Cost")[0]) > 1 and chart(page, "Cost"), what="the cost")
    assert all(later <= earlier * 1.001 for earlier, later in zip(cost[1], cost[1][1:], strict=False))
    stages = until(
        lambda: (
            len(charts(page))
            and any(t.startswith("Error at") for t in charts(page))
            and chart(page, "Error at")
        ),
        what="the error per stage",
    )
    assert stages[1][-1] < stages[1][0] and "1. fit at" in page.inner_text("body")
    tops = [
        box["y"]
        for box in (
            page.locator(".uplot").filter(has_text=t).bounding_box()
            for t in ("Error at", "Cost", "Parameters")
        )
    ]
    assert tops == sorted(tops)
    assert "Nm/rad" in page.inner_text("body") and "identifiable" in page.inner_text("body")
    pause(page)
    pin(page)
    shot(page, "3-identify")
    well_laid_out(page)
    tab(page, "Signals").click()
    until(lambda: any(title.startswith("Residual") for title in charts(page)), what="the residual")
    torque = chart(page, "Torque, ")
    assert len(torque) == 4  # time, measured, model, playhead
    until(
        lambda: any(title.startswith("Simulated − measured") for title in charts(page)),
        what="the simulated motion",
    )
    assert node(page, "/identified/joint2") is not None
    shot(page, "4-signals")
    tab(page, "View").click()
    choose(page, "Layout", "Overlaid")
    until(lambda: place(page, "/identified") == place(page, "/measured"), what="one robot in the other")
    shot(page, "5-overlaid")
    choose(page, "Layout", "Side by side")


def test_a_click_on_a_link_selects_its_joint(page: Any) -> None:
    pause(page)
    at_rest(page)
    places, joint = ghost(page), row(page, "Joint").get_by_role("combobox")
    before = joint.input_value()
    for i in np.random.default_rng(1).permutation(len(places))[:40]:
        page.mouse.click(*places[i])
        if within(1, lambda: joint.input_value() != before):
            return
    raise AssertionError(f"only {before} could be chosen")


@pytest.mark.slow
def test_keys_and_two_pages_show_the_same(address: str, page: Any, open_page: Any) -> None:
    one, two = page, open_page(address)
    pause(one)
    one.mouse.click(760, 120)  # the empty sky: no control has the focus
    still = at_rest(one)
    one.keyboard.press("Space")
    until(lambda: node(one, "/measured/joint2") != still, what="playing")
    one.keyboard.press("Space")
    at_rest(one)

    def role(page: Any) -> str:
        return row(page, "t1p1: t1, p1").get_by_role("combobox").input_value()

    button(one, "Data").click()
    until(lambda: "Step Data" in status(two), what="the other page")
    choose(one, "t1p1: t1, p1", "Ignore")
    until(lambda: role(two) == "Ignore", what="the other page")
    one.mouse.click(760, 120)  # out of the text field, which has an undo of its own
    for key, word, expected in (
        ("Control+z", "undone", "Fit"),
        ("Control+Shift+z", "redone", "Ignore"),
        ("Control+z", "undone", "Fit"),
    ):
        one.keyboard.press(key)
        until(lambda word=word: word in status(two), what=word)
        until(lambda expected=expected: role(two) == expected, what=f"{word} there")


BUTTONS = {
    "Data": ("Save session",),
    "Observer": (),
    "Identify": ("Run",),
    "Diagnose": ("Find the missing effect",),
}
ALWAYS = ("Data", "Observer", "Identify", "Diagnose", "Stop", "Undo", "Redo", "◀ Step", "Step ▶")
ROWS = {
    "Data": ("Measurement set", "Record"),
    "Observer": ("Bandwidth [rad/s]", "Observer type"),
    "Identify": (),
    "Diagnose": (),
}
ROWS_ALWAYS = ("Joint", "Group", "Speed", "Deflection ×", "Span [s]")


def every_agreed_name_is_on_one_control(page: Any, step: str) -> None:
    for name in ("Signals", "States", "Convergence", "Where it fails", "Compare"):
        assert tab(page, name).count() == 1
    for name in (*ALWAYS, *BUTTONS[step]):
        button(page, name)  # there is exactly one
    for name in (*ROWS_ALWAYS, *ROWS[step]):
        row(page, name)
    assert page.locator(".fv-status").count() == 1


@pytest.mark.slow
def test_nothing_overlaps_or_is_cut(page: Any, shot: Any) -> None:
    pause(page)
    pin(page)
    for width, height in ((1280, 800), (1920, 1080), (1440, 900)):
        page.set_viewport_size({"width": width, "height": height})
        every_step_is_well_laid_out(page, shot, f"{width}-light", width)
    dark(page)
    every_step_is_well_laid_out(page, shot, "1440-dark", 1440)
    dark(page, False)


def every_step_is_well_laid_out(page: Any, shot: Any, name: str, width: int) -> None:
    steps = (
        ("Data", "Signals"),
        ("Observer", "States"),
        ("Identify", "Convergence"),
        ("Diagnose", "Compare"),
    )
    for step, plots in steps:
        button(page, step).click()
        tab(page, plots).click()
        until(lambda step=step: f"Step {step}" in status(page), what=step)
        well_laid_out(page)
        every_agreed_name_is_on_one_control(page, step)
        assert canvas_colours(shot(page, f"{step.lower()}-{name}"), width) > 50


@pytest.mark.slow
@pytest.mark.skipif(not KUKA.is_dir(), reason="the real recording is not here")
def test_a_real_set_opens_and_runs(serve: Callable[..., str], open_page: Any, shot: Any) -> None:
    page = open_page(serve(str(KUKA)))
    button(page, "Identify").click()
    until(lambda: "Step Identify" in status(page), what="the step")
    tick(page, "Coulomb friction")
    tick(page, "Refine", False)
    press(page, "Run", lambda: re.search("running|iteration|validation error", status(page)))
    until(lambda: "validation error" in status(page), what="a result")
    shot(page, "6-real")
    well_laid_out(page)
