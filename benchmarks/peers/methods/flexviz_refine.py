"""`flexviz identify --refine`."""

from __future__ import annotations

from typing import Any

from benchmarks.peers.flexviz_answer import answered, counted
from benchmarks.peers.problem import Problem
from flexviz import identify, read_set


def estimate(problem: Problem) -> dict[str, Any]:
    """The user's part is one line, or `flexviz identify SET --effect NAME --refine`."""
    with counted() as count:
        result = identify(read_set(problem.folder), effects=problem.effects, refine=True)
    return answered(result, count)
