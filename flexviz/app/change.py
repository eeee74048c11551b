"""The change signal: who is told of what, and in which order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Flag, IntEnum, auto


class Changed(Flag):
    """What has changed in the store."""

    OPENED = auto()  # another measurement set or session
    ANALYSIS = auto()  # anything in the analysis; what exactly, the next three say
    OBSERVER = auto()  # the observer or its bandwidth
    RESULT = auto()  # the identification
    DIAGNOSIS = auto()  # the diagnosis, or the models on the way to the present one
    NEW_STATE = auto()  # the session has gone on to a new state
    HISTORY = auto()  # the session has gone back or forward, by undo or redo
    DERIVED = auto()  # the simulated motion, or the residual maps, of a result
    FIT = auto()  # iterations of a running fit
    CHECK = auto()  # the sentence of the last check
    JOINT = auto()  # the selected joint
    GROUP = auto()  # the selected group
    STEP = auto()  # the step whose controls are shown
    VIEW = auto()  # how the robots are drawn
    HIGHLIGHT = auto()  # the instants that are marked
    ACTIVITY = auto()  # what the user waits for has begun or ended
    PROGRESS = auto()  # how much of it is done
    MESSAGE = auto()  # the status line
    SAVED = auto()  # the session
    FOLDER = auto()  # where the session is saved
    TICK = auto()  # a moment has passed
    CLOSED = auto()  # the application ends


class Turn(IntEnum):
    """The order in which subscribers are told of a change.

    Whoever reads a new error in the status line, or sees Stop go out, finds the plots and tables that belong
    to it.
    """

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
        """Tell the subscribers; what one of them changes is told once all have heard of this."""
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
