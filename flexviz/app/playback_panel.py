"""The floating panel under the robots: playback, layout, exaggeration, legend."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from flexviz.app.page import Page, off
from flexviz.app.playback import SPEEDS
from flexviz.app.plot_clicks import HTML as PLOT_CLICKS
from flexviz.app.plot_clicks import TIME_LABEL
from flexviz.app.state import Changed, Turn
from flexviz.app.store import Store
from flexviz.app.style import half, no_label
from flexviz.scene import LAYOUTS, VIEWS
from flexviz.view import legend_html

PLAY, PAUSE, BACK, FORWARD = BUTTONS = ("Play", "Pause", "◀ Step", "Step ▶")
FRAME = 1.0 / 30.0  # [s] one press of a step button at speed 1
SCRUB_REST = 0.8  # [s] without automatic updates after the user has moved the time slider
SIDES = ("motor side θ", "link side q")
SPEED_NAMES = tuple(f"{speed:g}×" for speed in SPEEDS)


class PlaybackPanel:
    """Play, step, scrub, speed; deflection and error factors; layout."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store, self._clock = store, store.clock
        gui = page.gui
        self._scrubbed = 0.0
        panel = gui.add_panel()
        with panel.add_tab("Playback"):
            buttons = page.choose(gui.add_button_group("", BUTTONS), self._press)
            self._time = page.watch(gui.add_slider(TIME_LABEL, 0.0, 1.0, 0.01, 0.0), self._scrub)
            speed = page.dropdown("Speed", SPEED_NAMES, self._set_speed, initial_value="1×")
            self._layout = page.dropdown("Layout", LAYOUTS, self._set("layout"))
            hint = "0 shows the motor side θ, 1 the link side q, larger values exaggerate θ − q"
            deflection = gui.add_slider("Deflection ×", 0, 500, 1, 1, hint=hint)
            self._deflection = page.watch(deflection, self._set("deflection"))
            hint = "exaggerates simulated − measured motor angle of the identified robot"
            page.watch(gui.add_slider("Error ×", 1, 500, 1, 1, hint=hint), self._set("error"))
            self._legend = gui.add_html("")
            gui.add_html(PLOT_CLICKS)
        with panel.add_tab("View"):
            self._side = page.dropdown("Side", SIDES, lambda side: self._change(link_side=side == SIDES[1]))
            page.choose(gui.add_button_group("Camera", VIEWS), self._aim)
            hint = "turn with the measured torque; a full turn is its largest value"
            page.checkbox("Torque arrows", False, self._set("torque"), hint=hint)
            page.checkbox("Loop", True, self._loop, hint="starts again at the group's end")
        panel.float(x=12, y=-12, width=488)
        page.style(no_label, buttons)
        for handle in (speed, self._layout):
            page.style(half, handle)
        page.command("Play or pause", self._toggle, "space", shared=True)
        page.command("Step back", lambda: self._press(BACK), "arrowleft", shared=True)
        page.command("Step forward", lambda: self._press(FORWARD), "arrowright", shared=True)
        page.command("Change the layout of the robots", self._other_layout)
        for view in VIEWS:
            page.command(f"Camera: {view.lower()}", lambda view=view: self._aim(view))
        store.subscribe(Changed.OPENED | Changed.GROUP, self._span, Turn.CONTROLS)
        shown = (
            Changed.OPENED
            | Changed.JOINT
            | Changed.GROUP
            | Changed.RESULT
            | Changed.DERIVED
            | Changed.DIAGNOSIS
        )
        store.subscribe(shown | Changed.VIEW, self._refresh, Turn.CONTROLS)
        store.subscribe(Changed.TICK, self._tick, Turn.CONTROLS)

    def _set(self, name: str) -> Callable[[Any], None]:
        """An action that changes one field of the view settings."""
        return lambda value: self._change(**{name: value})

    def _change(self, **fields: Any) -> None:
        self._store.set_view(replace(self._store.view, **fields))

    def _aim(self, view: str) -> None:
        """Point the cameras from this side, also if they were moved since."""
        self._change(camera=(view, self._store.view.camera[1] + 1))

    def _span(self) -> None:
        segments = self._store.group.segments
        self._time.min, self._time.max = float(segments[0].time[0]), float(segments[-1].time[-1])
        self._time.value = self._time.min

    def _refresh(self) -> None:
        store, motion, view = self._store, self._store.motion, self._store.view
        self._layout.value = view.layout
        if view.deflection is None:  # else the user may be moving the slider
            self._deflection.value = store.deflection
        why = "" if motion.link is not None else "the selected group has no link encoders"
        off(self._side, why, "compares motor angles, or link sides as the encoders measured them")
        if why and view.link_side:
            self._side.value = SIDES[0]
            self._change(link_side=False)
        self._legend.content = legend_html(
            store.measurements.joints, store.link_colours, store.group.name, motion.model_note, store.joint
        )

    def _tick(self) -> None:
        """Let the time slider follow the clock, unless the user holds it."""
        if self._clock.playing:
            self._follow()

    def _follow(self) -> None:
        if time.monotonic() - self._scrubbed > SCRUB_REST:
            self._time.value = round(self._clock.time, 2)

    def _press(self, button: str) -> None:
        if button == PLAY:
            self._clock.play()
        elif button == PAUSE:
            self._clock.pause()
        else:
            self._clock.step(FRAME if button == FORWARD else -FRAME)
        self._follow()

    def _set_speed(self, name: str) -> None:
        self._clock.set_speed(SPEEDS[SPEED_NAMES.index(name)])

    def _toggle(self) -> None:
        self._press(PAUSE if self._clock.playing else PLAY)

    def _scrub(self, value: float) -> None:
        self._scrubbed = time.monotonic()
        self._clock.seek(value)

    def _loop(self, on: bool) -> None:
        now = self._clock.time
        self._clock.loop = on
        self._clock.seek(now)

    def _other_layout(self) -> None:
        self._change(layout=LAYOUTS[1 - LAYOUTS.index(self._store.view.layout)])
