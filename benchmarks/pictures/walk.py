"""The walk through the app whose pictures the documents show."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.app import served
from benchmarks.pictures.animation import Shot, animation
from tests.browser.page import CHROMIUM, FLAGS, button, close_notices, pause, play, row, tab, until

WINDOW: Any = {"width": 1280, "height": 800}  # [pixels]
SMALL = (960, 600)  # [pixels] of the animation
REPORT: Any = {"width": 940, "height": 862}  # [pixels]
LENGTH, RATE = 15.0, 5  # [s], [frames/s] of the animation
FALL, FALL_RATE = 1.0, 12.5  # [s], [frames/s] of the fall in it
SLOWLY = "document.documentElement.style.setProperty('--fv-fall', '20s')"  # a screenshot takes its time
FALLING = "window.flexvizFall.running"
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
        self.shots: list[Shot] = []
        if animated:
            page.evaluate(POINTER)

    def hold(self, seconds: float) -> None:
        """What happens on the page by itself."""
        for _ in range(round(seconds * RATE) if self._animated else 0):
            self._take()

    def _take(self) -> None:
        self.shots.append(Shot(self._page.screenshot(), 1000 // RATE))

    def wait(self, condition: Callable[[], Any], seconds: float, what: str) -> None:
        """Until the condition holds, shown in so many seconds however long it takes."""
        self._glide(*ASIDE)
        begin = len(self.shots)

        def seen() -> Any:
            self.hold(1 / RATE)
            return condition()

        until(seen, what=what)
        self._thin(begin, seconds, RATE)

    def fall(self) -> None:
        """The fall that has begun, from screenshots of it at a much slower pace."""
        begin = len(self.shots)
        while self._page.evaluate(FALLING):
            if self._animated:
                self._take()
        self._thin(begin, FALL, FALL_RATE)

    def _thin(self, begin: int, seconds: float, rate: float) -> None:
        """Leave so many of the pictures from number `begin` on that they take `seconds`."""
        taken = self.shots[begin:]
        count = min(len(taken), round(seconds * rate))
        chosen = [taken[len(taken) * i // count] for i in range(count)]
        self.shots[begin:] = [replace(shot, duration=round(1000 / rate)) for shot in chosen]

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
        missing = round(1000 * LENGTH) - sum(shot.duration for shot in self.shots)
        assert missing >= 0, f"the walk takes {-missing / 1000:g} s more than {LENGTH:g} s"
        self.hold(missing / 1000)
        if self._animated:  # to the millisecond
            rest = round(1000 * LENGTH) - sum(shot.duration for shot in self.shots)
            self.shots[-1] = replace(self.shots[-1], duration=self.shots[-1].duration + rest)
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
                yield "app.webp", animation(blank, film.shots, SMALL, MOST)
        finally:
            browser.close()


def until_the_evidence(page: Any, film: Film) -> None:
    """The first screen; find what is missing."""
    page.wait_for_selector(".fv-wrong")
    film.hold(3.0)
    film.click(button(page, "Find the missing effect"))
    verdict = page.locator(".fv-verdict")
    film.wait(lambda: verdict.count() and idle(page), 1.6, "a verdict")
    film.hold(2.8)


def until_the_staircase(page: Any, film: Film) -> None:
    """Add what was found, and see the error fall; the robots rest meanwhile."""
    page.evaluate(SLOWLY)
    film.click(page.get_by_role("button", name="Add and refit").first)
    film.click(tab(page, "Compare"))
    film.wait(lambda: page.evaluate(FALLING), 1.0, "the fall")
    film.fall()
    until(lambda: page.locator(".fv-verdict").inner_text().startswith("Nothing is missing") and idle(page))
    play(page)
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
