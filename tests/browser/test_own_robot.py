"""A stranger's path: from a URDF and two CSV files in degrees and mA to the name of the missing effect."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from own_robot_files import CONSTANTS, GEARS, Stranger, write_files

from flexviz.data.importing import read_mapping
from flexviz.outlets.app.page_script import SCREEN_LABEL
from tests.browser.page import SOON, button, choose, press, row, status, tab, until, well_laid_out, within

pytestmark = pytest.mark.browser
PRESSES = """() => { window.presses = 0;
    document.addEventListener('pointerdown', e => { if (e.isTrusted) window.presses += 1; }, true); }"""
MOST_PRESSES = 12
# in one go: of the keys only the first is sent before the page's own command, the others wait
TYPED_AND_LEFT = """(one, label) => {
    one.focus();
    for (const text of ['0', '0.', '0.2']) {
        Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(one, text);
        one.dispatchEvent(new Event('input', { bubbles: true }));
    }
    const quiet = window.flexvizPage.quiet();
    window.flexvizPage.tell(label, 'a report');
    one.blur();
    return quiet;
}"""


@pytest.fixture(scope="module")
def stranger(tmp_path_factory: pytest.TempPathFactory) -> Stranger:
    return write_files(tmp_path_factory.mktemp("stranger"))


def drag(page: Any, *files: Path, drop: bool = True) -> None:
    """Drag files from a file manager onto the robots, and drop them."""
    browser = page.context.new_cdp_session(page)
    data = {"items": [], "files": [str(file) for file in files], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", *(["drop"] if drop else [])):
        browser.send("Input.dispatchDragEvent", {"type": kind, "x": 650, "y": 250, "data": data})


def fill(page: Any, label: str, text: str) -> None:
    """Click into a text and type instead of what stands there."""
    row(page, label).get_by_role("textbox").click()
    retype(page, text)


def retype(page: Any, text: str) -> None:
    """Type instead of what stands in the focused text."""
    page.keyboard.press("Control+A")
    page.keyboard.type(text)


def next_text(page: Any, text: str) -> None:
    """Go to the next text with the keyboard and type."""
    page.keyboard.press("Tab")
    retype(page, text)


def form(page: Any) -> str:
    """What the page says."""
    return page.inner_text("body")


def says(page: Any, text: str) -> None:
    until(lambda: text in form(page), what=f"{text!r}")


def listed(values: tuple[float, ...]) -> str:
    return ", ".join(f"{value:g}" for value in values)


def test_from_own_files_to_a_named_effect(
    stranger: Stranger, serve: Callable[..., str], open_page: Any, shot: Any, tmp_path: Path, workplace: Path
) -> None:
    notes = tmp_path / "notes.pdf"
    notes.write_text("not a log")
    page = open_page(serve(), 1440, 900)
    button(page, "Diagnose").click()  # files may be dropped in any step
    page.evaluate(PRESSES)
    drag(page, stranger.urdf, notes, *stranger.logs, drop=False)
    says(page, "Drop a URDF and logs")
    shot(page, "own-robot-drag")
    drag(page, stranger.urdf, notes, *stranger.logs)
    presses = 1
    says(page, "Still to be stated:")
    runs = r"bare\s+bare.csv\s+fit\s+none\s+loaded\s+loaded.csv\s+validate\s+none"
    until(lambda: re.search(runs, form(page)), what="the table of runs")
    text = form(page)
    assert "Drop a URDF and logs" not in text and "Nothing leaves this machine." in text
    assert "my arm.urdf: 2 joints. Logs: bare.csv and loaded.csv." in text
    assert "Not used: notes.pdf: a URDF, meshes, logs" in text
    assert "torque constants in Nm/A: τ of joint1, joint2 is a current" in text
    table = page.locator(".fv-own")
    assert table.locator("svg polyline").count() == 4
    for column, unit in (("pos_1_deg", "deg"), ("current_1", "A"), ("pos_2_deg", "deg"), ("current_2", "A")):
        assert f"{column}\n{unit}\n" in table.inner_text()
    assert button(page, "Open").is_disabled()

    fill(page, "Gear ratios", listed(GEARS))
    next_text(page, listed(CONSTANTS))
    until(lambda: "current_1\nA, before the gear\n" in table.inner_text(), what="the gear in the table")
    button(page, "Open").click()
    says(page, "The data contradict 1 entry")
    assert "Wrong: tau of joint1, joint2: it is" in table.inner_text()
    assert (tab(page, "Signals").count(), button(page, "Open anyway").is_enabled()) == (1, True)
    shot(page, "own-robot-doubt")
    well_laid_out(page)
    button(page, "τ of joint1, joint2: unit mA").click()
    says(page, "Checked:")
    assert "Wrong:" not in table.inner_text() and "current_2\nmA, before the gear\n" in table.inner_text()

    page.get_by_text("Add a payload", exact=True).click()
    until(lambda: page.get_by_role("button", name="Add payload", exact=True).is_visible())
    page.wait_for_timeout(500)  # it unfolds
    fill(page, "Mass [kg]", f"{stranger.payload.mass:.4f}")
    next_text(page, listed(stranger.payload.com))
    next_text(page, listed(stranger.payload.inertia))
    loaded = r"loaded\.csv\s+validate\s+[\d.]+ kg"
    press(page, "Add payload", lambda: re.search(loaded, form(page)))  # a slow page may lag behind the keys
    shot(page, "own-robot-payload")
    well_laid_out(page)

    button(page, "Open").click()
    until(lambda: row(page, "Measurement set").get_by_role("combobox").input_value() == "my arm")
    assert "Your own robot" not in form(page)
    assert (workplace / "sessions" / "my arm" / "measurements.toml").is_file()
    button(page, "Diagnose").click()
    until(lambda: page.get_by_role("button", name="Find the missing effect").is_visible())
    button(page, "Find the missing effect").click()
    says(page, "Missing: Torque ripple on joint2")
    presses += page.evaluate("window.presses")
    assert presses <= MOST_PRESSES, presses
    found = float(re.findall(r"amplitude\s+([\d.]+)", form(page))[0])
    assert found == pytest.approx(stranger.amplitude, rel=0.02)
    shot(page, "own-robot-named")


@pytest.mark.slow
def test_several_files_chosen_at_once_and_the_mapping(
    stranger: Stranger, serve: Callable[..., str], open_page: Any, shot: Any, tmp_path: Path
) -> None:
    page = open_page(f"{serve()}/?darkMode", 1280, 800)
    button(page, "Data").click()
    with page.expect_file_chooser() as chooser:
        button(page, "Your robot: URDF and logs").click()
    chooser.value.set_files([str(file) for file in (*stranger.logs, stranger.urdf)])
    says(page, "Still to be stated:")
    box = row(page, "Torque constants").get_by_role("textbox")
    page.wait_for_function("() => window.flexvizPage.quiet()")
    assert box.evaluate(TYPED_AND_LEFT, SCREEN_LABEL) is False  # meanwhile the page keeps its reports
    says(page, "0.2 Nm/A")
    fill(page, "Torque constants", "0.11, x")
    says(page, "found '0.11, x', expected one number, or 2 with commas, above 0")
    fill(page, "Torque constants", listed(CONSTANTS))
    fill(page, "Gear ratios", listed(GEARS))
    page.locator("tr[data-own]", has_text="current_2").click()
    until(lambda: row(page, "Correct").get_by_role("combobox").input_value() == "τ of joint2")
    choose(page, "Unit", "mA")
    choose(page, "Sign", "− (reversed)")
    choose(page, "Gravity along", "+x: on a wall")
    until(lambda: "mA, before the gear, sign reversed" in page.locator(".fv-own").inner_text())
    shot(page, "own-robot-dark")
    well_laid_out(page)
    with page.expect_download() as download:
        button(page, "Download mapping").click()
    file = tmp_path / download.value.suggested_filename
    download.value.save_as(file)
    mapping = read_mapping(file)
    joint = mapping.joints["joint2"]
    assert joint.tau is not None
    assert (joint.gear, joint.torque_constant, joint.tau.unit, joint.tau.sign) == (80.0, 0.09, "mA", -1)
    assert mapping.gravity == [9.81, 0.0, 0.0]
    assert (mapping.robot, [log.file for log in mapping.logs]) == ("my arm.urdf", ["bare.csv", "loaded.csv"])
    press(page, "Discard", lambda: "Your own robot" not in form(page))
    assert within(SOON, lambda: "bad" not in status(page))
