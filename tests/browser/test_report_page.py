"""A report in real Chromium: nothing asked for, nothing wider than the page, no text cut or over another."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexviz.content.charts import COLOURS, rgb
from flexviz.outlets.report import diagnosed_session, session_animation, session_report
from tests.found import AFTER, BEFORE, COULOMB, DIAGNOSIS
from tests.small_session import small_session

pytestmark = pytest.mark.browser

A4: Any = {"width": 688, "height": 1005}  # [px] less its margins
LONG = "a_payload_that_somebody_called_by_a_very_long_name_without_any_space_in_it"
OVERLAPS = """() => {
  const found = [];
  for (const svg of document.querySelectorAll('figure svg')) {
    const frame = svg.getBoundingClientRect();
    const boxes = [...svg.querySelectorAll('text')].map(t => [t.textContent, t.getBoundingClientRect()]);
    for (const [text, b] of boxes) {
      if (b.left < frame.left - 1 || b.right > frame.right + 1 || b.top < frame.top - 1
          || b.bottom > frame.bottom + 1) found.push('cut: ' + text);
    }
    for (let i = 0; i < boxes.length; i++) for (let j = i + 1; j < boxes.length; j++) {
      const a = boxes[i][1], b = boxes[j][1];
      if (a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 2 && b.top < a.bottom - 2)
        found.push('over one another: ' + boxes[i][0] + ' / ' + boxes[j][0]);
    }
  }
  return found;
}"""
WIDE = """() => [...document.querySelectorAll('p, h1, h2, h3, li, pre, figcaption, dd, .wide, figure')]
  .filter(e => e.getBoundingClientRect().right > document.documentElement.clientWidth + 1)
  .map(e => e.tagName + ': ' + e.textContent.slice(0, 60))"""
TABLES = """() => [...document.querySelectorAll('.wide')].filter(e => e.scrollWidth > e.clientWidth + 1)
  .map(e => e.textContent.slice(0, 60))"""


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report with many effects and long names."""
    folder = tmp_path_factory.mktemp("report")
    measurements, _ = small_session(folder / "small")
    steps = [BEFORE]
    for number in range(8):
        finding = replace(COULOMB, joint=None, payload=f"p{number}_{LONG}")
        groups = tuple(replace(one, name=f"{one.name}_{LONG}") for one in AFTER.groups)
        steps.append(replace(AFTER, added=finding, groups=groups))
    steps[0] = replace(BEFORE, groups=tuple(replace(one, name=f"{one.name}_{LONG}") for one in BEFORE.groups))
    found = replace(DIAGNOSIS, steps=tuple(steps))
    file = folder / "report.html"
    file.write_text(session_report(diagnosed_session(measurements, found).with_note(LONG * 3), measurements))
    return file


@pytest.mark.parametrize("width", [1280, 760, 400])
def test_it_fits_every_window(chromium: Any, page_file: Path, width: int, shot: Any) -> None:
    page = chromium.new_page(viewport={"width": width, "height": 900})
    asked: list[str] = []
    said: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.goto(page_file.as_uri())
    shot(page, f"report-{width}")
    assert asked == [page_file.as_uri()] and not said
    assert page.evaluate(WIDE) == []
    assert page.evaluate(OVERLAPS) == []
    assert page.evaluate("document.querySelectorAll('figure svg').length") >= 10
    page.close()


