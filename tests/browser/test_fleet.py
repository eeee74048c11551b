"""The results of a batch in the app, by what a person reads: table, drift, a click that opens a set."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from flexviz.outlets.batch.batch import MARKER
from flexviz.outlets.batch.table import TABLE, write_table
from tests.browser.page import SOON, chart, pause, row, status, tab, until, well_laid_out
from tests.outlets.test_batch_fleet import fleet
from tests.small_set import write_small_set

pytestmark = pytest.mark.browser
MONTHS = 6


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of three robots, of which the first becomes softer; two of their sets are there."""
    folder = tmp_path_factory.mktemp("fleet")
    out = folder / "results"
    out.mkdir()
    (out / MARKER).write_text("{}")
    rows = fleet(1, robots=3, months=MONTHS, spread=20.0, slope=-0.5)
    rows = [replace(one, path=str(folder / "lost")) for one in rows]
    for number in (1, 7):
        write_small_set(folder / f"set{number}")
        rows[number] = replace(rows[number], path=str(folder / f"set{number}"))
    nothing: dict[str, Any] = {"residual": None, "found": (), "parameters": {}}
    rows[2] = replace(rows[2], state="failed", error="robot.urdf, <inertial>: no mass", **nothing)
    write_table(rows, out / TABLE)
    return out


def test_a_click_opens_a_set(results: Path, serve: Callable[..., str], open_page: Any, shot: Any) -> None:
    page = open_page(serve(str(results)) + "/?darkMode", 1440, 900)
    pause(page)
    tab(page, "Fleet").click()
    lines = page.locator("tr[data-fleet]")
    until(lambda: lines.count() == 3 * MONTHS, what="the table")
    assert "17 effects missing, 1 failed" in page.locator(".fv", has_text="A click opens a set").inner_text()
    # the robot that drifts is shown first, with the years' change and the values of its dates
    said = page.locator(".fv-dim", has_text="Drifts by")
    until(said.count, what="the drift")
    assert "in 150 days" in said.inner_text() and "Nm/rad per year" in said.inner_text()
    days, value, *_ = chart(page, "robot0: stiffness, joint1")
    assert days == [0, 30, 90, 120, 150] and value[-1] < value[0] - 40  # a failed set has no value
    opened = page.locator("tr.fv-open")
    until(lambda: opened.locator("td").first.inner_text() == "2", SOON, "the open set")
    for width, height in ((1280, 800), (1920, 1080), (1440, 900)):
        page.set_viewport_size({"width": width, "height": height})
        well_laid_out(page)
        shot(page, f"fleet-{width}")
    # the address asks for the dark theme, so there is nothing to choose; and no plot of models to save yet
    assert page.get_by_text("Dark theme", exact=True).is_hidden()
    tab(page, "Compare").click()
    until(lambda: not page.locator("button:visible", has_text="Save plots").count(), 20, "no button")
    tab(page, "Fleet").click()
    lines.nth(7).locator("td").nth(1).click()
    until(lambda: opened.count() and opened.locator("td").first.inner_text() == "8", what="the other set")
    chosen = row(page, "Measurement set").locator("input").first
    until(lambda: chosen.input_value() == "set7", SOON, "its name in the list")
    until(lambda: page.locator(".fv", has_text="robot1/2025-02-09").count(), what="what was found about it")
    lines.nth(2).locator("td").nth(1).click()  # its folder is not there
    until(lambda: "not there any more" in status(page), what="the reason")
    until(page.get_by_text("robot.urdf, <inertial>: no mass").count, SOON, "what went wrong with it")
    assert str(results.parent) not in page.content().replace(str(results.parent / "lost"), "")
