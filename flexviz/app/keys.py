"""Keys and the command palette. A key that a focused control has taken for itself does nothing else."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from flexviz.app.controls import command

if TYPE_CHECKING:
    from flexviz.app.application import Application

SETTLE = 0.06  # [s] a key press waits this long for the control that may have had it (a slider, a button)
SHARED = ("toggle", "back", "forward")  # keys that controls use too
COMMANDS = (
    ("toggle", "Play or pause", "space", None),
    ("back", "Step back", "arrowleft", None),
    ("forward", "Step forward", "arrowright", None),
    ("find", "Find what is missing in the model", "enter", "cmd/ctrl+shift"),
    ("run", "Run the identification", "enter", "cmd/ctrl"),
    ("stop", "Stop what runs", "escape", None),
    ("undo", "Undo the last change", "Z", "cmd/ctrl"),
    ("redo", "Redo the undone change", "Z", "cmd/ctrl+shift"),
)


class Keys:
    """Commands that wait a moment before they act."""

    def __init__(self, app: Application) -> None:
        self._waiting: list[tuple[float, str]] = []
        self._touched = 0.0
        for key, label, hotkey, modifier in COMMANDS:
            command(app.server, app.queue, key, label, hotkey, modifier)
        app.on("command", lambda key: self._waiting.append((time.monotonic(), key)))
        self._actions = {
            "toggle": app.view.toggle,
            "back": lambda: app.view.playback("◀ Step"),
            "forward": lambda: app.view.playback("Step ▶"),
            "run": app.identify.run,
            "find": app.diagnose.find,
            "stop": app.stop,
            "undo": app.undo,
            "redo": app.redo,
        }

    def touched(self, when: float) -> None:
        """A control was used at this time [s, monotonic]."""
        self._touched = when

    def due(self) -> list[str]:
        """Commands whose time has come."""
        now = time.monotonic()
        due = [entry for entry in self._waiting if now - entry[0] >= SETTLE]
        self._waiting = [entry for entry in self._waiting if entry not in due]
        return [key for at, key in due if key not in SHARED or abs(self._touched - at) > 2 * SETTLE]

    def act(self, key: str) -> None:
        """Do what a command says."""
        self._actions[key]()
