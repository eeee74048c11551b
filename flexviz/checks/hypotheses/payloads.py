"""Payloads of groups: those of two exchanged, or one that was carried and not stated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from flexviz.checks.faults import Case, Fault, hypothesis
from flexviz.checks.reading import Reading
from flexviz.robot.robot import PayloadBody

LEAST, LARGEST, TRIED = 0.02, 1.0, 8  # masses that are tried, in units of the robot's own
HALVINGS = 3  # of the ratio of two of them


@hypothesis
def exchanged(case: Case) -> Iterator[Fault]:
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
        yield Fault("payload", case.every, "payloads", carried, f"{one},{other}", values=values)


@hypothesis
def forgotten(case: Case) -> Iterator[Fault]:
    """A mass at the last link of one group that is not stated: the size that explains most.

    One that all groups carry is like another mass of the link itself, and is identified with it.
    """
    if not case.payloads_known or np.count_nonzero(case.now.added == 0.0) < 2:
        return
    for g, name in enumerate(case.comparison.names):
        mass = _likely_mass(case, g)

        def carried(now: Reading, mass: float = mass, g: int = g) -> Reading:
            return _carrying(now, mass, g)

        values = {"groups": (name,), "mass": mass}
        yield Fault("payload", case.every, "payloads", carried, name, values=values, groups=(g,))


def _likely_mass(case: Case, group: int) -> float:
    """The mass that explains the torques of a group best [kg]."""

    def score(mass: float) -> float:
        return case.comparison.score(_carrying(case.now, mass, group))

    least = float(np.sum(case.comparison.robot.cad_parameters[:, 0])) * LEAST
    ratio = (LARGEST / LEAST) ** (1 / (TRIED - 1))
    scored = {mass: score(mass) for mass in (least * ratio**k for k in range(TRIED))}
    for _ in range(HALVINGS):
        ratio, best = np.sqrt(ratio), max(scored, key=scored.__getitem__)
        scored |= {mass: score(mass) for mass in (best * ratio, best / ratio)}
    return float(max(scored, key=scored.__getitem__))


def _carrying(now: Reading, mass: float, group: int) -> Reading:
    """A group with a mass more."""
    return replace(now, added=now.added + mass * (np.arange(len(now.added)) == group))
