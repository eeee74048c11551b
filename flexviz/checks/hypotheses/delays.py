"""τ of a joint stamped later than those of others, as where the drives are polled in turn.

A delay that all joints have in common is one of the whole robot: the flexible model finds it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from flexviz.checks.faults import Case, Fault, hypothesis
from flexviz.checks.reading import Reading

LATE = (2e-3, 4e-3, 8e-3, 12e-3, 16e-3, 24e-3, 32e-3)  # [s] that are tried


@hypothesis
def delays(case: Case) -> Iterator[Fault]:
    if np.count_nonzero(case.now.late == 0.0) < 2:
        return
    for j in case.every:
        late = max(LATE, key=lambda late: case.comparison.score(_late(case, case.now, j, late)))

        def moved(now: Reading, j: int = j, late: float = late) -> Reading:
            return _late(case, now, j, late)

        yield Fault("delay", (j,), "tau", moved, values={"delay": late})


def _late(case: Case, now: Reading, j: int, late: float) -> Reading:
    return replace(now, late=now.late + case.at((j,), late, 0.0))
