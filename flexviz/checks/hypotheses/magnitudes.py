"""τ without its sign, as some drives log a current: of all joints, where none is ever negative."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from flexviz.checks.faults import Case, Fault, hypothesis


@hypothesis
def magnitudes(case: Case) -> Iterator[Fault]:
    if case.comparison.one_sided.all():
        yield Fault("magnitude", case.every, "tau", lambda now: replace(now, magnitude=True))
