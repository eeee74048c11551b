"""Neighbouring wrist joints of which one is turned by both motors: τ, or θ and τ, are the motors'."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise, product

import numpy as np

from flexviz.base.arrays import Array
from flexviz.checks.faults import Case, Fault, hypothesis
from flexviz.checks.reading import Reading

WRIST = 3  # last joints, of which neighbours may be coupled


@hypothesis
def couplings(case: Case) -> Iterator[Fault]:
    if case.now.drive is not None:
        return
    names = case.mapping.names
    for pair, turned, ratio, theta_too in product(
        pairwise(case.every[-WRIST:]), (0, 1), (1.0, -1.0), (False, True)
    ):
        drive = np.eye(len(names))
        drive[pair[turned], pair[1 - turned]] = ratio
        values = {
            "coupled": tuple(names[j] for j in pair),
            "matrix": drive[np.ix_(pair, pair)].astype(int).tolist(),
            "signals": "theta and tau" if theta_too else "tau",
        }
        # where τ was converted to the joints already, only friction is the motors'
        for converted in (False, True)[: 1 if theta_too else 2]:

            def coupled(
                now: Reading, drive: Array = drive, too: bool = theta_too, converted: bool = converted
            ) -> Reading:
                return replace(now, drive=drive, theta_too=too, converted=converted)

            name = f"{turned}{ratio}{theta_too}{converted}"
            yield Fault("coupling", pair, "tau", coupled, name, values=values | {"converted": converted})
