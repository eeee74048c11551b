"""What the page shows is true at a glance: read off texts and the colours of screenshots."""

from __future__ import annotations

import os
import re
import subprocess
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.browser.page import (
    EXAMPLE_SET,
    SOON,
    button,
    chart,
    charts,
    choose,
    dark,
    error,
    ghost,
    node,
    pause,
    pin,
    pixels,
    play,
    press,
    row,
    tab,
    tick,
    unfold,
    until,
    well_laid_out,
    within,
)

pytestmark = pytest.mark.browser
BRIGHT = (254, 232, 56)  # the end of the scale


def yellow(page: Any) -> int:
    """How many pixels of the robots are yellow, the colour of a large error (the ghost is orange)."""
    seen = pixels(page, {"x": 345, "y": 260, "width": 640, "height": 380})  # between legend and panel
    red, green, blue = seen[..., 0], seen[..., 1], seen[..., 2]
    return int(np.count_nonzero((green > 0.88 * red) & (red > 110) & (blue < 0.55 * green)))


def swatch(page: Any, joint: str) -> np.ndarray:
    """The colour beside a joint's error in the legend."""
    box = page.locator(".fv-joints .fv-joint").filter(has_text=joint).locator(".fv-box").bounding_box()
    seen = pixels(page, box)
    return seen[seen.shape[0] // 2, seen.shape[1] // 2]


def at_rest(page: Any) -> None:
    until(lambda: not button(page, "Stop").is_enabled() and np.isfinite(error(page)), what="the end")


@pytest.mark.slow
def test_a_good_model_looks_good(serve: Callable[..., str], open_page: Any, shot: Any) -> None:
    page = open_page(serve(EXAMPLE_SET), 1440, 900)
    at = row(page, "Time [s]").locator("input:not([type=hidden])").first
    at.fill("0.3")  # where both links are seen from the side, however late it was paused
    at.press("Enter")
    button(page, "Diagnose").click()
    page.get_by_role("button", name="Find the missing effect").click()
    verdict = page.locator(".fv-verdict")
    until(lambda: verdict.count() and verdict.inner_text().startswith("Missing"), what="the verdict")
    at_rest(page)
    until(lambda: page.locator(".fv-joints").count(), what="the legend")
    # joint2, which lacks its friction, is at the bright end; joint1 is at the noise
    until(lambda: np.abs(swatch(page, "joint2") - BRIGHT).max() < 12, what="a bright link")
    until(lambda: sum(swatch(page, "joint1")) < 250, SOON, "a dark link")
    until(lambda: yellow(page) > 150, what="a yellow robot")
    before = error(page)
    page.get_by_role("button", name="Add and refit").first.click()
    until(lambda: verdict.inner_text().startswith("Nothing is missing"), what="the second look")
    at_rest(page)
    until(lambda: error(page) < before / 20, what="the fall of the error")
    # now both are at the noise: dark on the robot and in the legend
    until(lambda: max(sum(swatch(page, joint)) for joint in ("joint1", "joint2")) < 250, what="dark links")
    until(lambda: yellow(page) < 20, what="a dark robot")
    # the staircase: a bar per model, and a click shows that model everywhere
    tab(page, "Compare").click()
    bars = page.locator(".fv-stair .held")
    widths = [bars.nth(k).bounding_box()["width"] for k in range(until(lambda: bars.count() == 2 and 2))]
    assert widths[1] < widths[0] / 10, widths
    shown = "1. + Coulomb friction on joint2 ● shown"
    until(lambda: shown in page.inner_text("body").replace("\n", " "), SOON, "the shown model")
    assert (
        bars.last.bounding_box()["y"]
        < page.locator(".uplot").filter(has_text="all joints").bounding_box()["y"]
    )
    shot(page, "stairs")
    after = error(page)
    row(page, "Show model").get_by_role("button", name="0", exact=True).click()
    until(lambda: error(page) == before, 60, "the error of the first model")
    until(lambda: yellow(page) > 150, 60, "its colours")
    until(lambda: verdict.inner_text().startswith("Missing"), SOON, "its verdict")
    assert bars.count() == 2
    row(page, "Show model").get_by_role("button", name="1", exact=True).click()
    until(lambda: error(page) == after and yellow(page) < 20, 60, "the last model")
    compared_side_by_side(page, shot)
    the_map_is_faint_where_nothing_is_explained(page)
    shot(page, "glance-light")
    dark(page, back_to="Diagnose")
    until(lambda: yellow(page) < 20, what="a dark robot on a dark page")
    the_map_is_faint_where_nothing_is_explained(page)
    shot(page, "glance-dark")


def the_map_is_faint_where_nothing_is_explained(page: Any) -> None:
    """There the cell is as the page."""
    tab(page, "Where it fails").click()
    cells = page.locator(".fv-heat td[title]")
    until(lambda: cells.count(), what="the map")
    faint = [cell for cell in cells.all() if float(cell.inner_text().split()[0]) <= 2]
    assert len(faint) > 5

    def unlike_paper() -> int:
        seen = pixels(page)
        corners = [cell.bounding_box() for cell in faint[:3]]
        cut = [seen[int(box["y"]) + 2, int(box["x"]) + 2] for box in corners]
        return int(np.abs(np.subtract(cut, seen[881, 1426])).max())

    assert within(SOON, unlike_paper, lambda most: most < 16) < 16


def compared_side_by_side(page: Any, shot: Any) -> None:
    """The first model beside the last: three robots, of which only the first model's is yellow."""
    row(page, "Compare with").get_by_role("button", name="0", exact=True).click()
    legend = page.locator(".fv-name")
    until(lambda: legend.count() == 3 and legend.all_inner_texts()[2].startswith("model 0 ("), what="3 names")
    until(lambda: node(page, "/beside/joint2"), what="the third robot")

    def right_one_is_yellow() -> bool:
        seen = pixels(page, {"x": 345, "y": 260, "width": 640, "height": 380})
        columns = np.nonzero((seen[..., 1] > 0.88 * seen[..., 0]) & (seen[..., 2] < 0.55 * seen[..., 1]))[1]
        return len(columns) > 100 and bool(np.median(columns) > 380)

    until(right_one_is_yellow, 60, "the first model's robot in yellow, on the right")
    shot(page, "beside")
    row(page, "Compare with").get_by_role("button", name="nothing", exact=True).click()
    until(lambda: legend.count() == 2 and node(page, "/beside/joint2") is None, what="two robots again")


def cpu(process: subprocess.Popen[str], seconds: float = 4.0) -> float:
    """Share of a core that a process uses."""

    def used() -> float:
        fields = Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    before, begun = used(), time.monotonic()
    time.sleep(seconds)
    return (used() - before) / (time.monotonic() - begun)


# what a browser does with a hidden page: it asks for no more frames until the page is shown again
HIDE = """() => { window.asked = []; window.drawn = window.requestAnimationFrame;
    window.requestAnimationFrame = f => { window.asked.push(f); return 0; }; }"""
SHOW = "() => { window.requestAnimationFrame = window.drawn; window.asked.forEach(f => window.drawn(f)); }"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").is_file(), reason="processor time is read from /proc")
def test_unwatched_it_costs_nothing(
    address: str, servers: dict[str, subprocess.Popen[str]], page: Any
) -> None:
    play(page)

    def at() -> Any:
        return node(page, "/measured/joint2")

    before = until(at, what="the robot")
    until(lambda: at() != before, 60, "motion")
    page.evaluate(HIDE)
    until(lambda: cpu(servers[address]) < 0.02, 60, "the pause of a hidden page")
    page.evaluate(SHOW)
    before = at()
    until(lambda: at() != before, 60, "motion again")


@pytest.mark.slow
def test_the_camera_has_presets(page: Any, shot: Any) -> None:
    pause(page)
    choose(page, "Group", "t3p3")
    label = "() => window.__viserSceneTree.getState()['/measured/payload0']?.message?.props?.text"
    until(lambda: page.evaluate(label) == "payload 1.6 kg", what="the label of the payload")
    until(lambda: node(page, "/measured/joint2/payload0"), what="the payload")
    tab(page, "View").click()

    def scene() -> np.ndarray:
        # means of 20 × 20 pixels: viser draws more coarsely when frames take long
        seen = pixels(page, {"x": 345, "y": 60, "width": 640, "height": 500})
        return seen.reshape(25, 20, 32, 20, 3).mean(axis=(1, 3))

    def like(other: np.ndarray) -> bool:
        return bool(np.mean(np.abs(scene() - other).max(axis=2) > 20) <= 0.03)

    before = last = within(SOON, scene, like)  # nothing moves any more
    shot(page, "labels")
    for view in ("Oblique", "Above", "Front"):
        button(page, view).click()
        until(lambda last=last, view=view: not like(last) and like(before) == (view == "Front"), what=view)
        last = within(SOON, scene, like)
        shot(page, f"camera-{view.lower()}")


def test_effects_are_ticked_on_all_joints_or_one(page: Any, shot: Any) -> None:
    pause(page)
    button(page, "Identify").click()
    matrix = page.locator(".fv-matrix tr")

    def model() -> dict[str, str]:
        rows = [text.split("\t") for text in matrix.all_inner_texts()[1:]]
        return {name: "".join(cells) for name, *cells in rows}

    tick(page, "Coulomb friction")  # the name: on all joints
    until(lambda: model() == {"Coulomb friction": "✓✓"}, 60, "the effect on both joints")
    unfold(page, "Joint by joint", page.get_by_role("button", name="joint1", exact=True))
    press(page, "joint1", lambda: model() == {"Coulomb friction": "·✓"})  # one joint less
    until(lambda: not row(page, "Coulomb friction").get_by_role("checkbox").is_checked(), SOON, "no tick")
    shot(page, "matrix")
    page.get_by_role("button", name="joint1", exact=True).click()
    until(lambda: row(page, "Coulomb friction").get_by_role("checkbox").is_checked(), 60, "both joints again")
    tick(page, "Coulomb friction", False)
    until(lambda: model() == {}, 60, "the model without it")
    button(page, "Undo").click()
    until(lambda: model() == {"Coulomb friction": "✓✓"}, 60, "the undo")
    well_laid_out(page)


SPANS = """() => Object.fromEntries(Object.values(window.__viserTestpoints.uplots).map(u =>
    [u.chart.root.querySelector('.u-title').textContent, [u.chart.scales.x.min, u.chart.scales.x.max]]))"""

WRITTEN = """values => values.map(value => {
    const one = Object.values(window.__viserTestpoints.uplots)[0].chart;
    const [axis] = one.axes[1].values(one, [value]), legend = one.series[1].value(one, value);
    return axis === legend ? axis : [axis, legend];
})"""
TOOLTIP = """name => getComputedStyle([...document.querySelectorAll('button')]
    .find(one => one.textContent.trim() === name).parentElement, '::after').content"""


def test_plots_are_zoomed_clicked_read_and_saved(page: Any, shot: Any, tmp_path: Path) -> None:
    pause(page)
    pin(page)
    button(page, "Identify").click()
    button(page, "Run").hover()
    assert page.evaluate(TOOLTIP, "Run") != "none"
    button(page, "Run").click()  # what a press does is not hidden by the button's tooltip
    assert page.evaluate(TOOLTIP, "Run") == "none"
    button(page, "Undo").hover()
    button(page, "Run").hover()
    assert page.evaluate(TOOLTIP, "Run") != "none"
    until(lambda: any(title.startswith("Simulated −") for title in charts(page)), what="the model's motion")
    over = page.locator(".uplot").filter(has_text="Torque, joint1").first.locator(".u-over").bounding_box()
    y = over["y"] + over["height"] / 2

    # a click moves the robot; values stand under the cursor
    still = node(page, "/measured/joint2")
    page.mouse.click(over["x"] + 0.25 * over["width"], y)
    until(lambda: node(page, "/measured/joint2") != still, 60, "the robot at the clicked instant")
    low, high = page.evaluate(SPANS)["Torque, joint1 [Nm]"]
    typed = row(page, "Time [s]").locator("input:not([type=hidden])").first
    clicked = pytest.approx(low + 0.25 * (high - low), abs=0.05)
    until(lambda: float(typed.input_value()) == clicked, SOON, "the clicked instant")
    values = page.locator(".uplot").filter(has_text="Torque, joint1").first.locator(".u-value")
    until(lambda: "--" not in values.nth(2).inner_text(), SOON, "the values under the cursor")
    assert float(values.nth(1).inner_text().replace("−", "-"))

    # dragging zooms all plots over time alike, and moving the playhead keeps that
    page.mouse.move(over["x"] + 0.3 * over["width"], y)
    page.mouse.down()
    page.mouse.move(over["x"] + 0.6 * over["width"], y, steps=5)
    page.mouse.up()
    wanted = pytest.approx([low + 0.3 * (high - low), low + 0.6 * (high - low)], abs=0.1)
    shown = row(page, "Span [s]").locator("input").first

    def span() -> list[float]:
        return [float(end) for end in shown.input_value().split(" – ")]

    assert within(SOON, span, lambda seen: seen == wanted) == wanted
    button(page, "Step ▶").click()

    def spans() -> list[list[float]]:
        over_time = ("Torque, ", "Residual, ", "Simulated")
        return [span for title, span in page.evaluate(SPANS).items() if title.startswith(over_time)]

    assert within(SOON, spans, lambda seen: seen == [wanted] * 3) == [wanted] * 3

    # small numbers are no zeros
    assert page.evaluate(WRITTEN, [1.25e-4, -2e-7, 0, -0.5]) == ["1.25e−4", "−2e−7", "0", "−0.5"]

    # only that span is played and drawn, in all tabs, until a double click; the slider shows it
    first, last = span()
    at = row(page, "Time [s]").locator("input:not([type=hidden])").first
    until(lambda: first <= float(at.input_value()) <= last, SOON, "the playhead in the span")
    tab(page, "States").click()
    until(lambda: page.evaluate(SPANS).get("τ [Nm]") == [first, last], what="the same span of the states")
    tab(page, "Signals").click()

    def all_of_it() -> bool:
        page.mouse.dblclick(over["x"] + 0.5 * over["width"], y)  # it misses a plot that is not there yet
        return within(SOON / 4, lambda: shown.input_value().startswith("0.00 – 12.0"))

    until(all_of_it, 3 * SOON, "all of it")

    # the name of the joint under the pointer, with its torque and deflection
    hover, text = (
        page.locator(".fv-hover:not(.fv-told)"),
        r"joint\d, torque .* Nm, deflection .* mrad, .*error .* % of the torque \(.* m?Nm\)",
    )

    def named() -> bool:
        places = ghost(page)  # seen anew: the robot may have moved
        for x, level in places[:: max(len(places) // 12, 1)]:
            page.mouse.move(x, level)
            if within(2, lambda: hover.is_visible() and re.match(text, hover.inner_text())):
                return True
        return False

    assert any(named() for _ in range(3))

    # a plot as picture
    page.locator(".uplot-container").filter(has_text="Torque, joint1").first.hover()
    with page.expect_download(timeout=60_000) as download:
        page.locator(".fv-png").first.click()
    assert download.value.suggested_filename == "torque-joint1.png"
    download.value.save_as(tmp_path / "plot.png")
    drawn = np.asarray(pytest.importorskip("PIL.Image").open(tmp_path / "plot.png").convert("RGB"))
    assert drawn.shape[1] == 2160 and (np.abs(drawn - np.array([0, 114, 178])).max(axis=2) < 8).sum() > 3000

    # torque over angle and the spectrum are there, and everything can be saved
    assert len(chart(page, "Torque against motor angle")) == 3
    assert max(chart(page, "Spectrum of the torque")[0]) <= 40
    shot(page, "signals")
    with page.expect_download(timeout=60_000) as download:
        page.locator("button:visible", has_text="Save plots").click()
    file = tmp_path / "plots.zip"
    download.value.save_as(file)
    with zipfile.ZipFile(file) as packed:
        names = packed.namelist()
        assert "1-torque-joint1.svg" in names and len(names) == 10
        head, *rows = packed.read("1-torque-joint1.csv").decode().splitlines()
    assert head == "time [s],measured [Nm],model [Nm]" and len(rows) > 100
