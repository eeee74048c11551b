"""The playback clock: the displayed instant of the selected group."""

from __future__ import annotations

import threading
import time as wall
from collections.abc import Callable

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0)


class PlaybackClock:
    """Runs over a time span and starts again; thread-safe."""

    def __init__(self, now: Callable[[], float] = wall.monotonic) -> None:
        self._now = now
        self._lock = threading.Lock()
        self._start, self._end = 0.0, 1.0
        self._time = 0.0
        self._speed = 1.0
        self.loop = True  # start again at the end, or stop there
        self._since: float | None = None  # wall time of the start, None while paused

    def span(self, start: float, end: float) -> None:
        """Set the span to `start` … `end` [s] and go to its start; playing or paused as before."""
        with self._lock:
            self._start, self._end = start, max(end, start + 1e-6)
            self._set(start)

    def play(self) -> None:
        """Run."""
        with self._lock:
            if not self.loop and self._at() >= self._end:
                self._set(self._start)
            if self._since is None:
                self._since = self._now()

    def pause(self) -> None:
        """Pause."""
        with self._lock:
            self._time, self._since = self._at(), None

    def seek(self, time: float) -> None:
        """Go to an instant [s], clipped to the span."""
        with self._lock:
            self._set(min(max(time, self._start), self._end))

    def step(self, by: float) -> None:
        """Pause and move `by` [s]."""
        with self._lock:
            time = min(max(self._at() + by, self._start), self._end)
            self._since = None
            self._set(time)

    def set_speed(self, speed: float) -> None:
        """Set the playback speed, as a multiple of real time."""
        with self._lock:
            self._set(self._at())
            self._speed = speed

    @property
    def playing(self) -> bool:
        """True while it runs."""
        return self._since is not None

    @property
    def time(self) -> float:
        """The current instant [s]."""
        with self._lock:
            return self._at()

    def _at(self) -> float:
        if self._since is None:
            return self._time
        run = self._time + self._speed * (self._now() - self._since) - self._start
        span = self._end - self._start
        return self._start + (run % span if self.loop else min(run, span))

    def _set(self, time: float) -> None:
        self._time = time
        if self._since is not None:
            self._since = self._now()
