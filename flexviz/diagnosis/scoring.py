"""Scores of many candidates, each joint's on any core."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

from flexviz.effects import ChosenEffect
from flexviz.equation import Chain, OperatingPoint
from flexviz.estimation import Projection, ScoredCandidate, Weigh, best_intervals, score
from flexviz.parallel import shared


def score_by_joint(
    point: OperatingPoint,
    chain: Chain,
    wanted: Sequence[ChosenEffect],
    weigh: Weigh,
    projection: Projection,
    *,
    check: Callable[[], None],
    longest: float | None,
    without: Collection[ChosenEffect] = (),
) -> list[ScoredCandidate]:
    """Scores of candidates and of the best episodes, the best first.

    Args:
        point, chain, wanted, weigh, projection: as for `score`.
        check: called before each joint; may raise to stop.
        longest: maximum length of an episode relative to its stretch; None: no episodes.
        without: episodes that are not wanted.
    """

    def of_joint(joint: int | None) -> list[ScoredCandidate]:
        check()
        found = score(point, chain, [e for e in wanted if e.joint == joint], weigh, projection)
        if longest is not None and joint is not None:
            intervals = best_intervals(point, joint, weigh, projection, longest=longest)
            found += [s for s in intervals if s.effect not in without]
        return found

    parts = shared(of_joint, [*range(point.layout.n), None])
    return sorted((s for part in parts for s in part), key=lambda s: -s.gain)
