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

from tests.browser.page import (
    CHROMIUM,
    EXAMPLE_SET,
    FLAGS,
    PLAIN_SCENE,
    SPARE_FRAMES,
    close_notices,
    pause,
    picture,
    tab,
)

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
def servers() -> dict[str, subprocess.Popen[str]]:
    """The servers that run, by address."""
    return {}


@pytest.fixture(scope="module")
def serve(workplace: Path, servers: dict[str, subprocess.Popen[str]]) -> Iterator[Callable[..., str]]:
    """serve(SET) -> the page's address."""

    def start(*arguments: str) -> str:
        command = [sys.executable, "-m", "flexviz", "serve", *arguments, "--no-browser", "--port", "0"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=workplace)
        assert process.stdout is not None
        found = re.search(r"http://\S+", process.stdout.readline())
        servers[found[0] if found else f"none, {len(servers)}"] = process
        assert found, "the server did not start"
        return found[0]

    yield start
    for process in servers.values():
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


def opened(chromium: Any, errors: list[str], address: str, width: int = 1280, height: int = 800) -> Any:
    """A page whose plots are there; what goes wrong on it is added to `errors`."""
    # reduced motion: a number that counts down is no result yet
    page = chromium.new_page(viewport={"width": width, "height": height}, reduced_motion="reduce")
    page.on("pageerror", lambda error: errors.append(f"{error}\n{error.stack}"))
    page.set_default_timeout(PATIENCE)
    page.add_init_script(PLAIN_SCENE)
    page.goto(address)
    page.wait_for_selector(".uplot .u-over", state="attached")  # on a narrow page a tab hides them
    page.evaluate(SPARE_FRAMES)
    page.evaluate("window.sceneIsHidden = true")
    close_notices(page)
    return page


def rested(page: Any) -> Any:
    """A page whose robots rest: to draw them while they play costs a third of a core."""
    if page.viewport_size["width"] > 700:  # a narrower one has no button for it
        pause(page)
    return page


@pytest.fixture
def open_page(chromium: Any, request: pytest.FixtureRequest) -> Iterator[Callable[..., Any]]:
    """open_page(address, width, height) -> a page whose robots rest; errors of the page fail the test."""
    pages: list[Any] = []
    request.node.pages = pages
    errors: list[str] = []

    def open_(*arguments: Any) -> Any:
        pages.append(opened(chromium, errors, *arguments))
        return rested(pages[-1])

    yield open_
    for page in pages:
        page.close()
    assert not errors


@pytest.fixture(scope="module")
def address(serve: Callable[..., str]) -> str:
    """A server that the tests of a file share; they leave to each other what they do there."""
    return serve(EXAMPLE_SET)


@pytest.fixture(scope="module")
def _shared_page(chromium: Any, address: str) -> Iterator[tuple[Any, list[str]]]:
    errors: list[str] = []
    page = rested(opened(chromium, errors, address, 1440, 900))
    yield page, errors
    page.close()


@pytest.fixture
def page(_shared_page: tuple[Any, list[str]], request: pytest.FixtureRequest) -> Iterator[Any]:
    """The page on that server that the tests of a file share, 1440 × 900: opening one takes 10 s."""
    page, errors = _shared_page
    request.node.pages = [page]
    tab(page, "Playback").click()
    yield page
    assert not errors, errors.clear()


@pytest.fixture
def shot() -> Callable[[Any, str], bytes]:
    """shot(page, name) -> a screenshot, kept where FLEXVIZ_SCREENSHOTS names a folder."""

    def take(page: Any, name: str) -> bytes:
        taken = picture(page)
        folder = os.environ.get("FLEXVIZ_SCREENSHOTS")
        if folder:
            Path(folder).mkdir(parents=True, exist_ok=True)
            (Path(folder) / f"{name}.png").write_bytes(taken)
        return taken

    return take
