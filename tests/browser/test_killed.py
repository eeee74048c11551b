"""What nobody saved is there again after the server was killed."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.browser.page import EXAMPLE_SET, SOON, button, status, until

pytestmark = pytest.mark.browser


def error(page: Any) -> str:
    found = re.search(r"validation error [\d.]+ % of the torque, most on \w+: [\d.]+ %", status(page))
    return found[0] if found else ""


@pytest.mark.slow
def test_unsaved_work_outlives_a_killed_server(
    serve: Callable[..., str],
    workplace: Path,
    servers: dict[str, subprocess.Popen[str]],
    open_page: Any,
    shot: Any,
) -> None:
    address = serve(EXAMPLE_SET)
    page = open_page(address)
    button(page, "Identify").click()
    button(page, "Run").click()
    known = until(lambda: error(page), what="a result")
    until(lambda: not button(page, "Stop").is_enabled(), what="the end")
    # work is kept soon, not at once; session.json is written last
    until(lambda: list((workplace / "sessions" / ".unsaved").rglob("session.json")), 60, "the kept work")
    servers[address].kill()
    servers[address].wait()

    again = open_page(serve())
    assert button(again, "Undo").is_disabled()
    offered = again.get_by_role("button", name="Continue unsaved work")
    until(lambda: offered.is_visible(), what="the offer")
    shot(again, "unsaved")
    offered.click()
    until(lambda: error(again) == known, what="the result again")
    until(button(again, "Undo").is_enabled, SOON, "the undo")
