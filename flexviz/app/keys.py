"""Keys and the command palette. A key that a focused control has taken for itself does nothing else."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from flexviz.app.controls import command
from flexviz.view import STEPS

if TYPE_CHECKING:
    from flexviz.app.application import Application

SETTLE = 0.06  # [s] a key press waits this long for the control that may have had it (a slider, a button)
SHARED = ("toggle", "back", "forward", "1", "2", "3", "4")  # keys that controls use too
CTRL, SHIFT = "cmd/ctrl", "cmd/ctrl+shift"
COMMANDS = (
    ("toggle", "Play or pause", "space", None),
    ("back", "Step back", "arrowleft", None),
    ("forward", "Step forward", "arrowright", None),
    ("find", "Find what is missing in the model", "enter", SHIFT),
    ("run", "Run the identification", "enter", CTRL),
    ("stop", "Stop what runs", "escape", None),
    ("undo", "Undo the last change", "Z", CTRL),
    ("redo", "Redo the undone change", "Z", SHIFT),
    *((str(i), f"Go to step {name}", str(i), None) for i, name in enumerate(STEPS, start=1)),
    ("add", "Add the best finding and refit", None, None),
    ("add-all", "Add all that is found", None, None),
    ("check", "Check what can be identified", None, None),
    ("sweep", "Sweep the bandwidth", None, None),
    ("best", "Take the sweep's best bandwidth", None, None),
    ("own", "Take the observer's own bandwidth", None, None),
    ("joint", "Choose the next joint", None, None),
    ("group", "Choose the next group", None, None),
    ("layout", "Change the layout of the robots", None, None),
    ("save", "Save the session", None, None),
    ("download", "Send the session as a zip", None, None),
    ("report", "Send a report", None, None),
    ("record", "Begin or end a recording", None, None),
)


class Keys:
    """Commands that wait a moment before they act."""

    def __init__(self, app: Application) -> None:
        self._waiting: list[tuple[float, str, int]] = []
        self._touched = 0.0
        for key, label, hotkey, modifier in COMMANDS:
            command(app.server, app.queue, key, label, hotkey, modifier)
        app.on("command", lambda what: self._waiting.append((time.monotonic(), *what)))
        files, sweep = app.data.files, app.observer.sweep
        self._actions: dict[str, Callable[[int], None]] = {
            "toggle": lambda _: app.view.toggle(),
            "back": lambda _: app.view.playback("◀ Step"),
            "forward": lambda _: app.view.playback("Step ▶"),
            "run": lambda _: app.identify.run(),
            "find": lambda _: app.diagnose.find(),
            "stop": lambda _: app.stop(),
            "undo": lambda _: app.undo(),
            "redo": lambda _: app.redo(),
            **{str(i): lambda _, step=step: app.dock.go(step) for i, step in enumerate(STEPS, start=1)},
            "add": lambda _: app.diagnose.add(0),
            "add-all": lambda _: app.diagnose.add_all(),
            "check": lambda _: app.identify.check.run(),
            "sweep": lambda _: sweep.run(),
            "best": lambda _: sweep.take_best(),
            "own": lambda _: app.observer.take_own(),
            "joint": lambda _: app.show.next_joint(),
            "group": lambda _: app.show.next_group(),
            "layout": lambda _: app.view.change_layout(),
            "save": lambda _: files.save(),
            "download": files.download,
            "report": files.report,
            "record": lambda _: files.toggle(),
        }

    def touched(self, when: float) -> None:
        """A control was used at this time [s, monotonic]."""
        self._touched = when

    def due(self) -> list[tuple[str, int]]:
        """Commands whose time has come, and who gave them."""
        now = time.monotonic()
        due = [entry for entry in self._waiting if now - entry[0] >= SETTLE]
        self._waiting = [entry for entry in self._waiting if entry not in due]
        return [
            (key, who) for at, key, who in due if key not in SHARED or abs(self._touched - at) > 2 * SETTLE
        ]

    def act(self, key: str, who: int) -> None:
        """Do what a command says, for the browser that gave it."""
        self._actions[key](who)
