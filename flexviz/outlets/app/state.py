"""What the store holds, and the signal with which it tells of changes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Flag, IntEnum, auto
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from flexviz.analysis.diagnosis import BestModel, PredictionErrors
from flexviz.analysis.identification import Identification, ObservedResidual
from flexviz.analysis.laws import LawThroughData
from flexviz.base.iteration import Iteration
from flexviz.base.jobs import Task
from flexviz.base.progress import Progress
from flexviz.content.records import ResidualMap
from flexviz.content.scene import LAYOUTS, VIEWS, RobotMotion, RobotShape, measured_motion, with_replay
from flexviz.content.session import HISTORY, Session
from flexviz.data.measurements import Group, MeasurementSet
from flexviz.model.observers import EsoGains
from flexviz.model.simulation import Run

DOUBLE_CLICK = 1.0  # [s] within which a second press is not meant
KEPT_RESULTS = 8  # with simulated motions and maps
Tone = Literal["", "busy", "warn", "bad"]


@dataclass(frozen=True, eq=False)
class Opened:
    """A measurement set, ready to be shown."""

    measurements: MeasurementSet
    shape: RobotShape
    truth: dict[tuple[str, str | None], float] | None  # of a simulated set, shown only on request
    session: Session | None = None  # a saved one and its folder; None for a set
    folder: Path | None = None
    judged: tuple[PredictionErrors, ...] = ()  # of its fit, see `Derived.judge`; empty if unknown


@dataclass(frozen=True)
class Message:
    """The status line."""

    text: str = ""
    tone: Tone = ""


@dataclass(eq=False)
class Activity:
    """The task that the user waits for."""

    task: Task[Any]
    share: float  # done, 0 … 1; 1 if unknown
    stopped: float | None = None  # when it was asked to stop [s, monotonic]

    def stop(self) -> float | None:
        """How long it may take to stop [s]: at first as long as it wants; None for a double click."""
        now, asked = time.monotonic(), self.stopped
        if asked is None:
            self.stopped = now
            return math.inf
        return 0.0 if now - asked > DOUBLE_CLICK else None


@dataclass(eq=False)
class FitProgress:
    """The latest fit: its effects in addition to the set's own, and its iterations so far."""

    effects: tuple[str, ...] = ()
    single: bool = True  # whether it leads to one result
    iterations: list[Iteration] = field(default_factory=list)


@dataclass(frozen=True)
class SearchNews(Progress):
    """News of a search, with the law of its leading effect through its data."""

    law: LawThroughData | None = None


@dataclass(frozen=True, eq=False)
class SearchSoFar:
    """What a search for the missing effect has told that runs or was stopped.

    Attributes:
        first, best: the model before it, and the best one so far.
        alone: effect → share of its joint's error that it alone would remove.
        law: the leading effect's law through its data.
    """

    first: BestModel | None = None
    best: BestModel | None = None
    alone: Mapping[str, float] = field(default_factory=dict)
    law: LawThroughData | None = None

    def updated(self, news: Progress) -> SearchSoFar:
        """With news; the same object if nothing is new."""
        best = news.so_far if isinstance(news.so_far, BestModel) else None
        law = news.law if isinstance(news, SearchNews) else None
        if best is None:
            return self
        known = self.best is not None and best.stopped == self.best.stopped
        if known and len(news.alone) == len(self.alone):
            return self
        return SearchSoFar(self.first or best, best, news.alone, law)


@dataclass(frozen=True)
class ViewSettings:
    """How the robots are drawn."""

    layout: str = LAYOUTS[0]
    deflection: float | None = None  # its factor; None until there is one to draw
    error: float = 1.0  # factor of simulated − measured
    link_side: bool = False  # compare link sides instead of motor sides
    arcs: bool = True  # draw torque and deflection around the joints
    shadows: bool = True
    zoomed: bool = False  # residuals over time on an axis of their own, not on the first model's
    beside: int | None = None  # model of the staircase that is compared with the shown one
    camera: tuple[str, int] = (VIEWS[0], 0)  # one of VIEWS, and how often it was asked for


@dataclass(frozen=True, eq=False)
class Highlight:
    """Instants (M,) [s] of the selected group, and whether each is marked (M,)."""

    time: np.ndarray
    marked: np.ndarray


@dataclass(frozen=True, eq=False)
class LiveTuning:
    """The residual of the identified model while the observer is tuned."""

    group: str
    found: ObservedResidual  # of a stretch of the group
    draft: EsoGains | None  # gains that are not used yet; None: with the observer as set


