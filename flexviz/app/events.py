"""The event queue between browsers, worker and the application's loop."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any

MAX_QUEUE_LENGTH = 1000  # events; only a misbehaving client exceeds it


@dataclass(frozen=True)
class Event:
    """A call `action(value)` for the loop.

    Attributes:
        source: origin; a newer event replaces waiting ones of the same source.
        control: whether a control on the page was used.
        born: creation time [s, monotonic].
    """

    source: Hashable
    action: Callable[[Any], None]
    value: Any = None
    control: bool = False
    born: float = field(default_factory=time.monotonic)


class EventQueue:
    """First in, first out; a newer event replaces waiting ones of the same source."""

    def __init__(self) -> None:
        self._waiting: list[Event] = []
        self._change = threading.Condition()

    def put(self, event: Event, *, each: bool = False) -> None:
        """Add an event; `each` keeps older ones of its source. Thread-safe."""
        with self._change:
            if not each:
                self._waiting = [other for other in self._waiting if other.source != event.source]
            if len(self._waiting) < MAX_QUEUE_LENGTH:
                self._waiting.append(event)
            self._change.notify()

    def call(self, action: Callable[[Any], None], value: Any = None) -> None:
        """Let the loop call `action(value)`, once per call. Thread-safe."""
        self.put(Event(action, action, value), each=True)

    def take(self, timeout: float) -> Event | None:
        """The oldest event, or None after `timeout` [s]."""
        with self._change:
            if not self._waiting:
                self._change.wait(timeout)
            return self._waiting.pop(0) if self._waiting else None

    def __len__(self) -> int:
        return len(self._waiting)
