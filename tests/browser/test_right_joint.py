"""The links' colours point at the joint of the verdict, on a Panda with backlash; one error everywhere."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pyarrow import parquet

from flexviz.model.simulation.sets import make_plan, simulate_plan, write_plan
from tests.browser.page import (
    MIDDLES,
    SOON,
    button,
    choose,
    dark,
    error,
    pixels,
    row,
    status,
    tab,
    until,
    within,
)

pytestmark = pytest.mark.browser
HALF_WIDTH = 1e-4  # [rad]
DURATION = 5.0  # [s] of each group: the search then finds it as surely as in the preset's 12 s
JOINT = "panda_joint3"
STIFFNESS = """() => [...document.querySelectorAll('.fv-table tr[title=stiffness]')]
    .map(tr => /⚑/.test(tr.textContent) || /no\\s*$/.test(tr.textContent))"""
HATCHED = """() => [...document.querySelectorAll('.fv-joints .fv-joint')]
    .map(tr => tr.lastChild.classList.contains('fv-hatched'))"""


@pytest.fixture(scope="module")
def panda(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("panda") / "set"
    plan = make_plan("panda", [f"backlash:{JOINT}:half_width={HALF_WIDTH}"])
    plan = replace(plan, groups=tuple(replace(group, duration=DURATION) for group in plan.groups))
    write_plan(plan, simulate_plan(plan, 3), folder, 3)
    for file in folder.glob("*.parquet"):  # as most robots have them: without link encoders
        table = parquet.read_table(file)
        parquet.write_table(table.drop([name for name in table.column_names if name.startswith("q_")]), file)
    return str(folder)


def swatches(page: Any) -> list[int]:
    """Brightness of the colours beside the joints in the legend, sampled from the screen."""
    boxes = page.locator(".fv-joints .fv-joint .fv-box").evaluate_all(MIDDLES)
    seen = pixels(page)
    return [int(seen[int(y), int(x)].sum()) for x, y in boxes]


def brightest_link(page: Any) -> np.ndarray:
    """The places (M, 2) [px] of the scene that have the colour of the end of the scale."""
    box = {"x": 345.0, "y": 290.0, "width": 310.0, "height": 280.0}  # the measured robot
    seen = pixels(page, box).astype(int)
    return np.argwhere(
        (seen[..., 1] > 0.85 * seen[..., 0]) & (seen[..., 0] > 110) & (seen[..., 2] < 0.65 * seen[..., 1])
    )


def deflection(page: Any) -> str:
    return row(page, "Deflection ×").get_by_role("textbox").first.input_value()


@pytest.mark.slow
def test_the_brightest_link_is_that_of_the_verdict(
    serve: Callable[..., str], open_page: Any, shot: Any, panda: str
) -> None:
    page = open_page(serve(panda), 1440, 900)
    scene = (
        "() => (window.__viserSceneTree.getState()['/labels/measured']?.message?.props?.text ?? '')"
        ".replaceAll(String.fromCharCode(10), ' ')"  # labels are wrapped
    )
    until(lambda: "deflection not drawn: K is not determined" in page.evaluate(scene), SOON, "no deflection")
    assert all(page.evaluate(HATCHED))
    button(page, "Diagnose").click()
    page.get_by_role("button", name="Find the missing effect").click()
    verdict = page.locator(".fv-verdict")
    until(lambda: verdict.count() and f"Backlash on {JOINT}" in verdict.inner_text(), 900, "the verdict")
    until(lambda: not button(page, "Stop").is_enabled() and np.isfinite(error(page)), what="the end")

    # the brightest swatch, the yellow link, the mark: all are of the joint that the verdict names
    until(lambda: int(np.argmax(swatches(page))) == 2, SOON, "its colour in the legend")
    brightness = sorted(swatches(page))
    assert brightness[-1] > brightness[-3]
    until(lambda: len(brightest_link(page)) > 100, SOON, "a bright link")
    marked = page.locator(".fv-joints .fv-joint").filter(has_text="◂")
    assert [text.split()[0] for text in marked.all_inner_texts()] == ["joint3"]

    # one error: status line, legend, staircase and Where it fails say the same number of it
    said = re.search(rf"validation error ([\d.]+) % of the torque, most on {JOINT}: ([\d.]+) %", status(page))
    assert said
    assert marked.inner_text().replace("◂", "").split()[1] == said[2]
    tab(page, "Compare").click()
    until(
        lambda: f"Largest: {JOINT} {said[2]} % of its torque (" in page.inner_text("body"),
        SOON,
        "the largest",
    )
    assert f"{said[1]}" in page.locator(".fv-table tr").filter(has_text="● shown").inner_text()
    tab(page, "Where it fails").click()
    fails = page.locator(".fv").filter(has_text=f"Error of {JOINT} [% of the torque]:")
    until(lambda: f"t4p3 {said[2]}" in fails.inner_text(), SOON, "the error of the validation group")
    hover = page.locator(".fv-status b").get_attribute("title") or ""
    assert re.fullmatch(r"[\d.]+ m?Nm; noise: [\d.]+ %, [\d.]+ m?Nm", hover)

    # numbers: three digits or those that the error allows, with a prefix
    found = re.search(r"half width ([\d.]+) ± ([\d.]+) µrad", page.locator(".fv-finding").first.inner_text())
    assert found and abs(float(found[1]) * 1e-6 - HALF_WIDTH) < 2 * float(found[2]) * 1e-6
    shot(page, "panda-verdict-light")

    # the deflection is drawn where K is determined; its factor does not jump
    button(page, "Identify").click()
    known = within(SOON, lambda: page.evaluate(STIFFNESS), lambda rows: len(rows) == 7)
    assert known == page.evaluate(HATCHED) and 0 < sum(known) < 7
    factor = deflection(page)
    assert float(factor) > 1
    choose(page, "Group", "t2p2")
    until(lambda: f"deflection ×{factor} (identified)" in page.evaluate(scene), SOON, "the same factor")
    assert deflection(page) == factor
    shot(page, "panda-identify")
    dark(page, back_to="Diagnose")
    until(lambda: int(np.argmax(swatches(page))) == 2, SOON, "its colour on a dark page")
    shot(page, "panda-verdict-dark")
