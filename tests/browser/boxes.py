"""Whether panels cover plots, tabs or each other, measured from the boxes on the page."""

from __future__ import annotations

from typing import Any, NamedTuple

# name -> what is looked for; what a scrolled or hidden part holds counts only where it is seen
BOXES = """() => {
    const kinds = {
        panel: '[data-floating-window]', plot: '.uplot', tab: '[data-dock-region] [role=tab]', bar: '#fv-bar',
        column: '[data-dock-region]', columns: '#fv-columns', view: '[data-dock-root] canvas[data-engine]',
    };
    const seen = element => {
        let {left, top, right, bottom} = element.getBoundingClientRect();
        for (let at = element.parentElement; at; at = at.parentElement) {
            if (getComputedStyle(at).overflow === 'visible' || at === document.body) continue;
            const box = at.getBoundingClientRect();
            left = Math.max(left, box.left); right = Math.min(right, box.right);
            top = Math.max(top, box.top); bottom = Math.min(bottom, box.bottom);
        }
        return {left: Math.max(left, 0), top: Math.max(top, 0), right: Math.min(right, innerWidth),
                bottom: Math.min(bottom, innerHeight)};
    };
    return Object.entries(kinds).flatMap(([kind, query]) => [...document.querySelectorAll(query)]
        .filter(one => one.checkVisibility({visibilityProperty: true}))
        .map(one => ({kind, ...seen(one), name: one.title || one.querySelector('.u-title')?.textContent
                      || one.querySelector('[role=tab]')?.title || one.dataset.dockRegion || one.id}))
        .filter(box => box.right - box.left > 1 && box.bottom - box.top > 1));
}"""
SLACK = 1.0  # [pixels] by which edges may touch
# what may not lie over what; the 3D view may be under the panels, and in narrow windows under a column
APART = {
    "panel": ("plot", "tab", "bar", "column", "columns", "panel"),
    "bar": ("plot", "tab", "column", "columns", "view"),
    "columns": ("plot", "tab", "column", "view"),
    "column": ("column",),
}


class PageBox(NamedTuple):
    """A part of the page as it is seen [pixels]."""

    kind: str
    name: str
    left: float
    top: float
    right: float
    bottom: float


def boxes(page: Any) -> list[PageBox]:
    """Panels, plots, tabs, columns, bar and 3D view that are seen."""
    return [PageBox(**box) for box in page.evaluate(BOXES)]


def overlaps(page: Any) -> list[str]:
    """Pairs that lie over one another and may not, each with the area [pixels²]."""
    seen, found = boxes(page), []
    for index, one in enumerate(seen):
        for other in seen[index + 1 :]:
            if other.kind not in APART.get(one.kind, ()) and one.kind not in APART.get(other.kind, ()):
                continue
            across = min(one.right, other.right) - max(one.left, other.left)
            down = min(one.bottom, other.bottom) - max(one.top, other.top)
            if across > SLACK and down > SLACK:
                pair = f"{one.kind} {one.name!r} over {other.kind} {other.name!r}"
                found.append(f"{pair}: {across:.0f} × {down:.0f}")
    return found


PROJECTED = """() => {
    const scene = window.__viserMutable, camera = scene.camera, box = scene.canvas.getBoundingClientRect();
    const at = name => {
        const node = scene.nodeRefFromName[name];
        if (!node) return null;
        const v = camera.position.clone().setFromMatrixPosition(node.matrixWorld).project(camera);
        return [(v.x + 1) / 2 * box.width, (1 - v.y) / 2 * box.height];
    };
    const covered = [...document.querySelectorAll('[data-floating-window]')]
        .filter(one => one.checkVisibility()).map(one => one.getBoundingClientRect())
        .map(b => [b.left - box.left, b.top - box.top, b.right - box.left, b.bottom - box.top]);
    const parts = Object.keys(scene.nodeRefFromName)
        .filter(name => /^\\/(measured|identified)\\/[^/]+$/.test(name));
    return {measured: at('/measured'), identified: at('/identified'), width: box.width, height: box.height,
            covered, parts: parts.map(at).filter(Boolean)};
}"""


def robots_in_view(page: Any, face_on: bool = True) -> list[str]:
    """What is wrong with the picture of the two robots, from where their bodies' origins are drawn.

    The measured one is on the left, `face_on` at the same height (of robots that are seen at an angle, one is
    nearer); all bodies are on the canvas and under no panel.
    """
    seen = page.evaluate(PROJECTED)
    left, right, wrong = seen["measured"], seen["identified"], []
    level = abs(left[1] - right[1]) <= 0.05 * seen["height"] or not face_on
    if left[0] >= right[0] or not level:
        wrong.append(f"measured at {left}, identified at {right}")
    for x, y in seen["parts"]:
        inside = 0 <= x <= seen["width"] and 0 <= y <= seen["height"]
        if not inside or any(a < x < c and b < y < d for a, b, c, d in seen["covered"]):
            wrong.append(f"a body at {x:.0f}, {y:.0f} of {seen['width']:.0f} × {seen['height']:.0f}")
    return wrong
