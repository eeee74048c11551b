"""The ways of getting derivatives that the study compares, and what each one finds."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from benchmarks.paper_study.simulated import study
from benchmarks.paper_study.truth import CLASSES, Row, compare
from flexviz.analysis.identification import Identification, identify

SMALL = 0.5  # errors of parameters smaller than this are judged against it: 2 % of it is the paper's 0.01
TIGHT, GOOD, BAD = 0.01, 0.01, 0.3  # for judging the marks
SETTLED = 1.0  # [s] residuals are compared from here on, where the slowest observer has settled


@dataclass(frozen=True)
class Method:
    """One observer with one bandwidth [rad/s] (None: its own choice)."""

    label: str
    observer: str
    bandwidth: float | None = None
    refine: bool = False


CAUSAL = tuple(Method(f"causal ESO, w = {w}", "eso", float(w)) for w in (20, 30, 50, 100, 200, 370))
EQUAL = tuple(Method(f"equal-delay ESO, w = {w}", "eso-equal-delay", float(w)) for w in (30, 40, 50, 70))
ZERO = Method("zero phase", "butterworth-zero-phase")
REFINED = Method("--refine", "butterworth-zero-phase", refine=True)
METHODS = (*CAUSAL, *EQUAL, ZERO, REFINED)
PAPER, EQUAL_50 = CAUSAL[0], EQUAL[2]


@dataclass(frozen=True)
class Outcome:
    """What one method found in one group.

    Attributes:
        letter, start, method: which.
        rows: every parameter with its truth.
        condition: scaled condition number.
        rms, rms_validation: root mean square of the equation's residual over joints and time from `SETTLED`
        on
            [Nm], of the fitted groups and of the group that was held out.
        bandwidth: [rad/s].
        converged: whether the solver did.
        seconds: wall time.
    """

    letter: str
    start: str
    method: Method
    rows: tuple[Row, ...]
    condition: float
    rms: float
    rms_validation: float
    bandwidth: float
    converged: bool
    seconds: float

    def of(self, kind: str) -> list[Row]:
        """The parameters of one class."""
        return [row for row in self.rows if row.kind == kind]

    def worst(self, kinds: Iterable[str] = CLASSES) -> float:
        """Largest error in these classes, relative to the truth or to `SMALL`, whichever is larger."""
        return max(scaled_error(row) for kind in kinds for row in self.of(kind))

    @property
    def worst_score(self) -> float:
        """Largest error in standard errors."""
        return max(abs(row.score) for row in self.rows)

    @property
    def covered(self) -> int:
        """How many 95 % intervals hold the truth."""
        return sum(row.covered for row in self.rows)

    def marks(self) -> str:
        """How many parameters are marked yes, weak and no: "14/2/0"."""
        given = [row.identifiable for row in self.rows]
        return "/".join(str(given.count(mark)) for mark in ("yes", "weak", "no"))

    def too_pessimistic(self) -> list[str]:
        """Parameters called "no" although within 1 % and with an interval as tight."""
        return [row.label for row in self.rows if row.identifiable == "no" and is_known(row)]

    def too_optimistic(self) -> list[str]:
        """Parameters called "yes" although more than 30 % off."""
        return [row.label for row in self.rows if row.identifiable == "yes" and is_wrong(row)]


def scaled_error(row: Row) -> float:
    """|error| relative to the truth, or to `SMALL` where the truth is smaller."""
    return abs(row.error) / max(abs(row.truth), SMALL)


def is_known(row: Row) -> bool:
    """Within 1 % and standard error within 1 %."""
    return scaled_error(row) <= GOOD and row.std <= TIGHT * max(abs(row.truth), SMALL)


def is_wrong(row: Row) -> bool:
    """More than 30 % (and more than 0.01) off."""
    return not row.within(BAD, 0.01)


def run(letter: str, start: str, method: Method, seed: int = 0) -> Outcome:
    """Identify one group with one method."""
    s = study(letter, start)
    result = identify(
        s.noisy(seed), observer=method.observer, bandwidth=method.bandwidth, refine=method.refine
    )
    return Outcome(
        letter,
        start,
        method,
        tuple(compare(result, s.plan.model)),
        result.condition_number,
        _rms(result, result.groups),
        _rms(result, result.validation_groups),
        float(np.max(result.bandwidth)),
        result.converged,
        result.seconds,
    )


def _rms(result: Identification, groups: Iterable[str]) -> float:
    series = [result.residuals[name] for name in groups]
    rows = np.concatenate([s.residual[s.time >= SETTLED] for s in series])
    return float(np.sqrt(np.mean(rows**2)))
