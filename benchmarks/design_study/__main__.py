"""Designed experiments, shown by simulation: `python -m benchmarks.design_study COMMAND [--write]`.

    spread    designed groups against the paper's group B: predicted and realised errors
    ties      effects that a poor record cannot tell apart, with one designed group beside it

`--write` renews that part of benchmarks/results/designing.md.
"""

from __future__ import annotations

import sys
from typing import Annotated, Literal

from benchmarks.command import command
from benchmarks.design_study import document, spread, ties


@command
def main(
    what: Literal["spread", "ties"],
    *,
    seeds: Annotated[int, "noise seeds of each fit"] = 50,
    evaluations: Annotated[int, "of the search, per group and pass"] = 600,
    write: Annotated[bool, "renew benchmarks/results/designing.md"] = False,
) -> int:
    if what == "spread":
        _, rows = spread.run(seeds, evaluations)
        print(spread.table(rows))
        if write:
            document.write_spread(rows, seeds)
        return 0 if spread.as_predicted(rows, seeds) else 1
    found = []
    for outcome in ties.outcomes():
        found.append(outcome)
        print(outcome, flush=True)
    print(ties.table(found))
    if write:
        document.write_ties(found)
    return 0 if all(one.broken for one in found) else 1


if __name__ == "__main__":
    sys.exit(main())
