"""A real server and a real Chromium; screenshots go where FLEXVIZ_SCREENSHOTS says."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.browser.page import CHROMIUM, FLAGS, PLAIN_LIGHT, SPARE_FRAMES, close_notices

PATIENCE = 300_000  # [ms] for anything on a page: a busy machine draws slowly


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        try:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        except sync_api.Error as error:
            pytest.skip(f"no Chromium ({str(error).splitlines()[0]})")
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def workplace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that the servers are started in and write into."""
    return tmp_path_factory.mktemp("workplace")


@pytest.fixture(scope="module")
def servers() -> list[subprocess.Popen[str]]:
    """The servers that run, the newest last."""
    return []


@pytest.fixture(scope="module")
def serve(workplace: Path, servers: list[subprocess.Popen[str]]) -> Iterator[Callable[..., str]]:
    """serve(SET) -> the page's address."""
    running = servers

    def start(*arguments: str) -> str:
        command = [sys.executable, "-m", "flexviz", "serve", *arguments, "--no-browser", "--port", "0"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=workplace)
        running.append(process)
        assert process.stdout is not None
        found = re.search(r"http://\S+", process.stdout.readline())
        assert found, "the server did not start"
        return found[0]

    yield start
    for process in running:
        process.terminate()
        try:
            process.wait(timeout=15)
        finally:
            process.kill()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    """Beside a failure: what the pages showed."""
    report: Any = yield
    if report.failed and call.when == "call":
        for number, page in enumerate(getattr(item, "pages", ()), start=1):
            report.sections.append((f"page {number}", shown(page)))
    return report


def shown(page: Any) -> str:
    """The texts of a page, and which of its boxes are ticked."""
    ticked = """() => [...document.querySelectorAll('label')]
        .filter(l => document.getElementById(l.htmlFor)?.checked).map(l => l.textContent)"""
    try:
        return f"{page.inner_text('body')}\nticked: {page.evaluate(ticked)}"
    except Exception as error:  # a page that has gone
        return str(error)


@pytest.fixture
def open_page(chromium: Any, request: pytest.FixtureRequest) -> Iterator[Callable[..., Any]]:
    """open_page(address, width, height) -> a page whose plots are there; errors of the page fail the test."""
    pages: list[Any] = []
    request.node.pages = pages
    errors: list[str] = []

    def open_(address: str, width: int = 1280, height: int = 800) -> Any:
        page = chromium.new_page(viewport={"width": width, "height": height})
        pages.append(page)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.set_default_timeout(PATIENCE)
        page.add_init_script(PLAIN_LIGHT)
        page.goto(address)
        page.wait_for_selector(".uplot .u-over")
        page.evaluate(SPARE_FRAMES)
        close_notices(page)
        return page

    yield open_
    for page in pages:
        page.close()
    assert not errors


@pytest.fixture
def shot() -> Callable[[Any, str], bytes]:
    """shot(page, name) -> a screenshot, kept where FLEXVIZ_SCREENSHOTS names a folder."""

    def take(page: Any, name: str) -> bytes:
        picture: bytes = page.screenshot()
        folder = os.environ.get("FLEXVIZ_SCREENSHOTS")
        if folder:
            Path(folder).mkdir(parents=True, exist_ok=True)
            (Path(folder) / f"{name}.png").write_bytes(picture)
        return picture

    return take
