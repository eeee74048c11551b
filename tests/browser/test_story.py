"""The whole story in real Chromium: load, tune, run, stop, find, add, the error falls, undo, save, reopen.

What the page says is held against what the command line says about the same set.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.base.resources import sessions_dir
from flexviz.outlets.app import DEMO
from tests.browser.page import (
    EXAMPLE_SET,
    SOON,
    button,
    chart,
    charts,
    choose,
    error,
    pause,
    pin,
    row,
    status,
    tab,
    tick,
    unfold,
    until,
    well_laid_out,
)

pytestmark = pytest.mark.browser
TUNED = 25.0  # [rad/s]
MANY = Path(__file__).resolve().parents[3] / "shared" / "robotlike" / "cases" / "robotlike-panda-02"


class CommandLine:
    """flexviz's commands on the demonstration set, begun early and read late."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, *arguments: str) -> None:
        command = [sys.executable, "-m", "flexviz", *arguments, "--json", str(self._folder / f"{name}.json")]
        self._running[name] = subprocess.Popen(
            command,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
        )

    def result(self, name: str) -> dict[str, Any]:
        assert self._running[name].wait(timeout=900) == 0
        return json.loads((self._folder / f"{name}.json").read_text())


@pytest.fixture(scope="module")
def command_line(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CommandLine]:
    one = CommandLine(tmp_path_factory.mktemp("json"))
    demo = str(sessions_dir() / DEMO)
    one.start("tuned", "identify", demo, "--quick", "--bandwidth", str(TUNED))
    one.start("diagnosis", "diagnose", demo, "--apply")
    yield one
    for process in one._running.values():
        process.kill()


def mean_share(step: dict[str, Any], spread: list[float], name: str = "rms_validation") -> float:
    """The mean of the joints' errors in per cent of their torque."""
    return 100 * float(np.mean(np.divide(step[name], spread)))


def test_the_missing_effect_is_found_added_saved_and_reopened(
    serve: Callable[..., str], workplace: Path, open_page: Any, shot: Any, command_line: CommandLine
) -> None:
    page = open_page(serve())
    clicks = 0

    def click(where: Any) -> None:
        nonlocal clicks
        clicks += 1
        where.click()

    # from the start to the falling error: each click counted, as docs/tutorial.md lists them
    assert "Find out why" in page.locator(".fv-wrong").inner_text()
    assert button(page, "Undo").is_disabled() and button(page, "Redo").is_disabled()
    click(page.get_by_role("button", name="Find the missing effect"))
    verdict = page.locator(".fv-verdict")
    until(
        lambda: verdict.count() and not page.get_by_role("button", name="Stop").is_enabled(), 180, "a verdict"
    )
    assert verdict.inner_text().startswith("Missing: Coulomb friction on joint2")
    before = error(page)
    value = re.search(r"coulomb ([\d.]+) ± ([\d.]+) Nm", page.locator(".fv-finding").first.inner_text())
    assert value and abs(float(value[1]) - 3.0) < 0.01
    until(lambda: page.get_by_role("button", name="Hide evidence").first.is_enabled, what="its evidence")
    pause(page)
    shot(page, "diagnose")
    well_laid_out(page)
    click(page.get_by_role("button", name="Add and refit").first)
    click(tab(page, "Compare"))
    until(lambda: verdict.inner_text().startswith("Nothing is missing"), what="the second look")
    assert clicks == 3

    # the numbers are the command line's
    until(lambda: not button(page, "Stop").is_enabled() and error(page) < before, what="the new error")
    after = error(page)
    document = command_line.result("diagnosis")
    spread = document["torque"]["spread"]
    for said, step in zip((before, after), document["steps"], strict=True):
        assert said == pytest.approx(mean_share(step, spread), rel=0.01)
    assert after < before / 40
    assert document["verdict"] == "missing" and document["candidates"][0]["joint"] == "joint2"
    assert float(value[1]) == pytest.approx(
        document["candidates"][0]["parameters"]["coulomb"]["value"], rel=1e-3
    )
    table = page.locator(".fv-table tr").filter(has_text=re.compile(r"^\d\. "))
    rows = until(
        lambda: (texts := table.all_inner_texts()) and len(texts) >= len(document["steps"]) and texts,
        60,
        "the table of steps",
    )
    for text, step in zip(rows, document["steps"], strict=True):
        fit, held_out = (float(x) for x in re.findall(r"\t([\d.]+)", text))
        assert fit == pytest.approx(mean_share(step, spread, "rms"), rel=0.01)
        assert held_out == pytest.approx(mean_share(step, spread), rel=0.01)
    assert error(page) == held_out  # of the last row
    assert "the same measure for every model" in page.inner_text("body")
    model_steps = until(lambda: chart(page, "Error after each added effect, all joints"), what="staircase")
    assert all(line[0] > 20 * line[-1] for line in model_steps[1:-1])
    shot(page, "compare")
    well_laid_out(page)

    # undo and redo bring results back at once
    button(page, "Undo").click()
    until(lambda: verdict.inner_text().startswith("Missing:"), what="the undo")
    until(lambda: error(page) == before and button(page, "Redo").is_enabled(), what="the error before")
    button(page, "Redo").click()
    until(lambda: verdict.inner_text().startswith("Nothing is missing"), what="the redo")

    # saved, reloaded, reopened
    button(page, "Data").click()
    page.get_by_role("button", name="Save session").click()
    until(lambda: "session saved in ./sessions/" in status(page), what="the saved session")
    said = status(page)
    page.reload()
    page.wait_for_selector(".fv-status", timeout=60_000)
    until(lambda: status(page) == said, what="the same status after reloading")
    saved = next((workplace / "sessions").glob("planar-2r-demo-*"))
    again = open_page(serve(str(saved)))
    until(lambda: error(again) == after and button(again, "Undo").is_enabled(), what="the saved result")
    button(again, "Diagnose").click()
    until(lambda: again.locator(".fv-verdict").count(), what="the verdict again")
    assert again.locator(".fv-verdict").inner_text().startswith("Nothing is missing")


