"""The queue between the browsers and the one loop that acts. No viser here."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

LIMIT = 1000  # waiting events; more come only from something that does not behave


@dataclass(frozen=True)
class Event:
    """Something happened: `key` says what, `value` carries it, `born` is when [s, monotonic]."""

    key: str
    value: Any = None
    born: float = field(default_factory=time.monotonic)


class EventQueue:
    """First in, first out; of several waiting events with one key only the newest stays."""

    def __init__(self) -> None:
        self._waiting: list[Event] = []
        self._change = threading.Condition()

    def put(self, key: str, value: Any = None, each: bool = False) -> None:
        """Add an event; with `each` the older ones of its key stay too. From any thread."""
        with self._change:
            if not each:
                self._waiting = [event for event in self._waiting if event.key != key]
            if len(self._waiting) < LIMIT:
                self._waiting.append(Event(key, value))
            self._change.notify()

    def take(self, timeout: float) -> Event | None:
        """The oldest event, or None when none comes within `timeout` [s]."""
        with self._change:
            if not self._waiting:
                self._change.wait(timeout)
            return self._waiting.pop(0) if self._waiting else None

    def __len__(self) -> int:
        return len(self._waiting)


class Dispatcher:
    """Event keys and the functions that act on them; an unknown key is a mistake in the program."""

    def __init__(self, on_error: Callable[[Event, Exception], None]) -> None:
        self._handlers: dict[str, Callable[[Any], None]] = {}
        self._on_error = on_error

    def on(self, key: str, handler: Callable[[Any], None]) -> None:
        """Act on events of `key` with `handler(value)`."""
        self._handlers[key] = handler

    def act(self, event: Event) -> None:
        """Run the event's handler; a failure is reported and does not end the loop."""
        self.guard(event, lambda: self._handlers[event.key](event.value))

    def guard(self, event: Event, action: Callable[[], None]) -> None:
        """Run something on behalf of an event, with the same care."""
        try:
            action()
        except Exception as error:
            self._on_error(event, error)
