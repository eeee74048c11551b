"""Payloads of groups: those of two exchanged, or one that was carried and not stated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

from flexviz.checks.moves import Case, Move, hypothesis
from flexviz.checks.reading import Reading
from flexviz.robot import PayloadBody


@hypothesis
def exchanged(case: Case) -> Iterator[Move]:
    if not case.payloads_known:
        return
    stated, names, seen = case.now.bodies, case.comparison.names, set()
    for one, other in combinations(range(len(stated)), 2):
        if stated[one] == stated[other]:
            continue
        mixed = list(stated)
        mixed[one], mixed[other] = stated[other], stated[one]
        if tuple(mixed) in seen:
            continue
        seen.add(tuple(mixed))

        def carried(now: Reading, bodies: tuple[tuple[PayloadBody, ...], ...] = tuple(mixed)) -> Reading:
            return replace(now, bodies=bodies)

        values = {"groups": (names[one], names[other])}
        yield Move("payload", case.every, "payloads", carried, f"{one},{other}", values=values)