def parameter(page: Any, name: str, joint: str) -> float:
    """A value in the parameter table."""
    rows = page.locator(".fv-table tr").filter(has_not=page.locator("th")).all_inner_texts()
    first = next(i for i, text in enumerate(rows) if text.strip() == joint)
    cells = next(text.split("\t") for text in rows[first + 1 :] if text.startswith(f"{name}\t"))
    thousands = any(cell.startswith("kNm") for cell in cells)
    return float(cells[2].replace("−", "-")) * (1e3 if thousands else 1.0)


@pytest.mark.slow
def test_tuned_run_and_stopped_and_two_pages_show_the_same(
    serve: Callable[..., str], open_page: Any, shot: Any, command_line: CommandLine
) -> None:
    address = serve(EXAMPLE_SET)
    page = open_page(address)
    pause(page)
    pin(page)
    button(page, "Observer").click()
    tab(page, "States").click()
    until(lambda: any(str(title).startswith("θ⁗") for title in charts(page)), what="the states")
    before = chart(page, "θ⁗")
    typed = row(page, "exactly").get_by_role("textbox")
    typed.fill(f"{TUNED:g}")
    typed.press("Enter")
    until(lambda: f"bandwidth {TUNED:.2f} rad/s" in page.inner_text("body"), what="the bandwidth")
    until(lambda: chart(page, "θ⁗") != before, what="its states")
    shot(page, "observer")
    well_laid_out(page)

    button(page, "Identify").click()
    tick(page, "Refine", False)
    tab(page, "Convergence").click()
    button(page, "Run").click()
    until(lambda: "converged after" in status(page), what="a result")
    expected = command_line.result("tuned")
    # the error does not depend on the observer: it is nearly the one that the diagnosis states
    told = command_line.result("diagnosis")
    steps = told["steps"]
    said = until(lambda: np.isfinite(error(page)) and error(page), what="the error")
    assert said == pytest.approx(
        mean_share(steps[0], told["torque"]["spread"]), rel=0.05
    )  # beside a weak CAD prior
    for known in expected["parameters"]:
        if known["name"] in ("stiffness", "motor_inertia"):
            name = "K" if known["name"] == "stiffness" else "B"
            rounded = max(1e-2 * known["value"], 0.5 * (known["std"] or 0.0))  # to its interval's digits
            assert parameter(page, name, known["joint"]) == pytest.approx(known["value"], abs=rounded)
    cost = until(lambda: chart(page, "Cost"), what="the cost")
    iterations = re.search(r"converged after (\d+) iterations", status(page))
    assert iterations and len(cost[0]) == 2 * int(iterations[1])  # corners of a staircase
    shot(page, "identify")
    well_laid_out(page)

    # a second page shows the same, and what one changes the other shows too
    two = open_page(address)
    until(lambda: status(two) == status(page), what="the same status")
    until(lambda: parameter(two, "K", "joint1") == parameter(page, "K", "joint1"), SOON, "the same table")
    choose(two, "Joint", "joint2")
    until(lambda: row(page, "Joint").get_by_role("combobox").input_value() == "joint2", what="the other page")
    until(
        lambda: chart(page, "Residual, joint2")[:-1] == chart(two, "Residual, joint2")[:-1], what="its plots"
    )

    # a run that is stopped keeps what it has, the next one may start, and what was there comes back
    tick(page, "Refine")
    known = error(page)
    button(page, "Run").click()
    # the first step is the start itself: what it has is not yet as good as what was there
    until(lambda: re.search(r"iteration ([2-9]|\d\d)", status(two)), what="steps, on the other page")
    button(two, "Stop").click()
    until(lambda: "stopped" in status(page) and not button(page, "Stop").is_enabled(), what="the end")
    until(lambda: np.isfinite(error(page)), what="its error")
    assert error(page) < 2 * known
    until(button(page, "Run").is_enabled, SOON, "the next run")
    button(page, "Undo").click()
    until(lambda: "undone" in status(page) and error(page) == known, 60, "the result before")


