"""The queue between the browsers, the worker and the one loop that acts."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any

LARGEST_QUEUE = 1000  # waiting events; more come only from a client that misbehaves


@dataclass(frozen=True)
class Event:
    """Something happened.

    Attributes:
        source: where; of several waiting events from one source only the newest counts.
        action: what the loop calls with `value`.
        value: what it carries.
        control: whether somebody used a control on the page.
        born: when [s, monotonic].
    """

    source: Hashable
    action: Callable[[Any], None]
    value: Any = None
    control: bool = False
    born: float = field(default_factory=time.monotonic)


class EventQueue:
    """First in, first out; of several waiting events from one source only the newest stays."""

    def __init__(self) -> None:
        self._waiting: list[Event] = []
        self._change = threading.Condition()

    def put(self, event: Event, *, each: bool = False) -> None:
        """Add an event; with `each` older ones from its source stay. From any thread."""
        with self._change:
            if not each:
                self._waiting = [other for other in self._waiting if other.source != event.source]
            if len(self._waiting) < LARGEST_QUEUE:
                self._waiting.append(event)
            self._change.notify()

    def call(self, action: Callable[[Any], None], value: Any = None) -> None:
        """Have the loop call `action(value)`, each time. From any thread."""
        self.put(Event(action, action, value), each=True)

    def take(self, timeout: float) -> Event | None:
        """The oldest event, or None when none comes within `timeout` [s]."""
        with self._change:
            if not self._waiting:
                self._change.wait(timeout)
            return self._waiting.pop(0) if self._waiting else None

    def __len__(self) -> int:
        return len(self._waiting)
