"""`python -m benchmarks.screens --work DIR [--set FOLDER …]`: the app at all sizes, looked at and measured.

Takes pictures of the bundled set, and of every given one, at the sizes of usual screens and at 150 % zoom,
light and dark, with every column of narrow pages; prints, for each, what lies over a plot or a tab and what
is wrong with the picture of the robots. Ends with 1 if anything is.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from benchmarks.app import served
from tests.browser.boxes import overlaps, robots_in_view
from tests.browser.page import CHROMIUM, FLAGS, close_notices, within

SIZES = ((1024, 768), (1280, 800), (1440, 900), (1920, 1080))  # [pixels]
ZOOMED = 1.5
WINDOWS = {  # name -> CSS pixels; zoomed, a page has fewer of them
    **{f"{width}x{height}": (width, height) for width, height in SIZES},
    **{f"{w}x{h}-zoomed": (round(w / ZOOMED), round(h / ZOOMED)) for w, h in SIZES},
}
PATIENCE = 20.0  # [s] for what moves to come to rest


def pictures(browser: Any, address: str, name: str, work: Path, dark: bool) -> list[str]:
    """Take the pictures of one set in one theme; returns what is wrong."""
    wrong = []
    for window, (width, height) in WINDOWS.items():
        scale = ZOOMED if window.endswith("zoomed") else 1.0
        page = browser.new_page(viewport={"width": width, "height": height}, device_scale_factor=scale)
        page.set_default_timeout(300_000)
        page.goto(address + ("/?darkMode" if dark else ""))
        page.wait_for_selector(".uplot .u-over", state="attached")
        page.wait_for_selector("#fv-bar", state="attached")
        tabs = [one for one in page.locator("#fv-columns button").all() if one.is_visible()]
        for tab in tabs or [None]:
            if tab is not None:
                tab.click()
            column = "" if tab is None else f"-{tab.inner_text().lower()}"
            page.mouse.move(width / 2, 4)
            close_notices(page)
            steps = column == "-steps"
            found = within(
                PATIENCE,
                lambda page=page, steps=steps: overlaps(page) + ([] if steps else robots_in_view(page)),
                lambda found: not found,
            )
            page.wait_for_timeout(1500)  # the picture is drawn
            file = f"{name}-{window}{column}-{'dark' if dark else 'light'}.png"
            page.screenshot(path=work / file)
            print(f"{file:58s} {'; '.join(found) or 'nothing covered'}", flush=True)
            wrong += found
        page.close()
    return wrong


def main(words: list[str] | None = None) -> int:
    commands = argparse.ArgumentParser(prog="python -m benchmarks.screens", description=__doc__)
    commands.add_argument("--work", type=Path, required=True, help="the folder for the pictures")
    commands.add_argument(
        "--set", type=Path, action="append", default=[], help="a set beside the bundled one"
    )
    chosen = commands.parse_args(words)
    chosen.work.mkdir(parents=True, exist_ok=True)
    from playwright.sync_api import sync_playwright

    wrong: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        for folder in (None, *chosen.set):
            with served(*([] if folder is None else [str(folder.resolve())])) as (_, address):
                for dark in (False, True):
                    name = "bundled" if folder is None else folder.name
                    wrong += pictures(browser, address, name, chosen.work, dark)
        browser.close()
    print(f"{len(wrong)} overlaps or robots out of view")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
