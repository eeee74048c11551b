"""Every part of viser's page that the app leans on is there, in the version that the app is pinned to."""

from __future__ import annotations

from typing import Any

import pytest

from flexviz.outlets.app import viser_private
from tests.browser.page import SOON, until

pytestmark = pytest.mark.browser

SELECTORS = (
    "DOCK", "CANVAS", "BACKGROUND", "SHADOW", "LEFT", "RIGHT", "TAB", "SCROLLED", "WINDOW", "PLOT",
    "NUMBER_BOX",
)  # fmt: skip


def test_elements_of_the_page(page: Any) -> None:
    def missing() -> list[str]:
        return [name for name in SELECTORS if not page.locator(getattr(viser_private, name)).count()]

    until(lambda: not missing(), SOON, "the page's elements")
    for handle in viser_private.DOCK_HANDLES:
        assert page.locator(handle).count()
    for panel in ("Legend", "Playback"):
        assert page.locator(viser_private.window(panel)).count() == 1
    # the canvas fills what has its colour, between the two docks
    for name in ("CANVAS", "BACKGROUND"):
        assert page.locator(f"{getattr(viser_private, name)} canvas").count()


def test_ids_of_controls(page: Any) -> None:
    button = page.get_by_role("button", name="Undo", exact=True)
    uuid = button.get_attribute("id")
    assert page.locator(viser_private.button(uuid)).count() == 1
    assert page.locator(viser_private.button_box(uuid)).count() == 1
    for name in ("Speed", "Error ×", "Dark theme"):
        uuid = page.locator("label").get_by_text(name, exact=True).first.get_attribute("for")
        row = page.locator(viser_private.control(uuid))
        assert row.count() == 1 and name in row.locator("> div:first-child").text_content()
        assert page.locator(viser_private.control_box(uuid)).locator(f'label[for="{uuid}"]').count() == 1


def test_colours(page: Any) -> None:
    colours = "() => ['text', 'dimmed', 'body'].map(one => getComputedStyle(document.body).getPropertyValue("
    colours += "`--fv-${one}`).trim())"
    light = page.evaluate(colours)
    assert light == ["#000", "#5b636b", "#fff"]
    page.evaluate("() => document.documentElement.dataset.mantineColorScheme = 'dark'")
    assert page.evaluate(colours)[1] == "#a6adb4"
    assert page.locator(viser_private.DARK).count() == 1


def test_what_the_scripts_use(page: Any) -> None:
    inside = "window.flexvizViser"
    until(lambda: page.evaluate(f"() => {inside}.charts().length"), SOON, "the charts")
    assert page.evaluate(f"() => {inside}.charts().every(one => one.over && one.series && one.data)")
    until(lambda: page.evaluate(f"() => Boolean({inside}.nodes()['/measured/joint1'])"), SOON, "the robot")
    found = page.evaluate(
        f"""() => {{
            const viser = {inside}, scene = viser.scene(), buttons = [...document.querySelectorAll('button')];
            const ray = viser.raycaster(viser.nodes()['/measured/joint1']);
            const named = one => one.textContent.trim() === 'Speed';
            const label = [...document.querySelectorAll('label')].find(named);
            return {{
                canvas: scene.canvas.tagName, camera: scene.camera.isCamera, draw: typeof scene.requestRender,
                ray: typeof ray.intersectObject, dock: viser.dock().querySelectorAll('canvas').length > 0,
                row: viser.control(label).contains(label), uploads: buttons.filter(viser.upload).length,
                plot: Boolean(viser.plot(document.querySelector('.u-over'))),
                panel: Boolean(viser.panel(document.querySelector('.u-over'))),
                strips: [...document.querySelectorAll(viser.strips)].map(one => one.textContent.trim()),
                windows: document.querySelectorAll(viser.windows).length,
            }};
        }}"""
    )
    assert found.pop("uploads") > 0 and found.pop("windows") == 2
    assert {"Signals", "Compare"} <= set(found.pop("strips"))
    assert found == {
        "canvas": "CANVAS", "camera": True, "draw": "function", "ray": "function", "dock": True, "row": True,
        "plot": True, "panel": True,
    }  # fmt: skip
