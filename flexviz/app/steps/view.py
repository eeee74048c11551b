"""The floating panel under the robots: playback, layout, exaggeration, legend."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from flexviz.app.clock import SPEEDS
from flexviz.app.controls import choose, off, watch
from flexviz.app.style import half, no_label
from flexviz.scene import LAYOUTS
from flexviz.view import joint_rms, legend_html

if TYPE_CHECKING:
    from flexviz.app.application import Application

BUTTONS = ("Play", "Pause", "◀ Step", "Step ▶")
FRAME = 1.0 / 30.0  # [s] one press of a step button at speed 1
REST = 0.8  # [s] after a person has moved the time slider, the program leaves it alone
SIDES = ("motor side θ", "link side q")
SPEED_NAMES = tuple(f"{speed:g}×" for speed in SPEEDS)


class ViewPanel:
    """Play, step, scrub, speed; deflection and error factors; layout."""

    def __init__(self, app: Application) -> None:
        self._app = app
        gui = app.server.gui
        self._scrubbed = 0.0
        self._own_deflection = False  # a person has chosen the factor
        panel = gui.add_panel()
        with panel.add_tab("Playback"):
            self._buttons = gui.add_button_group("", BUTTONS)
            self._time = gui.add_slider("Time [s]", 0.0, 1.0, 0.01, 0.0)
            self._speed = gui.add_dropdown("Speed", SPEED_NAMES, initial_value="1×")
            self._layout = gui.add_dropdown("Layout", LAYOUTS, initial_value=LAYOUTS[0])
            self._deflection = gui.add_slider(
                "Deflection ×",
                0,
                500,
                1,
                1,
                hint="0 shows the motor side θ, 1 the link side q, more exaggerates θ − q",
            )
            self._error = gui.add_slider(
                "Error ×",
                1,
                500,
                1,
                1,
                hint="exaggerates simulated − measured motor angle of the identified robot",
            )
            self._legend = gui.add_html("")
        with panel.add_tab("View"):
            self._side = gui.add_dropdown("Side", SIDES, initial_value=SIDES[0])
            self._torque = gui.add_checkbox(
                "Torque arrows",
                False,
                hint="turn the way the measured torque does; full turn: its largest value",
            )
            self._loop = gui.add_checkbox("Loop", True, hint="begin again at the group's end")
        panel.float(x=12, y=-12, width=488)
        app.add_style(no_label(self._buttons._impl.uuid))
        for handle in (self._speed, self._layout):
            app.add_style(half(handle._impl.uuid))
        choose(self._buttons, app.queue, "playback")
        for handle, key in (
            (self._time, "time"), (self._speed, "speed"), (self._deflection, "deflection"),
            (self._error, "error"), (self._layout, "layout"),
        ):  # fmt: skip
            watch(handle, app.queue, key)
        for handle, key in ((self._side, "side"), (self._torque, "torque"), (self._loop, "loop")):
            watch(handle, app.queue, key)
        app.on("side", lambda _: app.show.show_motion())
        app.on("torque", lambda _: app.show.show_motion())
        app.on("loop", self._set_loop)
        app.on("playback", self.playback)
        app.on("time", self._scrub)
        app.on("speed", lambda name: app.show.clock.set_speed(SPEEDS[SPEED_NAMES.index(name)]))
        app.on("deflection", self._deflected)
        app.on("error", lambda _: app.show.show_motion())

    @property
    def factors(self) -> tuple[float, float]:
        """Deflection and error factor."""
        return float(self._deflection.value), float(self._error.value)

    @property
    def link_side(self) -> bool:
        """Whether the link sides are compared."""
        return self._side.value == SIDES[1]

    @property
    def torque(self) -> bool:
        """Whether torque arrows are drawn."""
        return bool(self._torque.value)

    def _set_loop(self, on: bool) -> None:
        clock = self._app.show.clock
        now = clock.time
        clock.loop = on
        clock.seek(now)

    @property
    def layout(self) -> str:
        """The chosen layout."""
        return self._layout.value

    def change_layout(self) -> None:
        """The other layout."""
        self._layout.value = LAYOUTS[1 - LAYOUTS.index(self._layout.value)]
        self._app.show.layout(self.layout)

    def suggest_deflection(self, factor: int, anew: bool = False) -> None:
        """Set the deflection factor, unless a person has chosen one (for this set: not `anew`)."""
        self._own_deflection = self._own_deflection and not anew
        if not self._own_deflection:
            self._deflection.value = factor

    def span(self, start: float, end: float) -> None:
        """A new group's time."""
        self._time.min, self._time.max = start, end
        self._time.value = start
        self._app.show.clock.span(start, end)

    def playback(self, button: str) -> None:
        """One of the buttons."""
        clock = self._app.show.clock
        if button == "Play":
            clock.play()
        elif button == "Pause":
            clock.pause()
        else:
            clock.step(FRAME if button == BUTTONS[3] else -FRAME)
        self.tick()

    def toggle(self) -> None:
        """Play or pause."""
        self.playback("Pause" if self._app.show.clock.playing else "Play")

    def tick(self) -> None:
        """Let the time slider follow, unless somebody holds it."""
        if time.monotonic() - self._scrubbed > REST:
            self._time.value = round(self._app.show.clock.time, 2)

    def refresh(self) -> None:
        """Show the legend of the present result and group."""
        app = self._app
        why = "" if app.show.motion.link is not None else "the shown group has no link encoders"
        off(self._side, why, "compares motor angles, or link sides as the encoders measured them")
        if self._side.disabled:
            self._side.value = SIDES[0]
        rms = joint_rms(app.session.analysis.identification, app.show.group.name)
        self._legend.content = legend_html(
            app.measurements.joints, rms, app.show.group.name, app.show.motion.model_note, app.show.joint
        )

    def _deflected(self, _: float) -> None:
        self._own_deflection = True
        self._app.show.show_motion()

    def _scrub(self, value: float) -> None:
        self._scrubbed = time.monotonic()
        self._app.show.clock.seek(value)
