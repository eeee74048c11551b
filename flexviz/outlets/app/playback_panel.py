"""The floating panel under the robots: playback, layout, exaggeration; and what the page's own bar asks for.

On a narrow page a bar takes the place of the panel (`layout.js`): it draws what `state_html` tells and writes
into a hidden text what is pressed on it.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from flexviz.base.errors import InputError
from flexviz.base.schemas import shown
from flexviz.content.scene import LAYOUTS, VIEWS
from flexviz.content.wording import escape
from flexviz.outlets.app.explained import ExplainedHtml
from flexviz.outlets.app.page import Page, dim, off, put
from flexviz.outlets.app.page_script import TRANSPORT_LABEL, page_script
from flexviz.outlets.app.playback import SPEEDS
from flexviz.outlets.app.state import Changed, Turn
from flexviz.outlets.app.store import Store
from flexviz.outlets.app.style import half, hidden, no_label

PLAY, PAUSE, BACK, FORWARD = "Play", "Pause", "◀ Step", "Step ▶"
FRAME = 1.0 / 30.0  # [s] one press of a step button at speed 1
SCRUB_REST = 0.8  # [s] without automatic updates after the user has moved the time slider
SIDES = ("motor side θ", "link side q")
NUMBER = re.compile(r"(?<!\d)-?\d+\.?\d*")
MAX_TYPED = 40  # characters of a span
DEFLECTION = (
    "0 shows the motor side θ, 1 the link side q, larger values exaggerate θ − q; only of joints whose "
    "stiffness the data determine"
)
SPEED_NAMES = tuple(f"{speed:g}×" for speed in SPEEDS)
COMMAND = re.compile(r"\S+ (toggle|back|forward|seek|span) ?(.*)", re.DOTALL)  # after an own number


def state_html(playing: bool, time: float, span: tuple[float, float]) -> str:
    """What the bar on a narrow page shows: whether it plays, the instant and the span [s]."""
    ends = f'data-first="{span[0]:.2f}" data-last="{span[1]:.2f}"'
    return f'<i id="fv-clock" data-playing="{int(playing)}" data-time="{time:.2f}" {ends} hidden></i>'


class PlaybackPanel:
    """Play, step, scrub, speed; deflection and error factors; layout."""

    def __init__(self, store: Store, page: Page) -> None:
        self._store, self._clock = store, store.clock
        gui = page.gui
        self._scrubbed, self._typed = 0.0, ""
        panel = gui.add_panel()
        with panel.add_tab("Playback"):
            self._buttons = page.choose(gui.add_button_group("", (PLAY, BACK, FORWARD)), self._press)
            self._time = page.watch(gui.add_slider("Time [s]", 0.0, 1.0, 0.01, 0.0), self._scrub)
            speed = page.dropdown("Speed", SPEED_NAMES, self._set_speed, initial_value="1×")
            hint = "what is played and drawn; drag across a plot to choose it, double click for all of it"
            self._span = page.watch(gui.add_text("Span [s]", "", hint=hint), self._set_span)
            deflection = gui.add_slider("Deflection ×", 0, 500, 1, 1, hint=DEFLECTION)
            self._deflection = page.watch(deflection, self._set("deflection"))
            hint = "exaggerates simulated − measured motor angle of the identified robot"
            page.watch(gui.add_slider("Error ×", 1, 500, 1, 1, hint=hint), self._set("error"))
        with panel.add_tab("View"):
            self._layout = page.dropdown("Layout", LAYOUTS, self._set("layout"))
            self._side = page.dropdown("Side", SIDES, lambda side: self._change(link_side=side == SIDES[1]))
            page.choose(gui.add_button_group("Camera", VIEWS), self._aim)
            hint = "torque and deflection around the joint axes; the legend says what half a turn means"
            arcs = page.checkbox("Arcs", True, self._set("arcs"), hint=hint)
            hint = "on the floor; without them a machine without graphics hardware draws faster"
            shadows = page.checkbox("Shadows", True, self._set("shadows"), hint=hint)
            loop = page.checkbox("Loop", True, self._loop, hint="starts again at the end of the span")
            self._note = ExplainedHtml(gui)
        panel.float(x=12, y=-12, width=488)
        page.style(hidden, page.client_text(TRANSPORT_LABEL, self._command, each=True))
        self._state = gui.add_html("")
        gui.add_html(page_script())
        page.style(no_label, self._buttons)
        for handle in (speed, self._span, self._layout, self._side, arcs, shadows, loop):
            page.style(half, handle)
        page.command("Play or pause", self._toggle, "space", shared=True)
        page.command("Step back", lambda: self._press(BACK), "arrowleft", shared=True)
        page.command("Step forward", lambda: self._press(FORWARD), "arrowright", shared=True)
        page.command("Change the layout of the robots", self._other_layout)
        for view in VIEWS:
            page.command(f"Camera: {view.lower()}", lambda view=view: self._aim(view))
        store.subscribe(Changed.OPENED | Changed.GROUP | Changed.SPAN, self._show_span, Turn.CONTROLS)
        shown = Changed.OPENED | Changed.GROUP | Changed.RESULT | Changed.DERIVED | Changed.VIEW
        store.subscribe(shown, self._refresh, Turn.CONTROLS)
        store.subscribe(Changed.OPENED | Changed.RESULT, self._show_factor, Turn.CONTROLS)
        store.subscribe(Changed.TICK, self._tick, Turn.CONTROLS)

    def _set(self, name: str) -> Callable[[Any], None]:
        """An action that changes one field of the view settings."""
        return lambda value: self._change(**{name: value})

    def _change(self, **fields: Any) -> None:
        self._store.set_view(replace(self._store.view, **fields))

    def _aim(self, view: str) -> None:
        """Point the cameras from this side, also if they were moved since."""
        self._change(camera=(view, self._store.view.camera[1] + 1))

    def _show_span(self) -> None:
        first, last = self._store.span
        self._time.min, self._time.max = first, last
        self._time.value = first
        self._span.value, self._typed = self._typed or f"{first:.2f} – {last:.2f}", ""

    def _set_span(self, text: str) -> None:
        """Take "2.5 – 6"; anything without numbers means all of it, one number is still being typed."""
        found = [float(value) for value in NUMBER.findall(text[:MAX_TYPED])]
        if len(found) != 1:
            self._typed = text[:MAX_TYPED] if found else ""
            self._store.set_span(*(found[:2] or (-math.inf, math.inf)))

    def _show_factor(self) -> None:
        put(self._deflection, value=self._store.deflection)

    def _refresh(self) -> None:
        motion, view = self._store.motion, self._store.view
        self._layout.value = view.layout
        self._note.content = dim(
            f"Identified robot: {escape(motion.model_note)}" if motion.model_note else ""
        )
        off(self._deflection, "no joint of this set has elasticity" if motion.rigid else "", DEFLECTION)
        why = "" if motion.link is not None else "the selected group has no link encoders"
        off(self._side, why, "compares motor angles, or link sides as the encoders measured them")
        if why and view.link_side:
            self._side.value = SIDES[0]
            self._change(link_side=False)

    def _tick(self) -> None:
        """Let the time slider follow the clock, unless the user holds it; show whether it plays."""
        if self._clock.playing:
            self._follow()
        self._show_state()

    def _show_state(self) -> None:
        playing = self._clock.playing
        put(self._buttons, options=(PAUSE if playing else PLAY, BACK, FORWARD))
        put(self._state, content=state_html(playing, self._clock.time, self._store.span))

    def _follow(self) -> None:
        if time.monotonic() - self._scrubbed > SCRUB_REST:
            self._time.value = round(self._clock.time, 2)

    def _press(self, button: str) -> None:
        if button in (PLAY, PAUSE):
            self._clock.toggle()
        else:
            self._clock.step(FRAME if button == FORWARD else -FRAME)
        self._follow()
        self._show_state()

    def _command(self, told: tuple[int, str]) -> None:
        """Do what was pressed on the bar or in a plot: "NUMBER VERB VALUE"."""
        found = COMMAND.fullmatch(told[1])
        verb, value = found.groups() if found else ("", "")
        if verb in ("toggle", "back", "forward"):
            self._press({"toggle": PLAY, "back": BACK, "forward": FORWARD}[verb])
        elif verb == "span":
            self._set_span(value)
        elif verb == "seek" and (instant := NUMBER.fullmatch(value)):
            self._clock.seek(float(instant[0]))
            self._follow()
            self._show_state()
        else:
            raise InputError(f"{shown(told[1])} is nothing that the playback can do")

    def _set_speed(self, name: str) -> None:
        self._clock.set_speed(SPEEDS[SPEED_NAMES.index(name)])

    def _toggle(self) -> None:
        self._press(PLAY)

    def _scrub(self, value: float) -> None:
        self._scrubbed = time.monotonic()
        self._clock.seek(value)

    def _loop(self, on: bool) -> None:
        now = self._clock.time
        self._clock.loop = on
        self._clock.seek(now)

    def _other_layout(self) -> None:
        self._change(layout=LAYOUTS[1 - LAYOUTS.index(self._store.view.layout)])
