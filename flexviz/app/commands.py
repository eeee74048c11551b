"""The command palette and its keys. A key press used by the focused control triggers no command."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import viser

from flexviz.app.events import EventQueue

SETTLE = 0.06  # [s] delay of a command, in which a control may claim its key press
CTRL, SHIFT = "cmd/ctrl", "cmd/ctrl+shift"


@dataclass(frozen=True)
class Command:
    """An entry of the palette.

    Attributes:
        label: unique name.
        action: called with the number of the browser.
        shared: whether controls also use this key.
    """

    label: str
    action: Callable[[int], None]
    hotkey: str | None = None
    modifier: str | None = None
    shared: bool = False


@dataclass(frozen=True)
class _Request:
    command: Command
    client: int
    when: float


class Commands:
    """Commands, executed after a short delay."""

    def __init__(self, server: viser.ViserServer, queue: EventQueue) -> None:
        self._server, self._queue = server, queue
        self.known: dict[str, Command] = {}  # by label
        self._waiting: list[_Request] = []
        self._touched = 0.0

    def add(self, command: Command) -> None:
        """Add a command to the palette."""
        self.known[command.label] = command
        hotkey: Any = command.hotkey
        modifier: Any = command.modifier
        handle = self._server.gui.add_command(command.label, hotkey=hotkey, modifier=modifier)

        async def triggered(event: Any) -> None:
            self._queue.call(self.request, _Request(command, event.client_id, time.monotonic()))

        handle.on_trigger(triggered)

    def request(self, request: _Request) -> None:
        """Queue a command."""
        self._waiting.append(request)

    def touched(self, when: float) -> None:
        """Record that a control was used at time `when` [s, monotonic]."""
        self._touched = when

    def due(self) -> list[Callable[[], None]]:
        """The actions of commands that are due."""
        now = time.monotonic()
        due = [request for request in self._waiting if now - request.when >= SETTLE]
        self._waiting = [request for request in self._waiting if request not in due]
        return [
            lambda request=request: request.command.action(request.client)
            for request in due
            if not request.command.shared or abs(self._touched - request.when) > 2 * SETTLE
        ]
