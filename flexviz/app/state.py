"""Records of the store."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from flexviz.jobs import Task
from flexviz.scene import LAYOUTS, RobotShape
from flexviz.session import Session

if TYPE_CHECKING:
    from flexviz.diagnosis import ResidualMap
    from flexviz.identification import Identification
    from flexviz.measurements import MeasurementSet
    from flexviz.progress import Iteration
    from flexviz.simulation import Run

Tone = Literal["", "busy", "bad"]


@dataclass(frozen=True, eq=False)
class Opened:
    """A measurement set, ready to be shown.

    Attributes:
        truth: true values of a simulated set, shown only on request.
        session, folder: a saved session and its folder; None for a set.
    """

    measurements: MeasurementSet
    shape: RobotShape
    truth: dict[tuple[str, str | None], float] | None
    session: Session | None = None
    folder: Path | None = None


@dataclass(frozen=True)
class Message:
    """The status line."""

    text: str = ""
    tone: Tone = ""


@dataclass(frozen=True)
class Activity:
    """The task that the user waits for.

    Attributes:
        share: done, 0 … 1; 1 if unknown.
    """

    task: Task[Any]
    share: float


@dataclass(eq=False)
class FitProgress:
    """The latest fit: its effects beside the set's own, and its iterations so far.

    Attributes:
        single: whether it leads to one result.
    """

    effects: tuple[str, ...] = ()
    single: bool = True
    iterations: list[Iteration] = field(default_factory=list)


@dataclass(frozen=True)
class ViewSettings:
    """How the robots are drawn.

    Attributes:
        deflection: factor of the deflection; None: chosen to suit the motion.
        error: factor of simulated − measured.
        link_side: compare link sides instead of motor sides.
        torque: draw arrows for the measured torque.
    """

    layout: str = LAYOUTS[0]
    deflection: float | None = None
    error: float = 1.0
    link_side: bool = False
    torque: bool = False


@dataclass(frozen=True, eq=False)
class Highlight:
    """Instants (M,) [s] of the selected group, and whether each is marked (M,)."""

    time: np.ndarray
    marked: np.ndarray


@dataclass(eq=False)
class Derived:
    """Idle work on one result.

    Attributes:
        replays: group -> simulated model.
        maps: residual maps.
        failed: groups, or "maps", that could not be computed.
    """

    result: Identification | None
    replays: dict[str, Run] = field(default_factory=dict)
    maps: tuple[ResidualMap, ...] = ()
    failed: set[str] = field(default_factory=set)
