"""Numbers of the study: shares, errors, calibration, smallest sizes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from benchmarks.diagnosis_study.answers import Json
from benchmarks.diagnosis_study.judging import Judged, Stated
from benchmarks.diagnosis_study.sizes import SIZES
from flexviz.effects import EFFECTS

FOUND = 0.9  # share found that makes a size "found"
SURE = 0.9  # stated confidence
ABOUT = (0.85, 0.95)  # stated about at 90 %: so many of them should be right
BINS = (0.0, 0.5, 0.7, 0.8, 0.85, 0.9, 0.95, 0.98, 1.0)
# effects whose size is a torque: also given relative to the joint's rms torque
TORQUES = {name for name, size in SIZES.items() if EFFECTS[name].units[size.parameter] == "Nm"}
ARMS = ("panda", "ur5")


@dataclass(frozen=True)
class Share:
    """So many of so many."""

    hits: int
    count: int

    @property
    def value(self) -> float:
        return self.hits / self.count if self.count else float("nan")

    @property
    def text(self) -> str:
        """`48/49 (97.9 %)`, rounded down, so that a limit that is missed does not look reached."""
        if not self.count:
            return "–"
        tenths = 1000 * self.hits // self.count
        return f"{self.hits}/{self.count} ({tenths // 10}.{tenths % 10} %)"


@dataclass(frozen=True)
class Smallest:
    """From which size on an effect is found, at one noise.

    Attributes:
        size: smallest size with nine in ten found at it and above [the parameter's unit]; None: not found so.
        relative: that in natural units or, for torques, in rms torques of the joint.
        count: cases looked at.
    """

    size: float | None
    relative: float | None
    count: int


def share(cases: Iterable[Judged], hit: Callable[[Judged], bool]) -> Share:
    """How many of the cases are hits."""
    answers = [hit(case) for case in cases]
    return Share(sum(answers), len(answers))


def singles(cases: Iterable[Judged], robots: Sequence[str], kind: str = "single") -> list[Judged]:
    """Decidable cases with one hidden effect; those of kind "limit" lie around the detection limit."""
    return [c for c in cases if c.kind == kind and c.robot in robots and c.decidable]


def quantile(values: Sequence[float], q: float) -> float:
    """NaN of nothing."""
    return float(np.quantile(values, q)) if len(values) else float("nan")


def parameter_errors(cases: Iterable[Judged], backlash: bool, knowing: bool = False) -> list[float]:
    """Errors of the hidden effects' parameters in the cases that were named right, [-]."""
    out = []
    for case in cases:
        for name, error in (case.knowing_errors if knowing else case.parameter_errors).items():
            if case.first_right and name.startswith("backlash.") == backlash:
                out.append(error)
    return out


def calibration(stated: Sequence[Stated]) -> list[tuple[float, float, float, Share]]:
    """(from, to, mean stated confidence, how many were right) of every bin of stated confidence."""
    rows = []
    for low, high in pairwise(BINS):
        inside = [s for s in stated if low <= s.confidence < high or (high == 1.0 and s.confidence == 1.0)]
        mean = float(np.mean([s.confidence for s in inside])) if inside else float("nan")
        rows.append((low, high, mean, Share(sum(s.right for s in inside), len(inside))))
    return rows


def sure(stated: Iterable[Stated]) -> Share:
    """How many of the findings stated at 90 % or more are right."""
    answers = [s.right for s in stated if s.confidence >= SURE]
    return Share(sum(answers), len(answers))


def about(stated: Iterable[Stated]) -> Share:
    """How many of the findings stated at about 90 % are right."""
    answers = [s.right for s in stated if ABOUT[0] <= s.confidence < ABOUT[1]]
    return Share(sum(answers), len(answers))


def relative_size(true: Json, torque_rms: float | None) -> float:
    """Size in rms torques of the joint where it is a torque, else in natural units."""
    if true["effect"] in TORQUES and torque_rms:
        return true["size"] / torque_rms
    return true["size"] / true["natural"]


def smallest(cases: Sequence[tuple[float, float, bool]]) -> Smallest:
    """Of (relative size, size, found): the smallest relative size from which on nine in ten are found."""
    ordered = sorted(cases, reverse=True)
    best: tuple[float, float] | None = None
    found = 0
    for k, (relative, size, hit) in enumerate(ordered, 1):
        found += hit
        if hit and found >= FOUND * k:
            best = relative, size
    if best is None:
        return Smallest(None, None, len(ordered))
    return Smallest(best[1], best[0], len(ordered))


def limit(pairs: Sequence[tuple[float, float]], decidable: float) -> float:
    """Size at which a fit that knows the truth would gain `decidable`; median over (size, gain)."""
    values = [size * np.sqrt(decidable / gain) for size, gain in pairs if gain > 0]
    return quantile(values, 0.5)
