"""The base on a wall, on its side or under a ceiling."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from flexviz.checks.faults import Case, Fault, hypothesis
from flexviz.checks.reading import Reading
from flexviz.data.logs import Proposal
from flexviz.robot.mounting import DIRECTIONS


@hypothesis
def mountings(case: Case) -> Iterator[Fault]:
    for down in DIRECTIONS.values():
        if down == case.now.down:
            continue

        def mounted(now: Reading, down: tuple[float, float, float] = down) -> Reading:
            return replace(now, down=down)

        stated = (Proposal((), "gravity", list(down)),)
        yield Fault("mounting", case.every, "robot", mounted, f"{down}", proposals=stated)
