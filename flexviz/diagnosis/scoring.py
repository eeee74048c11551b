"""Scores of many candidates, each joint's on any core."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

from flexviz.effects import ChosenEffect
from flexviz.equation import Chain, OperatingPoint
from flexviz.estimation import Projection, ScoredCandidate, Weigh, best_intervals, score
from flexviz.parallel import shared

MOST_SENT = 3e7  # numbers; to send more between processes takes longer than what the other cores save


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
    signatures: bool = True,
    joints: Sequence[int | None] | None = None,
) -> list[ScoredCandidate]:
    """Scores of candidates and of the best episodes, the best first.

    Args:
        point, chain, wanted, weigh, projection: as for `score`.
        check: called before each joint; may raise to stop.
        longest: maximum length of an episode relative to its stretch; None: no episodes.
        without: episodes that are not wanted.
        signatures: whether the scores keep their signatures.
        joints: whose candidates are scored; None among them: those without a joint. Default: all.
    """

    def of_joint(joint: int | None) -> list[ScoredCandidate]:
        check()
        found = score(point, chain, [e for e in wanted if e.joint == joint], weigh, projection)
        if longest is not None and joint is not None:
            intervals = best_intervals(point, joint, weigh, projection, longest=longest)
            found += [s for s in intervals if s.effect not in without]
        return found if signatures else [s.without_signature() for s in found]

    each = [*range(point.layout.n), None] if joints is None else joints
    few = not signatures or projection.residual.size * len(wanted) < MOST_SENT
    parts = shared(of_joint, each) if few else map(of_joint, each)
    return sorted((s for part in parts for s in part), key=lambda s: -s.gain)
