"""`flexviz diagnose --apply`, which is told of no friction but viscous."""

from __future__ import annotations

from typing import Any

from benchmarks.peers.flexviz_answer import answered, counted
from benchmarks.peers.problem import Problem
from flexviz import diagnose, read_set


def estimate(problem: Problem) -> dict[str, Any]:
    """The user's part is one line, or `flexviz diagnose SET --apply`."""
    with counted() as count:
        result = diagnose(read_set(problem.folder), apply=True)
    return answered(result, count)
