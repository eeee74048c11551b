"""The left dock's frame (steps, status, selection) and the right dock's tabs of plots."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flexviz.app.charts import ChartColumn
from flexviz.app.style import CSS, no_label, pressed, style
from flexviz.view.convergence import convergence_plots
from flexviz.view.signals import signals_plots
from flexviz.view.states import observer_for, states_plots
from flexviz.view.status import READY, status_html, step_line_html

if TYPE_CHECKING:
    from flexviz.app.application import Application

LEFT, RIGHT = 330, 430  # [pixels]


class Dock:
    """Left: where one is, what goes on, which joint and group; below it the current step's controls."""

    def __init__(self, app: Application) -> None:
        self._app = app
        self.rules: list[str] = [CSS]
        self.step = READY[0]
        gui = app.server.gui
        app.set_dark(False)
        gui.main_panel.dock_left()
        gui.main_panel.set_width(LEFT)
        self._style = gui.add_html("")
        self._line = gui.add_html("")
        self._status = gui.add_html("")
        self._buttons = gui.add_button_group("", READY)
        self._joint: Any = gui.add_dropdown("Joint", ("–",), initial_value="–")
        self._group: Any = gui.add_dropdown("Group", ("–",), initial_value="–")
        gui.add_divider()
        self._said: tuple[str, str, str] = ("", "", "")
        app.choose(self._buttons, "step", self.go)
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
        """Show what is selected."""
        self._joint.value = self._app.measurements.joints[self._app.show.joint]
        self._group.value = self._app.show.group.name
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

    def _draw_step(self) -> None:
        session = getattr(self._app, "session", None)
        done: tuple[str, ...] = ()
        if session is not None and session.analysis.identification is not None:
            done = READY
        self._line.content = step_line_html(self.step, done)
        chosen = pressed(self._buttons._impl.uuid, READY.index(self.step))
        self._style.content = style(*self.rules, chosen)


class PlotPanel:
    """Right: Signals, States, Convergence. A tab's charts change only when what they show does."""

    def __init__(self, app: Application) -> None:
        self._app = app
        panel = app.server.gui.add_panel()
        self._signals, self._states, self._convergence = (
            ChartColumn(app.server, panel.add_tab(label)) for label in ("Signals", "States", "Convergence")
        )
        panel.dock_right()
        panel.set_width(RIGHT)

    def show_signals(self) -> None:
        """Torque, residual, error of the selected joint in the selected group."""
        show, result = self._app.show, self._app.session.analysis.identification
        name = self._app.measurements.joints[show.joint]
        self._signals.show(signals_plots(show.group, show.joint, name, result, show.motion))
        self.move(show.clock.time)

    def show_states(self) -> None:
        """The observer's states of the selected joint in the selected group."""
        show, analysis = self._app.show, self._app.session.analysis
        observer = observer_for(analysis.observer, analysis.bandwidth, show.joint)
        hold, now = self._app.measurements.torque_hold, show.clock.time
        self._states.show(states_plots(show.group, show.joint, observer, hold, now))

    def show_convergence(self, iterations: list[Any]) -> None:
        """The solver's way."""
        self._convergence.show(convergence_plots(iterations))

    def move(self, time: float) -> None:
        """Move the playheads [s]."""
        self._signals.move(time)
