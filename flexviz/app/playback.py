"""Playback: a thread that moves both robots 30 times per second."""

from __future__ import annotations

import threading
import time
import traceback
from dataclasses import dataclass

from flexviz.app.clock import PlaybackClock
from flexviz.app.scene import Scene
from flexviz.scene import RobotMotion

RATE = 30.0  # [1/s]


@dataclass(frozen=True, eq=False)
class DrawnMotion:
    """The drawn motion with its exaggeration factors."""

    motion: RobotMotion
    deflection: float
    error: float
    link_side: bool = False
    torque: bool = False


class Playback:
    """Draws the motion at the clock's time, if it has changed."""

    def __init__(self, scene: Scene, clock: PlaybackClock) -> None:
        self._scene = scene
        self._clock = clock
        self._drawn_motion: DrawnMotion | None = None
        self._drawn: tuple[DrawnMotion | None, float] = (None, -1.0)
        self._lock = threading.Lock()  # the scene is not rebuilt while it is drawn
        self._stop = threading.Event()
        self.frames = 0
        self._thread = threading.Thread(target=self._run, name="flexviz-playback", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def show(self, drawn_motion: DrawnMotion | None) -> None:
        """Draw this motion; None draws nothing."""
        self._drawn_motion = drawn_motion

    def hold(self) -> threading.Lock:
        """The lock to hold while the scene is rebuilt."""
        return self._lock

    def close(self) -> None:
        """End the thread."""
        self._stop.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stop.is_set():
            due = max(due + 1.0 / RATE, time.monotonic() - 0.1)
            try:
                with self._lock:
                    self._draw()
            except Exception:  # one bad frame must not end the playback
                traceback.print_exc()
            self._stop.wait(max(due - time.monotonic(), 0.0))

    def _draw(self) -> None:
        drawn_motion, now = self._drawn_motion, self._clock.time
        if drawn_motion is None or (drawn_motion, now) == self._drawn:
            return
        shares = drawn_motion.motion.torque_shares(now) if drawn_motion.torque else None
        self._scene.pose(
            *drawn_motion.motion.pose(
                now, drawn_motion.deflection, drawn_motion.error, drawn_motion.link_side
            ),
            shares,
        )
        self._drawn = (drawn_motion, now)
        self.frames += 1