@pytest.mark.slow
def test_where_it_fails_marks_a_range_and_files_come_and_go(
    serve: Callable[..., str], open_page: Any, shot: Any, tmp_path: Path
) -> None:
    page = open_page(serve(EXAMPLE_SET))
    pin(page)
    for name in ("Where it fails", "Compare", "Convergence"):
        tab(page, name).click()
        until(lambda: "press" in page.inner_text("body") or "after Run" in page.inner_text("body"), what=name)
    button(page, "Identify").click()
    button(page, "Run").click()
    until(lambda: "converge" in status(page), what="a result")
    tab(page, "Where it fails").click()
    choose(page, "Highlight", "velocity")
    until(lambda: "of the time in this group" in page.inner_text("body"), what="the range")
    found = until(
        lambda: any(t.startswith("Residual of joint1 against velocity") for t in charts(page)), what="it"
    )
    assert found
    over_time = until(
        lambda: [d for t, d in charts(page).items() if "against time" in t and len(d) > 4 and any(d[4])],
        60,
        "the marked instants",
    )
    assert {bool(value) for value in over_time[0][4]} == {False, True}
    heat = page.locator(".fv-heat td[title^='joint2, velocity']").inner_text()
    assert float(heat.split()[0]) > 80  # [%] what Coulomb friction leaves lies along the velocity
    spectrum = until(lambda: chart(page, "Spectrum of the residual of joint1"), what="the spectrum")
    assert len(spectrum) == 3 and all(value > 0 for line in spectrum[1:] for value in line)  # over its floor
    shot(page, "where")
    well_laid_out(page)

    # a session goes out as a zip and comes in again
    button(page, "Data").click()
    with page.expect_download(timeout=60_000) as download:
        page.get_by_role("button", name="Download session").click()
    file = tmp_path / download.value.suggested_filename
    download.value.save_as(file)
    assert file.suffix == ".zip" and file.stat().st_size > 100_000
    upload = page.get_by_role("button", name="Upload", exact=True)
    unfold(page, "Another set", upload)
    upload.locator("xpath=..").locator("input[type=file]").set_input_files(str(file))
    chosen = row(page, "Measurement set").get_by_role("combobox")
    until(lambda: "planar-2r-demo-session" in chosen.input_value(), what="the uploaded session")
    until(lambda: "validation error" in status(page), 60, "its result")
    bad = tmp_path / "bad.zip"
    bad.write_bytes(b"PK nothing")
    upload.locator("xpath=..").locator("input[type=file]").set_input_files(str(bad))
    until(lambda: "not a usable zip" in status(page), what="the refusal")


@pytest.mark.slow
@pytest.mark.skipif(not MANY.exists(), reason="needs a set on which a search takes some time")
def test_a_search_tells_how_far_it_has_come_and_can_be_stopped(
    serve: Callable[..., str], open_page: Any
) -> None:
    page = open_page(serve(str(MANY)))
    button(page, "Diagnose").click()
    page.get_by_role("button", name="Find the missing effect").click()
    so_far = page.locator(".fv-so-far")
    until(lambda: so_far.count() and "(being checked)" in so_far.inner_text(), what="the best model so far")
    assert so_far.inner_text().startswith("So far: Coulomb friction on ")
    button(page, "Stop").click()
    until(lambda: "stopped" in status(page), what="the end of the search")
    verdict = page.locator(".fv-verdict")
    until(lambda: verdict.count() and "friction on" in verdict.inner_text(), what="what was found")
    assert page.get_by_text("Stopped before the end: these are the findings so far.").count()
