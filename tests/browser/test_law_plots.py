"""The proof of a verdict: the law of what was found through its data, at once and large."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tests.browser.page import button, charts, tab, until

pytestmark = pytest.mark.browser
TITLE = "Coulomb friction of joint2: its law through the data"


@pytest.mark.slow
def test_a_verdict_turns_to_the_law_through_its_data(page: Any, shot: Any) -> None:
    """A person reads: two levels of ± 3 Nm, the step at zero velocity, data on the law."""
    assert tab(page, "Signals").get_attribute("aria-selected") == "true"
    button(page, "Diagnose").click()
    page.get_by_role("button", name="Find the missing effect").click()
    until(lambda: tab(page, "Where it fails").get_attribute("aria-selected") == "true", 120, "the proof")
    drawn = page.locator(".uplot:visible").filter(has_text=TITLE)
    until(lambda: drawn.count() == 2, what="the law beside the finding and large in the tab")
    boxes = [one.bounding_box() for one in drawn.all()]
    assert max(box["height"] for box in boxes) > 300
    assert "motor velocity of joint2 [rad/s]" in drawn.last.inner_text()
    velocity, law, data, *_ = charts(page)[f"{TITLE} [Nm]"]
    assert min(velocity) < -1 and max(velocity) > 1
    known = [one for one in zip(velocity, law, data, strict=True) if not math.isnan(one[2])]
    assert 10 < len(known) < len(law)  # the law is drawn on a finer grid
    assert all(abs(v) < 0.2 or abs(point - line) < 0.1 for v, line, point in known)
    for v, line in zip(velocity, law, strict=True):
        assert abs(v) < 0.2 or abs(line - (3 if v > 0 else -3)) < 0.05
    shot(page, "law")
    named = drawn.last.locator(".u-series:visible .u-label").all_inner_texts()
    assert named == ["motor velocity of joint2 [rad/s]", "law", "data", "± 95 %"]
