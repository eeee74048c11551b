"""`python -m benchmarks.waiting SET`: what one waits for on the page, in Chromium.

From *Find the missing effect* to the first residual on the page; then, while the newest model's motion is
simulated in the background, how long *Save session* and *Report* take.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import psutil

from benchmarks.app import served
from benchmarks.command import command
from tests.browser.conftest import opened
from tests.browser.page import CHROMIUM, FLAGS, button, status, until

FIRST, SAVE, REPORT = 8.0, 2.0, 15.0  # [s] at most
SEARCH = 1500.0  # [s] of patience with the diagnosis


def told(name: str, seconds: float, most: float) -> None:
    print(f"{name:16s} {seconds:6.2f} s   <= {most:g} s   ratio {seconds / most:.2f}", flush=True)


def busy(server: int, seconds: float = 2.0) -> float:
    """Cores that the server and its children use."""
    family = [psutil.Process(server), *psutil.Process(server).children(recursive=True)]

    def used() -> float:
        return sum(sum(one.cpu_times()[:2]) for one in family)

    before = used()
    time.sleep(seconds)
    return (used() - before) / seconds


def measure(page: Any, server: int) -> None:
    """Press, and measure until what was asked for is there."""
    button(page, "Diagnose").click()
    find = page.get_by_role("button", name="Find the missing effect")
    until(lambda: find.is_visible() and find.is_enabled(), what="the button")
    begin = time.monotonic()
    find.click()
    residual = page.locator(".uplot", has_text="Residual").filter(visible=True)
    until(lambda: page.locator(".fv-so-far").count() and residual.count(), SEARCH, "a residual")
    told("first residual", time.monotonic() - begin, FIRST)
    until(
        lambda: page.locator(".fv-verdict").count() and not button(page, "Stop").is_enabled(), SEARCH, "end"
    )
    print(f"{'search':16s} {time.monotonic() - begin:6.1f} s   {status(page)[:90]}", flush=True)
    print(f"{'replay':16s} {busy(server):6.2f} cores busy", flush=True)
    button(page, "Data").click()
    save = button(page, "Save session")
    until(save.is_visible, what="Save session")
    for text, most in (("Save session", SAVE), ("Report", REPORT)):
        begin = time.monotonic()
        if text == "Report":
            with page.expect_download(timeout=1e6):
                button(page, text).click()
        else:
            button(page, text).click()
            until(lambda: "session saved in" in status(page), what="the saved session")
        told(text, time.monotonic() - begin, most)
    print(f"{'replay':16s} {busy(server):6.2f} cores busy")


@command
def main(set: Path) -> None:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright, served(str(set.resolve())) as (process, address):
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = opened(browser, [], address)
        measure(page, process.pid)
        browser.close()


if __name__ == "__main__":
    sys.exit(main())
