"""Playback: the clock of the displayed instant, and the thread that draws it at least 30 times per second."""

from __future__ import annotations

import threading
import time as wall
import traceback
from collections.abc import Callable

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0)
RATE = 31.0  # [1/s] a little above 30: what is late by more than `LATE` is left out
LATE = 0.1  # [s]
LEAST_SPAN = 0.05  # [s] that is played and drawn
UNWATCHED_WAIT = 0.5  # [s] between looks whether somebody watches again


class PlaybackClock:
    """Runs over a time span and starts again; thread-safe."""

    def __init__(self, now: Callable[[], float] = wall.monotonic) -> None:
        self._now = now
        self._lock = threading.Lock()
        self._start, self._end = 0.0, 1.0
        self._time, self._speed = 0.0, 1.0
        self.loop = True  # start again at the end, or stop there
        self._since: float | None = None  # wall time of the start, None while paused

    def span(self, start: float, end: float) -> None:
        """Set the span to `start` … `end` [s] and go to its start; playing or paused as before."""
        with self._lock:
            self._start, self._end = start, max(end, start + 1e-6)
            self._set(start)

    def play(self) -> None:
        with self._lock:
            if not self.loop and self._at() >= self._end:
                self._set(self._start)
            if self._since is None:
                self._since = self._now()

    def toggle(self) -> None:
        """Pause while it plays, else play."""
        self.pause() if self.playing else self.play()

    def pause(self) -> None:
        with self._lock:
            self._time, self._since = self._at(), None

    def seek(self, time: float) -> None:
        """Go to an instant [s], clipped to the span."""
        with self._lock:
            self._set(time)

    def step(self, by: float) -> None:
        """Pause and move `by` [s]."""
        self.pause()
        self.seek(self._time + by)

    def set_speed(self, speed: float) -> None:
        """Set the playback speed, as a multiple of real time."""
        with self._lock:
            self._set(self._at())
            self._speed = speed

    @property
    def playing(self) -> bool:
        """Whether it runs; without a loop it stops at the end."""
        with self._lock:
            return self._since is not None and (self.loop or self._at() < self._end)

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
        self._time = min(max(time, self._start), self._end)
        if self._since is not None:
            self._since = self._now()


def part_of(whole: tuple[float, float], first: float, last: float) -> tuple[float, float]:
    """The part `first` … `last` [s] of a time span; the whole if that is too short."""
    first, last = max(first, whole[0]), min(last, whole[1])
    return (first, last) if last - first >= LEAST_SPAN else whole


class Playback:
    """Draws the clock's instant from a thread, if it has changed and somebody watches."""

    def __init__(self, clock: PlaybackClock, watched: Callable[[], bool] = lambda: True) -> None:
        self._clock, self._watched = clock, watched
        self.draw: Callable[[float], None] | None = None  # draws an instant [s]; None draws nothing
        self.lock = threading.Lock()  # of drawing; to be held while the scene is rebuilt
        self.frames = 0  # drawn so far
        self._drawn: tuple[Callable[[float], None] | None, float] = (None, -1.0)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="flexviz-playback", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        self._stop.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        due = wall.monotonic()
        while not self._stop.is_set():
            if not self._watched():
                self._stop.wait(UNWATCHED_WAIT)
                continue
            due = max(due + 1.0 / RATE, wall.monotonic() - LATE)
            try:
                with self.lock:
                    self._draw()
            except Exception:  # one bad frame must not end the playback
                traceback.print_exc()
            self._stop.wait(max(due - wall.monotonic(), 0.0))

    def _draw(self) -> None:
        draw, now = self.draw, self._clock.time
        if draw is not None and (draw, now) != self._drawn:
            draw(now)
            self._drawn = (draw, now)
            self.frames += 1
