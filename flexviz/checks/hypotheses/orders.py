"""Columns of several joints exchanged: τ alone, or with θ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, permutations

import numpy as np

from flexviz.checks.faults import Case, Fault, hypothesis
from flexviz.checks.reading import Reading
from flexviz.checks.thresholds import LIMITS

Order = tuple[int, ...]
SMALL_ARM = 4  # joints, of which every order is tried
ARM = 7  # joints, of which all pairs and triples are tried


@hypothesis
def orders(case: Case) -> Iterator[Fault]:
    """Every order of few joints; of more ones the usual ones.

    These are exchanged pairs, three in a circle, all shifted by some, reversed, and in alphabetical order, as
    joint states often come. Of more joints than an arm has, only those that the masses explain badly are
    exchanged: the triples of a humanoid's 29 joints alone are 7,308 orders.
    """
    names = case.mapping.names
    for order in sorted(_tried(case) - {case.every}):
        changed = tuple(j for j in case.every if order[j] != j)

        def of_tau(now: Reading, order: Order = order) -> Reading:
            return replace(now, tau_order=tuple(now.tau_order[k] for k in order))

        def of_both(now: Reading, order: Order = order) -> Reading:
            theta = tuple(now.theta_order[k] for k in order)
            return replace(now, theta_order=theta, tau_order=tuple(now.tau_order[k] for k in order))

        name, values = ",".join(map(str, order)), {"order": tuple(names[k] for k in order)}
        yield Fault("order", changed, "tau", of_tau, name, values=values)
        yield Fault("order", changed, "theta and tau", of_both, name, values=values)


def _tried(case: Case) -> set[Order]:
    n, same = len(case.every), case.every
    if n <= SMALL_ARM:
        return set(permutations(same))
    suspects, whole, tried = same, True, set[Order]()
    if n > ARM:
        poor = np.array([fit.share < LIMITS.explained for fit in case.comparison.fits(case.now)])
        suspects, whole = tuple(np.flatnonzero(poor).tolist()), 2 * np.count_nonzero(poor) > n
    if whole:
        tried |= {same[k:] + same[:k] for k in range(1, n)} | {same[::-1]}
        alphabetical = tuple(int(i) for i in np.argsort(case.mapping.names))
        tried |= {alphabetical, tuple(int(i) for i in np.argsort(alphabetical))}
    for pair in combinations(suspects, 2):
        tried.add(moved(same, pair))
    for triple in combinations(suspects, 3):
        tried |= {moved(same, triple), moved(same, triple[::-1])}
    return tried


def moved(order: Order, places: Sequence[int]) -> Order:
    """The order with these places moved round."""
    result = list(order)
    for here, there in zip(places, (*places[1:], places[0]), strict=True):
        result[here] = order[there]
    return tuple(result)
