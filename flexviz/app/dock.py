"""The left dock's frame: where one is, what goes on, undo, redo and stop, which joint and group."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flexviz.app.style import CSS, next_button, next_option, no_label, pressed, style
from flexviz.view import STEPS, next_step, status_html, step_line_html, steps_done

if TYPE_CHECKING:
    from flexviz.app.application import Application

LEFT = 330  # [pixels]


class Dock:
    """Below the frame come the current step's controls."""

    def __init__(self, app: Application) -> None:
        self._app = app
        self.rules: list[str] = [CSS]
        self.next_buttons: dict[str, Any] = {}  # what `view.next_step` calls them -> the button
        self.step = STEPS[0]
        self._said: tuple[str, str, str] = ("", "", "")
        gui = app.server.gui
        app.set_dark(False)
        gui.main_panel.dock_left()
        gui.main_panel.set_width(LEFT)
        self._style = gui.add_html("")
        self._line = gui.add_html("")
        self._status = gui.add_html("")
        self._buttons = gui.add_button_group("", STEPS)
        self._undo = gui.add_button("Undo", color="gray", disabled=True)
        self._redo = gui.add_button("Redo", color="gray", disabled=True)
        self._stop = gui.add_button("Stop", color="red", disabled=True)
        self._bar = gui.add_progress_bar(0.0, visible=False, animated=True)
        self._joint: Any = gui.add_dropdown("Joint", ("–",), initial_value="–")
        self._group: Any = gui.add_dropdown("Group", ("–",), initial_value="–")
        gui.add_divider()
        self.rules.append(app.hints.row((self._undo, self._redo, self._stop)))
        app.choose(self._buttons, "step", self.go)
        app.press(self._undo, "undo", app.undo)
        app.press(self._redo, "redo", app.redo)
        app.press(self._stop, "stop", app.stop)
        app.watch(
            self._joint, "joint", lambda name: app.show.select(joint=app.measurements.joint_index(name))
        )
        app.watch(self._group, "group", lambda name: app.show.select(group=name))

    def finish(self) -> None:
        """All controls exist: write the style sheet."""
        self.rules.append(no_label(self._buttons._impl.uuid))
        self._draw_step()

    def opened(self) -> None:
        """A new set is shown."""
        self._joint.options = self._app.measurements.joints
        self._group.options = tuple(group.name for group in self._app.measurements.groups)
        self.refresh()

    def refresh(self) -> None:
        """Show what is selected, and what may be pressed."""
        app = self._app
        self._joint.value = app.measurements.joints[app.show.joint]
        self._group.value = app.show.group.name
        for button, label, word in (
            (self._undo, app.session.undoes, "takes back"),
            (self._redo, app.session.redoes, "brings again"),
        ):
            button.disabled = not label
            button.hint = f"{word}: {label}" if label else "off: nothing to do"
        self._stop.disabled = not app.running
        self._stop.hint = "ends what runs and keeps what it has" if app.running else "off: nothing runs"
        self._bar.visible = app.running
        self._draw_step()

    def go(self, step: str) -> None:
        """Another step."""
        self.step = step
        for name, part in self._app.steps.items():
            part.folder.visible = name == step
        self._draw_step()
        self.say(*self._said)

    def say(self, message: str, error: str, tone: str) -> None:
        """Write the status line."""
        self._said = (message, error, tone)
        self._status.content = status_html(self.step, message, error, tone)

    def progress(self, share: float) -> None:
        """How far the running work is, 0 … 1; an unknown share is drawn full."""
        self._bar.value = 100.0 * min(max(share, 0.0), 1.0)

    def tick(self) -> None:
        """Let the hints follow what they say."""
        self._draw_step()

    def _draw_step(self) -> None:
        session = getattr(self._app, "session", None)
        rules = [*self.rules, pressed(self._buttons._impl.uuid, STEPS.index(self.step))]
        if session is None:
            line = step_line_html(self.step)
        else:
            following = next_step(session.analysis, self.step, self._app.running)
            line = step_line_html(self.step, steps_done(session.analysis), following.text)
            if following.step in STEPS and following.step != self.step:
                rules.append(next_option(self._buttons._impl.uuid, STEPS.index(following.step)))
            elif following.button in self.next_buttons:
                rules.append(next_button(self.next_buttons[following.button]._impl.uuid))
        if line != self._line.content:
            self._line.content = line
        sheet = style(*rules, *self._app.hints.rules())
        if sheet != self._style.content:
            self._style.content = sheet
