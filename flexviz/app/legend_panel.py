"""The legend of the scene, in a corner of the canvas."""

from __future__ import annotations

from flexviz.app.page import Page
from flexviz.app.state import Changed, Turn
from flexviz.app.store import Store
from flexviz.view import joints_html, legend_html, model_name

WIDTH = 300  # [pixels]


def model_names(store: Store) -> tuple[str, ...]:
    """What the models on the screen are called; of several each has its number and error."""
    if store.beside is None:
        return ("identified",)
    models = [step for step, _ in store.chain]
    numbers = (len(store.analysis.model_steps) - 1, store.view.beside or 0)
    joints, spread = store.measurements.joints, store.measurements.torque_spread
    return tuple(model_name(models, joints, number, spread) for number in numbers)


class LegendPanel:
    """Colours of robots and links; error, torque and deflection of every joint, while they play."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store = store
        panel = page.gui.add_panel()
        with panel.add_tab("Legend"):
            self._robots = page.gui.add_html("")
            self._joints = page.gui.add_html("")
        panel.float(x=12, y=12, width=WIDTH)
        results = Changed.RESULT | Changed.DERIVED | Changed.DIAGNOSIS
        shown = Changed.OPENED | Changed.JOINT | Changed.GROUP | Changed.VIEW | results
        store.subscribe(shown, self._draw, Turn.CONTROLS)
        store.subscribe(Changed.TICK, self._draw_joints, Turn.CONTROLS)

    def _draw(self) -> None:
        store, motion = self._store, self._store.motion
        found = store.link_colours(store.errors)
        names = model_names(store)
        self._robots.content = legend_html(found, store.group.name, names, store.view.arcs)
        self._drawn = (store.measurements.joints, found, motion), store.joint
        self._at = -1.0
        self._draw_joints()

    def _draw_joints(self) -> None:
        """Draw the table, if the instant has changed."""
        now = round(self._store.clock.time, 2)
        if now != self._at:
            self._at, (drawn, joint) = now, self._drawn
            self._joints.content = joints_html(*drawn, now, joint)
