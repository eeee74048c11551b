"""The change signal: subscribers and the order in which they are notified."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Flag, IntEnum, auto


class Changed(Flag):
    """What has changed in the store."""

    OPENED = auto()  # another measurement set or session
    ANALYSIS = auto()  # anything in the analysis; details in the next three
    OBSERVER = auto()  # the observer or its bandwidth
    RESULT = auto()  # the identification
    DIAGNOSIS = auto()  # the diagnosis, or the earlier models
    NEW_STATE = auto()  # a new state of the session
    HISTORY = auto()  # undo or redo
    DERIVED = auto()  # the simulated motion, or the residual maps, of a result
    FIT = auto()  # iterations of a running fit
    CHECK = auto()  # the sentence of the last check
    JOINT = auto()  # the selected joint
    GROUP = auto()  # the selected group
    STEP = auto()  # the step whose controls are shown
    VIEW = auto()  # how the robots are drawn
    HIGHLIGHT = auto()  # the highlighted instants
    ACTIVITY = auto()  # a task that the user waits for has started or ended
    PROGRESS = auto()  # the progress of that task
    MESSAGE = auto()  # the status line
    SAVED = auto()  # the session
    FOLDER = auto()  # where the session is saved
    TICK = auto()  # periodic
    CLOSED = auto()  # the application ends


class Turn(IntEnum):
    """The order in which subscribers are notified: plots and tables are current before the status line."""

    PLOTS = auto()
    CONTROLS = auto()
    STATUS = auto()
    WORK = auto()


@dataclass(frozen=True)
class _Subscriber:
    stage: Turn
    changes: Changed
    act: Callable[[], None]


class ChangeSignal:
    """Tells subscribers what has changed."""

    def __init__(self) -> None:
        self._subscribers: list[_Subscriber] = []
        self._untold = Changed(0)
        self._telling = False

    def subscribe(self, changes: Changed, act: Callable[[], None], stage: Turn = Turn.PLOTS) -> None:
        """Call `act` after any of these changes, stage by stage and then in the order of subscription."""
        self._subscribers.append(_Subscriber(stage, changes, act))
        self._subscribers.sort(key=lambda subscriber: subscriber.stage)

    def tell(self, change: Changed) -> None:
        """Notify the subscribers; changes they make are notified after all have been called."""
        self._untold |= change
        if self._telling:
            return
        self._telling = True
        try:
            while change := self._untold:
                self._untold = Changed(0)
                for subscriber in self._subscribers:
                    if subscriber.changes & change:
                        subscriber.act()
        finally:
            self._telling, self._untold = False, Changed(0)
