"""Decision thresholds of the diagnosis: probabilities, physical sizes, tolerances and limits of effort.

`python -m benchmarks.constants worth` prints what each of them decides: the cases that change where it is
half or twice as large.

The classes have no generated methods: to make those of so many fields takes a hundredth of a second.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, init=False, repr=False, eq=False)
class CriterionThresholds:
    """What counts, and what an effect has to gain."""

    false_alarm: float = 0.05  # probability that anything is found where nothing is missing
    exactness: float = 1e-3  # the same in units of the noise, of what the effects explain
    settled: float = 0.1  # change of J that ends the fit of a model that is tried [nats]
    temperature: float = 3.0  # [nats] by which a gain has to exceed its cost for a confidence of 73 %
    least_doubt: float = 0.01  # odds of an error of any kind
    doubt: float = 0.1  # odds that an effect stands in for an unmodelled torque as large as what it removes


@dataclass(frozen=True, init=False, repr=False, eq=False)
class SearchThresholds:
    """How much is tried."""

    rounds: int = 40  # moves at most
    best: int = 3  # candidates of a joint that are fitted, by their scores
    first_steps: int = 2  # of a trial, by which its starts are compared, or after which it may be given up
    reach: float = 3.0  # times what its score promises, that a candidate may gain
    close: float = 0.8  # of what its score promises, that a rival has to promise to be tried in its place
    again: float = 1.5  # times what it promised, from which a refused candidate is tried again
    intervals: int = 5000  # in which an episode may lie
    longest_episode: float = 0.6  # share of a stretch; a torque that acts longer is not an episode
    unknown_places: int = 2  # joints, by their error, on which an unknown law is tried


@dataclass(frozen=True, init=False, repr=False, eq=False)
class EvidenceThresholds:
    """What is reported."""

    tied_correlation: float = 0.98  # of two signatures
    share: float = 0.05  # of a residual or a motion: less does not count
    apart: float = 1.64  # standard errors by which one place explains more than another
    changing_share: float = 0.25  # half of the change of an effect's size, relative to it


@dataclass(frozen=True, init=False, repr=False, eq=False)
class Thresholds:
    """All decision thresholds of the diagnosis."""

    criterion: CriterionThresholds = CriterionThresholds()
    search: SearchThresholds = SearchThresholds()
    evidence: EvidenceThresholds = EvidenceThresholds()


THRESHOLDS = Thresholds()