@dataclass(eq=False)
class Derived:
    """Idle work on one result."""

    result: Identification | None
    replays: dict[str, Run] = field(default_factory=dict)  # group -> simulated model
    maps: tuple[ResidualMap, ...] = ()
    laws: tuple[LawThroughData, ...] | None = None  # of the model's effects
    errors: PredictionErrors | None = None
    stage_errors: list[PredictionErrors] = field(default_factory=list)  # at the start, after each stage
    failed: set[str] = field(default_factory=set)  # groups, or fields above, that could not be computed

    def judge(self, errors: Sequence[PredictionErrors]) -> None:
        """Keep the errors of the model, at its start, and after each stage."""
        self.errors, *self.stage_errors = errors

    def motion(self, measurements: MeasurementSet, group: Group) -> RobotMotion:
        """The measured motion of a group and, once it is simulated, that of the model."""
        return _motion(measurements, group, self.result, self.replays.get(group.name))


@lru_cache(maxsize=2)  # the shown model, and the one that is compared with it
def _motion(
    measurements: MeasurementSet, group: Group, result: Identification | None, run: Run | None
) -> RobotMotion:
    motion = measured_motion(measurements, group, result)
    return motion if run is None else with_replay(motion, run)


class DerivedResults:
    """Idle work on the latest results, so that undo shows it immediately."""

    def __init__(self) -> None:
        self._kept = [Derived(None)]  # the current result is the last

    def __iter__(self) -> Iterator[Derived]:
        return iter(self._kept)

    def of(self, result: Identification | None) -> Derived | None:
        """What is kept of a result."""
        return next((derived for derived in self._kept if derived.result is result), None)

    def keep(self, result: Identification | None, current: bool = False) -> Derived:
        """What is kept of a result, from now on if it was not; `current`: as that of the current result."""
        found = self.of(result)
        if found is None:
            found = Derived(result)
            self._kept.insert(-1, found)
        if current and self._kept[-1] is not found:
            self._kept = [*(one for one in self._kept if one is not found), found]
        for old in self._kept[:-KEPT_RESULTS]:  # only the errors stay, for the rows of the staircase
            old.replays, old.maps, old.laws = {}, (), None
        self._kept = self._kept[-HISTORY:]
        return found


class Changed(Flag):
    """What has changed in the store."""

    OPENED = auto()  # another measurement set or session
    ANALYSIS = auto()  # anything in the analysis; details in the next three
    OBSERVER = auto()  # the observer or its bandwidth
    RESULT = auto()  # the identification
    DIAGNOSIS = auto()  # the diagnosis, or the earlier models
    NEW_STATE = auto()  # a new state of the session
    HISTORY = auto()  # undo or redo
    DERIVED = auto()  # simulated motion, residual maps or errors of a result
    FIT = auto()  # iterations of a running fit
    CHECK = auto()  # the sentence of the last check
    JOINT = auto()  # the selected joint
    GROUP = auto()  # the selected group
    SPAN = auto()  # the time span that is played and drawn
    STEP = auto()  # the step whose controls are shown
    VIEW = auto()  # how the robots are drawn
    HIGHLIGHT = auto()  # the highlighted instants
    LIVE = auto()  # the residual with the observer that is being tuned
    ACTIVITY = auto()  # a task that the user waits for has started or ended
    PROGRESS = auto()  # the progress of that task
    SEARCH = auto()  # what a search for the missing effect tells
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


class ChangeSignal:
    """Tells subscribers what has changed."""

    def __init__(self) -> None:
        self._subscribers: list[tuple[Turn, int, Callable[[], None]]] = []  # plain numbers: flags take long
        self._untold = Changed(0)
        self._telling = False

    def subscribe(self, changes: Changed, act: Callable[[], None], turn: Turn = Turn.PLOTS) -> None:
        """Call `act` after any of these changes, turn by turn and then in the order of subscription."""
        self._subscribers.append((turn, changes.value, act))
        self._subscribers.sort(key=lambda subscriber: subscriber[0])

    def tell(self, change: Changed) -> None:
        """Notify the subscribers; changes they make are notified after all have been called."""
        self._untold |= change
        if self._telling:
            return
        self._telling = True
        try:
            while change := self._untold:
                told, self._untold = change.value, Changed(0)
                for _, changes, act in self._subscribers:
                    if changes & told:
                        act()
        finally:
            self._telling, self._untold = False, Changed(0)
