"""A report in real Chromium: nothing asked for, nothing wider than the page, no text cut or over another."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from flexviz.report import diagnosed_session, session_report
from tests.found import AFTER, BEFORE, COULOMB, DIAGNOSIS
from tests.small_session import small_session

pytestmark = pytest.mark.browser

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
        groups = tuple((f"{name}_{LONG}", rms, held_out) for name, rms, held_out in AFTER.groups)
        steps.append(replace(AFTER, added=finding, groups=groups))
    steps[0] = replace(BEFORE, groups=tuple((f"{n}_{LONG}", rms, out) for n, rms, out in BEFORE.groups))
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
    page = chromium.new_page(viewport={"width": 688, "height": 1000})  # A4 less its margins
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
