"""The walk through the app whose pictures the documents show."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from benchmarks.app import served
from benchmarks.pictures.animation import animation
from tests.browser.page import CHROMIUM, FLAGS, button, close_notices, pause, play, row, status, tab, until

WINDOW: Any = {"width": 1280, "height": 800}  # [pixels]
SMALL = (960, 600)  # [pixels] of the animation
REPORT: Any = {"width": 940, "height": 862}  # [pixels]
LENGTH, RATE = 20.0, 5  # [s], [frames/s] of the animation
MOST = 3_000_000  # [bytes] of the animation
MOMENT = "4"  # [s] of the recording at which the pictures are taken
ASIDE = (620, 60)  # [pixels] no control is there, and no tooltip opens
PATIENCE = 300_000  # [ms] for anything on the page

POINTER = """() => {
    const pointer = document.createElement('div');
    pointer.id = 'fv-pointer';
    pointer.innerHTML = `<svg width="26" height="26" viewBox="0 0 20 20" style="display: block">
        <path d="M2 1v15l4-4 3 7 3-1-3-7h6z" fill="black" stroke="white" stroke-width="1.2"/></svg>`;
    pointer.style = 'position: fixed; z-index: 99999; pointer-events: none; left: 620px; top: 60px';
    document.body.append(pointer);
}"""
MOVE = """([x, y, pressed]) => {
    const style = document.getElementById('fv-pointer').style;
    style.left = x + 'px'; style.top = y + 'px';
    style.filter = pressed ? 'drop-shadow(0 0 5px #D55E00) drop-shadow(0 0 5px #D55E00)' : '';
}"""


class Film:
    """Screenshots of a page in which a drawn pointer clicks; nothing is kept if it is not `animated`."""

    def __init__(self, page: Any, animated: bool) -> None:
        self._page, self._animated = page, animated
        self._at: tuple[float, float] = ASIDE
        self.pictures: list[bytes] = []
        if animated:
            page.evaluate(POINTER)

    def hold(self, seconds: float) -> None:
        """What happens on the page by itself."""
        for _ in range(round(seconds * RATE) if self._animated else 0):
            self.pictures.append(self._page.screenshot())

    def wait(self, condition: Callable[[], Any], seconds: float, what: str) -> None:
        """Until the condition holds, shown in so many seconds however long it takes."""
        self._glide(*ASIDE)
        begin = len(self.pictures)

        def seen() -> Any:
            self.hold(1 / RATE)
            return condition()

        until(seen, what=what)
        taken = self.pictures[begin:]
        count = min(len(taken), round(seconds * RATE))
        self.pictures[begin:] = [taken[len(taken) * i // count] for i in range(count)]

    def click(self, control: Any) -> None:
        """Move the pointer to a control and press it."""
        control.scroll_into_view_if_needed()
        box = control.bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        self._glide(x, y)
        if self._animated:
            self._point(x, y, pressed=True)
        control.click()
        self._page.mouse.move(*ASIDE)
        if self._animated:
            self._page.evaluate(MOVE, [x, y, False])

    def end(self) -> None:
        """Hold the last picture until the animation is as long as it is to be."""
        missing = round(LENGTH * RATE) - len(self.pictures)
        assert missing >= 0, f"the walk takes {-missing / RATE:g} s more than {LENGTH:g} s"
        self.hold(missing / RATE)
        if self._animated:
            self._page.evaluate("document.getElementById('fv-pointer').remove()")

    def _glide(self, x: float, y: float) -> None:
        (left, top), self._at = self._at, (x, y)
        for part in (0.6, 1.0) if self._animated else ():
            self._point(left + part * (x - left), top + part * (y - top))

    def _point(self, x: float, y: float, pressed: bool = False) -> None:
        self._page.evaluate(MOVE, [x, y, pressed])
        self.hold(1 / RATE)


def pictures(animated: bool) -> Iterator[tuple[str, bytes]]:
    """Name and content of every picture."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright, served() as (_, address):
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        try:
            page = browser.new_page(viewport=WINDOW)
            page.set_default_timeout(PATIENCE)
            page.goto(address)
            page.wait_for_selector(".uplot .u-over")
            close_notices(page)
            film = Film(page, animated)
            until_the_evidence(page, film)
            yield "app.png", still(page)
            until_the_staircase(page, film)
            yield "app-compare.png", still(page)
            yield "report.png", first_page_of_the_report(page)
            if animated:
                blank = browser.new_page()
                yield "app.webp", animation(blank, film.pictures, SMALL, 1000 // RATE, MOST)
        finally:
            browser.close()


def until_the_evidence(page: Any, film: Film) -> None:
    """Data, identify, find what is missing."""
    film.hold(2.2)
    film.click(button(page, "Identify"))
    until(lambda: "Step Identify" in status(page), what="the step")
    film.click(tab(page, "Convergence"))
    film.click(button(page, "Run"))
    film.wait(lambda: "validation error" in status(page) and idle(page), 1.6, "a result")
    film.hold(1.4)
    film.click(button(page, "Diagnose"))
    until(lambda: "Step Diagnose" in status(page), what="the step")
    film.click(tab(page, "Signals"))
    film.click(button(page, "Find the missing effect"))
    verdict = page.locator(".fv-verdict")
    film.wait(lambda: verdict.count() and idle(page), 1.6, "a verdict")
    film.hold(2.6)


def until_the_staircase(page: Any, film: Film) -> None:
    """Add what was found, and see the error fall."""
    play(page)
    film.click(page.get_by_role("button", name="Add and refit").first)
    verdict = page.locator(".fv-verdict")
    film.wait(
        lambda: verdict.inner_text().startswith("Nothing is missing") and idle(page),
        1.6,
        "the second verdict",
    )
    film.click(tab(page, "Compare"))
    film.end()


def idle(page: Any) -> bool:
    return not button(page, "Stop").is_enabled()


def still(page: Any) -> bytes:
    """A screenshot with the robots at rest at `MOMENT` and no pointer."""
    pause(page)
    time = row(page, "Time [s]").get_by_role("textbox")
    time.fill(MOMENT)
    time.press("Enter")
    time.blur()
    page.mouse.move(*ASIDE)
    page.wait_for_timeout(2000)  # the robots, the trails and the plots come to rest
    pointer = "document.getElementById('fv-pointer')?.style.setProperty('display', '{}')"
    page.evaluate(pointer.format("none"))
    picture: bytes = page.screenshot()
    page.evaluate(pointer.format("block"))
    return picture


def first_page_of_the_report(page: Any) -> bytes:
    """The top of the report that the app sends."""
    button(page, "Data").click()
    with page.expect_download() as download, tempfile.TemporaryDirectory() as folder:
        button(page, "Report").click()
        file = Path(folder) / "report.html"
        download.value.save_as(file)
        report = page.context.browser.new_page(viewport=REPORT)
        report.goto(file.as_uri())
        picture: bytes = report.screenshot()
        report.close()
    return picture
