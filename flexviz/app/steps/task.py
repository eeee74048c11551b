"""A step's long job: one at a time, with its words on the status line."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from flexviz.jobs import JobEvent
from flexviz.progress import ProgressCallback

if TYPE_CHECKING:
    from flexviz.app.application import Application


class Task:
    """Starts, stops and hears one kind of job; what it was started for is kept until its end.

    Attributes
    ----------
    of: what the running job was started for; None while none runs.
    """

    def __init__(
        self,
        app: Application,
        key: str,
        stopped: str,
        progress: ProgressCallback,
        done: Callable[[Any, Any], None],
        nothing: Callable[[], None] = lambda: None,
    ) -> None:
        """`done` gets what the job was started for and its result; `nothing` is called where it has none.

        `stopped` is what is said then, where the user ended it.
        """
        self._app, self._key, self._stopped = app, key, stopped
        self._progress, self._done, self._nothing = progress, done, nothing
        self.of: Any = None

    @property
    def running(self) -> bool:
        """True while the job runs or waits."""
        return self.of is not None

    def start(
        self, of: Any, words: str, function: Callable[..., Any], *args: Any, share: float = 0.0
    ) -> None:
        """Start it; `share` is where the progress bar begins."""
        self.of = of
        self._app.dock.progress(share)
        self._app.say(words, "busy")
        self._app.submit(self._key, function, *args)
        self._app.refresh_running()

    def stop(self) -> None:
        """Ask it to stop."""
        if self.running:
            self._app.worker.stop(self._key)
            self._app.say("stopping", "busy")

    def heard(self, event: JobEvent) -> None:
        """What the job has to say."""
        if event.kind == "started":
            return
        if event.kind == "progress":
            self._progress(event.value)
            return
        of, self.of = self.of, None
        if event.kind == "done" and of is not None:
            self._done(of, event.value)
        else:
            if event.kind == "failed":
                self._app.fail(event.value)
            else:
                self._app.say(self._stopped)
            self._nothing()
        self._app.refresh_running()
