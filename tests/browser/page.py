"""How the tests start Chromium and find things on the page."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from flexviz.base.resources import sessions_dir
from flexviz.outlets.app import DEMO

FLAGS = [
    "--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
]  # fmt: skip
# Drawing without a graphics card is slow. The light of viser's surroundings is computed with 4 samples per
# pixel instead of 256 (9 s of processor time per page), and edges are not smoothed; a page that is there has
# 10 frames per second at most, in which its scene is drawn only for a picture (`picture`).
PLAIN_SCENE = """(() => {
    const kind = WebGL2RenderingContext.prototype, compile = kind.shaderSource;
    kind.shaderSource = function (shader, text) {
        compile.call(this, shader, text.replace(/#define GGX_SAMPLES \\d+/, '#define GGX_SAMPLES 4'));
    };
    const canvas = HTMLCanvasElement.prototype, context = canvas.getContext;
    canvas.getContext = function (kind, options) {
        return context.call(this, kind, kind.startsWith('webgl') ? {...options, antialias: false} : options);
    };
    const bind = kind.bindFramebuffer, onScreen = new WeakSet();
    kind.bindFramebuffer = function (target, buffer) {
        if (target !== this.READ_FRAMEBUFFER) buffer ? onScreen.delete(this) : onScreen.add(this);
        bind.call(this, target, buffer);
    };
    for (const name of ['Arrays', 'ArraysInstanced', 'Elements', 'ElementsInstanced', 'RangeElements']) {
        const draw = kind['draw' + name];
        kind['draw' + name] = function (...what) {
            if (window.sceneIsHidden && onScreen.has(this)) return;
            draw.apply(this, what);
            if (onScreen.has(this)) window.sceneIsDrawn = true;
        };
    }
})()"""
SPARE_FRAMES = """() => {
    const draw = window.requestAnimationFrame.bind(window), stop = window.cancelAnimationFrame.bind(window);
    const cancel = new Map();
    let last = 1e9;
    window.requestAnimationFrame = drawn => {
        const id = ++last;
        const now = time => { cancel.delete(id); drawn(time); };
        const later = () => { const frame = draw(now); cancel.set(id, () => stop(frame)); };
        const timer = setTimeout(later, 100);
        cancel.set(id, () => clearTimeout(timer));
        return id;
    };
    window.cancelAnimationFrame = id => { (cancel.get(id) ?? (() => stop(id)))(); cancel.delete(id); };
}"""
FRAMES = "() => new Promise(seen => requestAnimationFrame(() => requestAnimationFrame(seen)))"  # two of them
# the same places as install_chromium.sh; None: Playwright's own
NAMES = (os.environ.get("FLEXVIZ_CHROMIUM", ""), "chromium", "chromium-browser", "google-chrome")
CHROMIUM = next((path for name in NAMES if (path := shutil.which(name))), None)
EXAMPLE_SET = str(sessions_dir() / DEMO)  # opened as any set: without a model
SOON = 20.0  # [s] in which what was just asked for is on the page of a busy machine


def within(seconds: float, look: Callable[[], Any], good: Callable[[Any], bool] = bool) -> Any:
    """What `look` sees once it is good, or at the end of this time."""
    end = time.monotonic() + seconds
    while not good(seen := look()) and time.monotonic() < end:
        time.sleep(0.05)
    return seen


def until(condition: Callable[[], Any], timeout: float = 300.0, what: str = "it") -> Any:
    """Wait for a true value and return it."""
    value = within(timeout, condition)
    assert value, f"waited in vain for {what}"
    return value


def the_one(look: Callable[[], list[Any]], what: str) -> Any:
    """What `look` finds once it finds exactly one."""
    found = within(SOON, look, lambda found: len(found) == 1)
    assert len(found) == 1, f"{len(found)} {what}"
    return found[0]


def close_notices(page: Any) -> None:
    """Close what the app announces at its start."""
    # by the page itself: they also go on their own
    page.evaluate(
        "() => document.querySelectorAll('.mantine-Notification-closeButton').forEach(x => x.click())"
    )


def labels(page: Any, label: str) -> Any:
    """The visible labels with this text."""
    # of the exact text: places in the list change while the page is being drawn
    return page.locator("label").filter(has_text=re.compile(rf"^\s*{re.escape(label)}\s*$"), visible=True)


def row(page: Any, label: str) -> Any:
    """The row of the one control with this label."""
    found = labels(page, label)
    the_one(found.all, f"controls are called {label!r}")
    return found.locator("xpath=ancestor::div[contains(@class, 'mantine-Flex-root')][1]")


def button(page: Any, name: str) -> Any:
    """The one button with this text."""
    buttons = page.get_by_role("button", name=name, exact=True)
    the_one(buttons.all, f"buttons are called {name!r}")
    return buttons


def pause(page: Any, other: str = "Play") -> None:
    """Let the robots rest; the one button that plays and pauses is called by what it would do."""

    def named(name: str) -> int:
        return page.get_by_role("button", name=name, exact=True).count()

    until(lambda: named("Play") + named("Pause") == 1, SOON, "the one button that plays and pauses")
    if not named(other):
        press(page, "Pause" if other == "Play" else "Play", lambda: named(other))


def play(page: Any) -> None:
    """Let the robots play."""
    pause(page, other="Pause")


def press(page: Any, name: str, done: Callable[[], Any]) -> None:
    """Press this button until it has worked; a click into what still unfolds may miss."""
    for _ in range(3):
        button(page, name).click()
        if within(SOON, done):
            return
    raise AssertionError(f"the button {name!r} does nothing")


def tick(page: Any, label: str, on: bool = True) -> None:
    """Tick this box, or take the tick away; a click into what still unfolds may miss."""
    box = row(page, label).get_by_role("checkbox")
    assert box.is_checked() != on
    for _ in range(3):
        box.click()
        if within(SOON / 4, box.is_checked, lambda now: now == on) == on:
            return
    raise AssertionError(f"the box {label!r} cannot be changed")


def choose(page: Any, label: str, option: str) -> None:
    """Choose from this list until it is chosen; a list that is drawn anew closes."""
    chosen = row(page, label).get_by_role("combobox")
    for _ in range(3):
        chosen.click()
        found = page.get_by_role("option", name=option, exact=True)
        if within(SOON, found.count):
            with contextlib.suppress(Exception):  # it has closed
                found.click(timeout=5000)
        if within(SOON, lambda: chosen.input_value() == option):
            return
    raise AssertionError(f"{option!r} cannot be chosen from {label!r}")


def unfold(page: Any, heading: str, what: Any) -> None:
    """Unfold the folder with this heading, in which `what` stands."""
    if what.count():
        return
    folder = page.get_by_text(heading, exact=True)

    def rests() -> bool:
        before = folder.bounding_box()
        page.wait_for_timeout(200)
        return folder.bounding_box() == before

    for _ in range(3):
        within(SOON, rests)
        folder.click()
        if within(SOON, what.count):
            return
    raise AssertionError(f"the folder {heading!r} does not unfold")


def tab(page: Any, name: str) -> Any:
    """The one tab with this name."""
    return page.get_by_role("tab", name=name, exact=True)


def pin(page: Any) -> None:
    """Let the tab of the plots stay, whatever is done."""
    found = page.get_by_role("button", name="Pin the tab")
    if found.get_attribute("aria-pressed") != "true":
        found.click()


def dark(page: Any, on: bool = True, back_to: str = "Data") -> None:
    """Turn the open page to the dark theme, or back to the light one; then to this step."""
    press(page, "Data", lambda: labels(page, "Dark theme").count() == 1)
    tick(page, "Dark theme", on)
    wanted = "dark" if on else "light"
    scheme = "document.documentElement.dataset.mantineColorScheme"
    until(lambda: page.evaluate(scheme) == wanted, SOON, f"the {wanted} theme")
    if back_to != "Data":
        press(page, back_to, lambda: labels(page, "Dark theme").count() == 0)


def charts(page: Any) -> dict[str, list[list[float]]]:
    """Title -> data of every chart on the page."""
    return page.evaluate(
        """() => Object.fromEntries(Object.values(window.__viserTestpoints?.uplots ?? {}).map(u => [
            u.chart.root.querySelector('.u-title')?.textContent, u.chart.data.map(d => Array.from(d))]))"""
    )


def chart(page: Any, start: str) -> list[list[float]]:
    """Data of the chart whose title begins with `start`."""
    return the_one(
        lambda: [data for title, data in charts(page).items() if title.startswith(start)],
        f"charts begin with {start!r}",
    )


def node(page: Any, name: str) -> list[float] | None:
    """World matrix of a scene node (16 numbers, column by column), or None where there is none."""
    return page.evaluate(
        "name => window.__viserMutable?.nodeRefFromName?.[name]?.matrixWorld?.elements?.slice() ?? null", name
    )


def place(page: Any, name: str) -> list[float]:
    """Where a scene node stands (x, y, z)."""
    return (node(page, name) or [])[12:15]


def picture(page: Any, box: dict[str, float] | None = None) -> bytes:
    """A screenshot of the page, or of a box of it; its scene is drawn for that."""
    page.evaluate("window.sceneIsHidden = false; if (window.sceneIsDrawn) window.sceneIsDrawn = false")
    within(SOON, lambda: page.evaluate("window.sceneIsDrawn !== false"))  # all of a frame at once
    page.evaluate(FRAMES)
    taken: bytes = page.screenshot(clip=box) if box else page.screenshot()
    page.evaluate("window.sceneIsHidden = true")
    return taken


def pixels(page: Any, box: dict[str, float] | None = None) -> np.ndarray:
    """RGB of what is on the page, or in a box of it, (rows, columns, 3)."""
    image = pytest.importorskip("PIL.Image").open(io.BytesIO(picture(page, box)))
    return np.asarray(image.convert("RGB")).astype(int)


def ghost(page: Any) -> list[tuple[int, int]]:
    """Where the identified robot is seen: it is orange (x, y)."""
    seen = pixels(page)
    orange = (seen[..., 0] - seen[..., 2] > 60) & (seen[..., 0] > 150)
    orange[:, :345] = orange[:, -440:] = orange[:260] = orange[560:] = False
    rows, columns = np.nonzero(orange)
    assert len(rows) > 200, "no ghost is seen"
    return list(zip(columns.tolist(), rows.tolist(), strict=True))


TEXTS = ".fv, .fv-table, .uplot, button, label, input:not([type=checkbox])"
WIDER = f"""() => [...document.querySelectorAll('{TEXTS}')]
    .filter(e => e.offsetParent && e.checkVisibility({{visibilityProperty: true}}))
    .filter(e => getComputedStyle(e).display !== 'inline' && !e.closest('.fv-clip'))
    .filter(e => e.scrollWidth > e.clientWidth + 2)
    .map(e => e.className + ': ' + e.textContent.slice(0, 60))"""


def wider_than_its_place(page: Any) -> list[str]:
    """What is cut off at its side."""
    return page.evaluate(WIDER)


OVERLAPPING = """() => {
    const seen = [...document.querySelectorAll('.fv, .uplot, button, label, input, [role=tab]')]
        .filter(e => e.offsetParent && e.checkVisibility({visibilityProperty: true}))
        .filter(e => !e.closest('.mantine-Notification-root, .fv-png'))  // lie over plots
        .filter(e => e.tagName !== 'BUTTON' || !e.closest('.mantine-Input-wrapper'))
        .map(e => {
            const r = e.getBoundingClientRect(), box = e.closest('.mantine-ScrollArea-viewport');
            const b = box ? box.getBoundingClientRect() : r;  // what is scrolled away overlaps nothing
            return [e, {left: r.left, right: r.right, top: Math.max(r.top, b.top),
                        bottom: Math.min(r.bottom, b.bottom)}];
        }).filter(([e, r]) => r.right - r.left > 1 && r.bottom - r.top > 1);
    const found = [];
    seen.forEach(([a, r], i) => seen.slice(i + 1).forEach(([b, s]) => {
        if (a.contains(b) || b.contains(a)) return;
        const across = Math.min(r.right, s.right) - Math.max(r.left, s.left);
        const down = Math.min(r.bottom, s.bottom) - Math.max(r.top, s.top);
        if (across > 2 && down > 2)
            found.push([a, b].map(e => e.textContent.slice(0, 40) || e.outerHTML.slice(0, 80)).join(' | '));
    }));
    return found;
}"""

MIDDLES = """found => found.map(e => {
    const r = e.getBoundingClientRect();
    return [(r.left + r.right) / 2, (r.top + r.bottom) / 2];
})"""


def overlapping(page: Any) -> list[str]:
    """Pairs of controls or texts that lie over one another."""
    return page.evaluate(OVERLAPPING)


def well_laid_out(page: Any) -> None:
    """Nothing is cut off, nothing overlaps, as soon as what moves into its place has come to rest."""
    wrong = within(SOON, lambda: wider_than_its_place(page) + overlapping(page), lambda wrong: not wrong)
    assert not wrong, wrong


def leave_the_plots(page: Any) -> None:
    """Move the pointer off the plots: viser's own button lies over the one under it.

    A plot that came to lie under a resting pointer keeps its button until the pointer has moved over it.
    """
    over = page.locator(".uplot-container > .mantine-ActionIcon-root")

    def left() -> bool:
        # a button may go while it is looked at: where it was is all that is needed
        for x, y in over.evaluate_all(MIDDLES):
            page.mouse.move(x, y)
        page.mouse.move(660, 60)
        return over.count() == 0

    until(left, timeout=30.0, what="plots without buttons")


def status(page: Any) -> str:
    """The status line."""
    return page.locator(".fv-status").inner_text()


def error(page: Any) -> float:
    """The error in the status line [% of the torque]; NaN while it says none."""
    found = re.search(r"(?:validation|fit) error ([\d.]+) % of the torque", status(page))
    return float(found[1]) if found else float("nan")
