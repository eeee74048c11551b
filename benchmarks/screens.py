"""`python -m benchmarks.screens --work DIR [--set FOLDER …]`: the app at all sizes, looked at and measured.

Takes pictures of the bundled set, and of every given one, at the sizes of usual screens and at 150 % zoom,
light and dark, with every column of narrow pages; prints, for each, what lies over a plot or a tab and what
is wrong with the picture of the robots. Ends with 1 if anything is.
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from benchmarks.app import served
from benchmarks.command import command
from tests.browser.boxes import overlaps, robots_in_view
from tests.browser.page import (
    CHROMIUM,
    FLAGS,
    PLAIN_SCENE,
    SOON,
    SPARE_FRAMES,
    close_notices,
    picture,
    within,
)

SIZES = ((1024, 768), (1280, 800), (1440, 900), (1920, 1080))  # [pixels]
ZOOMED = 1.5
WINDOWS = {  # name -> CSS pixels; zoomed, a page has fewer of them
    **{f"{width}x{height}": (width, height) for width, height in SIZES},
    **{f"{w}x{h}-zoomed": (round(w / ZOOMED), round(h / ZOOMED)) for w, h in SIZES},
}
PATIENCE = 300_000  # [ms] for anything on the page


def pictures(browser: Any, address: str, name: str, work: Path, dark: bool) -> list[str]:
    """Take the pictures of one set in one theme; returns what is wrong."""
    wrong = []
    for zoomed in (False, True):
        page = browser.new_page(device_scale_factor=ZOOMED if zoomed else 1.0)
        page.set_default_timeout(PATIENCE)
        page.add_init_script(PLAIN_SCENE)
        for number, (window, (width, height)) in enumerate(WINDOWS.items()):
            if window.endswith("zoomed") != zoomed:
                continue
            page.set_viewport_size({"width": width, "height": height})
            if number % len(SIZES) == 0:  # opened at the smallest size, then resized
                page.goto(address + ("/?darkMode" if dark else ""))
                page.wait_for_selector(".uplot .u-over", state="attached")
                page.wait_for_selector("#fv-bar", state="attached")
                page.evaluate(SPARE_FRAMES)
                page.evaluate("window.sceneIsHidden = true")
            page.wait_for_timeout(500)
            tabs = [one for one in page.locator("#fv-columns button").all() if one.is_visible()]
            for tab in tabs or [None]:
                if tab is not None:
                    tab.click()
                column = "" if tab is None else f"-{tab.inner_text().lower()}"
                page.mouse.move(width / 2, 4)
                close_notices(page)
                look = partial(wrong_on, page, column != "-steps")
                found = within(SOON, look, lambda found: not found)
                page.wait_for_timeout(500)  # the plots are drawn
                file = f"{name}-{window}{column}-{'dark' if dark else 'light'}.png"
                (work / file).write_bytes(picture(page))
                print(f"{file:58s} {'; '.join(found) or 'nothing covered'}", flush=True)
                wrong += found
        page.close()
    return wrong


def wrong_on(page: Any, robots: bool) -> list[str]:
    """What lies over a plot or a tab, and, where they are shown, what is wrong with the robots."""
    return overlaps(page) + (robots_in_view(page) if robots else [])


@command
def main(
    *,
    work: Annotated[Path, "the folder for the pictures"],
    set: Annotated[list[Path], "a set besides the bundled one"] = [],  # noqa: B006
) -> int:
    work.mkdir(parents=True, exist_ok=True)
    from playwright.sync_api import sync_playwright

    wrong: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        for folder in (None, *set):
            with served(*([] if folder is None else [str(folder.resolve())])) as (_, address):
                for dark in (False, True):
                    name = "bundled" if folder is None else folder.name
                    wrong += pictures(browser, address, name, work, dark)
        browser.close()
    print(f"{len(wrong)} overlaps or robots out of view")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