def test_it_prints_on_a4_with_nothing_cut(chromium: Any, page_file: Path) -> None:
    page = chromium.new_page(viewport=A4)
    page.emulate_media(media="print")
    page.goto(page_file.as_uri())
    assert page.evaluate(WIDE) == [] and page.evaluate(TABLES) == [] and page.evaluate(OVERLAPS) == []
    background = "getComputedStyle(document.body).backgroundColor"
    assert page.evaluate(background) == "rgb(255, 255, 255)"
    pdf: bytes = page.pdf(prefer_css_page_size=True, print_background=True)
    sizes = set(re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", pdf))
    assert {(round(float(w)), round(float(h))) for w, h in sizes} <= {(595, 842), (594, 842), (595, 841)}
    assert 5 <= len(re.findall(rb"/Type /Page\b", pdf)) <= 30
    page.close()


@pytest.fixture(scope="module")
def diagnosed() -> Any:
    """The bundled set and its session after a diagnosis that added what it found."""
    from flexviz.analysis.diagnosis import diagnose
    from flexviz.base.resources import sessions_dir
    from flexviz.data.measurements import read_set

    measurements = read_set(sessions_dir() / "planar-2r-demo")
    return measurements, diagnosed_session(measurements, diagnose(measurements, apply=True))


def test_the_proof_is_on_the_first_two_of_at_most_six_pages(
    chromium: Any, diagnosed: Any, tmp_path: Path, shot: Any
) -> None:
    measurements, session = diagnosed
    file = tmp_path / "report.html"
    file.write_text(session_report(session, measurements))
    page = chromium.new_page(viewport=A4)
    page.emulate_media(media="print")
    page.goto(file.as_uri())
    pdf: bytes = page.pdf(prefer_css_page_size=True, print_background=True)
    assert len(re.findall(rb"/Type /Page\b", pdf)) <= 6
    tops = page.evaluate(
        """() => Object.fromEntries([...document.querySelectorAll('figcaption b')]
            .map(b => [b.textContent.split('. ')[1], b.getBoundingClientRect().top]))"""
    )
    robot, torques = tops["The robot."], [tops["joint1."], tops["joint2."]]
    assert max(robot, *torques) < 2 * A4["height"]
    assert page.evaluate(OVERLAPS) == []
    text = page.inner_text("main")
    assert "Added: Coulomb friction on joint2" in text and "Missing:" not in text
    shot(page, "report-printed")
    page.close()


def test_the_animation_shows_both_robots_and_the_factor(
    chromium: Any, diagnosed: Any, tmp_path: Path, shot: Any
) -> None:
    """A person sees the measured robot left, the identified one right, exaggerated; it plays and scrubs."""
    measurements, session = diagnosed
    file = tmp_path / "animation.html"
    file.write_text(session_animation(session, measurements))
    page = chromium.new_page(viewport={"width": 1000, "height": 760})
    asked: list[str] = []
    said: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.goto(file.as_uri())
    page.get_by_role("button", name="Pause").click()
    assert page.inner_text("#measured") == "measured (simulated data)"
    factor = page.get_by_label("Error ×")
    assert page.inner_text("#identified") == f"identified (after), error × {factor.input_value()}"
    scrub = page.get_by_label("time")
    pictures = []
    for place in (20, 150):
        scrub.fill(str(place))
        pictures.append(page.locator("canvas").screenshot())
    clock = page.inner_text("#clock")
    assert clock.startswith("6.0")  # 25 frames a second
    left, right = (coloured(pictures[1], half) for half in (0, 1))
    assert left[0] > 500 and left[1] == 0 and right[1] > 500 and right[0] == 0
    assert pictures[0] != pictures[1]
    page.get_by_label("before").check()
    factor.select_option("500")
    assert page.inner_text("#identified") == "identified (before), error × 500"
    before = page.locator("canvas").screenshot()
    page.get_by_label("after").check()
    assert page.locator("canvas").screenshot() != before
    shot(page, "animation")
    page.get_by_role("button", name="Play").click()
    page.wait_for_function("before => document.getElementById('clock').textContent !== before", arg=clock)
    assert asked == [file.as_uri()] and not said
    page.close()


def coloured(picture: bytes, half: int) -> tuple[int, int]:
    """Pixels with the hue of measured data and of the model in the left (0) or right half of a picture."""
    from PIL import Image

    pixels = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=float)
    width = pixels.shape[1] // 2
    area = pixels[:, half * width : (half + 1) * width].reshape(-1, 3)
    vivid = area[area.max(axis=1) - area.min(axis=1) > 60]
    hues = (np.array(rgb(colour), dtype=float) for colour in (COLOURS.measured, COLOURS.model))
    measured, model = (
        int(np.sum(vivid @ hue > 0.98 * np.linalg.norm(vivid, axis=1) * np.linalg.norm(hue))) for hue in hues
    )
    return measured, model
