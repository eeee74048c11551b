"""While the missing effect is looked for, the page shows a residual, a matrix that fills in, and a law."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.browser.page import button, until

pytestmark = pytest.mark.browser

# what is on the page, each time that it has changed
WATCH = """() => {
    window.seen = [];
    let last = '';
    setInterval(() => {
        const text = name => document.querySelector(name)?.innerText ?? '';
        const charts = Object.values(window.__viserTestpoints?.uplots ?? {}).map(u => ({
            title: u.chart.root.querySelector('.u-title')?.textContent ?? '',
            labels: u.chart.series.map(s => s.label),
            axis: [u.chart.scales.y.min, u.chart.scales.y.max],
            data: u.chart.data.map(d => Array.from(d))}))
            .filter(c => c.title.includes('search') || c.title.includes('its law'));
        const now = {status: text('.fv-status'), matrix: text('.fv-alone'), best: text('.fv-so-far'),
            verdict: text('.fv-verdict'), charts};
        const key = JSON.stringify(now);
        if (key !== last) window.seen.push(now);
        last = key;
    }, 30);
}"""


@pytest.mark.slow
def test_a_search_shows_what_it_has_found_so_far(page: Any, shot: Callable[[Any, str], bytes]) -> None:
    page.evaluate(WATCH)
    button(page, "Diagnose").click()
    page.get_by_role("button", name="Find the missing effect").click()
    until(lambda: page.locator(".fv-alone").count(), what="the matrix")
    shot(page, "searching")
    until(lambda: "Missing:" in page.locator(".fv-verdict").inner_text(), what="the verdict")
    seen: list[dict[str, Any]] = page.evaluate("window.seen")
    searching = [one for one in seen if one["charts"] and not one["verdict"]]

    first = searching[0]["charts"][0]  # the first model's residual comes before any candidate
    assert first["title"] == "Residual of joint2, t1p1: the model before the search [Nm]"
    largest = np.abs(first["data"][1]).max()
    assert 2.0 < largest < 5.0  # Coulomb friction of 3 Nm is missing there
    fallen = [one["charts"][0] for one in searching if one["charts"][0]["title"].endswith("searching [Nm]")]
    assert fallen and fallen[-1]["labels"][1:3] == ["the model so far", "with the leading candidate"]
    assert fallen[-1]["axis"] == pytest.approx(first["axis"])
    assert np.abs(fallen[-1]["data"][1]).max() == pytest.approx(largest, rel=1e-3)  # in grey
    assert np.abs(fallen[-1]["data"][2]).max() < 0.1 * largest

    matrices = [one["matrix"] for one in searching if one["matrix"]]
    friction = next(line for line in matrices[-1].splitlines() if line.startswith("Coulomb friction\t"))
    assert friction.split("\t")[1:] == ["0", "100✓"]
    assert "…" not in matrices[-1]

    law = next(c for one in searching for c in one["charts"] if "its law through the data" in c["title"])
    assert law["title"].startswith("Coulomb friction of joint2")
    velocity, line, data = (np.array(row) for row in law["data"][:3])
    moving = (np.abs(velocity) > 0.1) & np.isfinite(data)  # the law is drawn on a finer grid
    assert np.count_nonzero(moving) > 8
    assert data[moving] == pytest.approx(
        3.0 * np.sign(velocity[moving]), abs=0.15
    )  # what the set was made with
    assert line[moving] == pytest.approx(data[moving], abs=0.15)
    assert any(" left" in one["status"] for one in searching)
    assert not page.locator(".fv-alone").count()  # the verdict takes its place
