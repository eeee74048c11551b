"""Tasks on the worker, with callbacks in the application's loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flexviz.app.events import EventQueue
from flexviz.jobs import Job, JobEvent, Result, Task, Worker
from flexviz.progress import Progress, ProgressCallback, ignore


def nothing() -> None:
    """Do nothing."""


class TaskRunner:
    """Starts tasks; all callbacks run in the loop's thread."""

    def __init__(self, queue: EventQueue, failed: Callable[[str], None]) -> None:
        self._queue, self._failed = queue, failed
        self._worker = Worker()

    def start(
        self,
        task: Task[Result],
        done: Callable[[Result], None],
        *,
        progress: ProgressCallback = ignore,
        failed: Callable[[str], None] | None = None,
        stopped: Callable[[], None] = nothing,
    ) -> Job:
        """Start a task, replacing a waiting one of its class.

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

        return self._worker.submit(task, lambda event: self._queue.call(act, event))

    def stop(self, kind: type[Task[Any]]) -> None:
        """Stop the tasks of this class."""
        self._worker.stop(kind)

    @property
    def busy(self) -> bool:
        """True while a task runs or waits."""
        return self._worker.busy

    def close(self) -> None:
        """Stop everything."""
        self._worker.close()
