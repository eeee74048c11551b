"""The event queue of the application's loop, and the tasks whose callbacks go through it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any

from flexviz.base.jobs import JobEvent, Result, Task, Worker
from flexviz.base.progress import Progress, ProgressCallback, ignore

MAX_QUEUE_LENGTH = 1000  # events; only a misbehaving client exceeds it


@dataclass(frozen=True)
class Event:
    """A call `action(value)` for the loop."""

    source: Hashable  # a newer event replaces waiting ones of the same source
    action: Callable[[Any], None]
    value: Any = None
    control: bool = False  # whether a control on the page was used
    born: float = field(default_factory=time.monotonic)


class EventQueue:
    """First in, first out; a newer event replaces waiting ones of the same source. Thread-safe."""

    def __init__(self) -> None:
        self._waiting: list[Event] = []
        self._change = threading.Condition()

    def put(self, event: Event, *, each: bool = False) -> None:
        """Add an event; `each` keeps older ones of its source."""
        with self._change:
            if not each:
                self._waiting = [other for other in self._waiting if other.source != event.source]
            if len(self._waiting) < MAX_QUEUE_LENGTH:
                self._waiting.append(event)
            self._change.notify()

    def call(self, action: Callable[[Any], None], value: Any = None) -> None:
        """Let the loop call `action(value)`, once per call."""
        self.put(Event(action, action, value), each=True)

    def take(self, timeout: float) -> Event | None:
        """The oldest event, or None after `timeout` [s]."""
        with self._change:
            if not self._waiting:
                self._change.wait(timeout)
            return self._waiting.pop(0) if self._waiting else None

    def __len__(self) -> int:
        return len(self._waiting)


class TaskRunner:
    """Starts tasks on two workers; all callbacks run in the loop's thread.

    What runs in a thread of this process, such as saving, opening or writing a report, does not wait for a
    computation in the child process.
    """

    def __init__(self, queue: EventQueue, failed: Callable[[str], None]) -> None:
        self._queue, self._failed = queue, failed
        self._workers = {in_process: Worker() for in_process in (True, False)}

    @property
    def busy(self) -> bool:
        """Whether a task is running or waiting."""
        return any(worker.busy for worker in self._workers.values())

    def stop(self, kind: type[Task[Any]] = Task, grace: float | None = None) -> None:
        """Ask running tasks of this class to stop, and drop the waiting ones; see `Worker.stop`."""
        for worker in self._workers.values():
            worker.stop(kind, grace)

    def close(self) -> None:
        """Stop everything and end the child process."""
        for worker in self._workers.values():
            worker.close()

    def start(
        self,
        task: Task[Result],
        done: Callable[[Result], None],
        *,
        progress: ProgressCallback = ignore,
        failed: Callable[[str], None] | None = None,
        stopped: Callable[[], None] = lambda: None,
    ) -> None:
        """Start a task, replacing a waiting one of its kind.

        Args:
            done: gets its result.
            progress: gets its progress.
            failed: gets the reason of a failure; by default it is shown to the user.
            stopped: called if it was stopped without a result.
        """

        def act(event: JobEvent) -> None:
            if event.kind == "progress" and isinstance(event.value, Progress):
                progress(event.value)
            elif event.kind == "done":
                done(event.value)
            elif event.kind == "failed":
                (failed or self._failed)(event.value)
            elif event.kind == "stopped":
                stopped()

        worker = self._workers[task.in_process]
        worker.submit(task, lambda event: self._queue.call(act, event))
