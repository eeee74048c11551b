"""Designed experiments, shown by simulation: `python -m benchmarks.design_study COMMAND [--write]`.

    spread    designed groups against the paper's group B: predicted and realised errors
    ties      effects that a poor record cannot tell apart, with one designed group beside it

`--write` renews that part of docs/designing.md.
"""

from __future__ import annotations

import argparse
import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads would only wait for each other

from benchmarks.design_study import document, spread, ties


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.design_study",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("command", choices=("spread", "ties"))
    parser.add_argument("--seeds", type=int, default=50, help="noise seeds of each fit (default: 50)")
    parser.add_argument("--evaluations", type=int, default=600, help="of the search, per group and pass")
    parser.add_argument("--write", action="store_true", help="renew docs/designing.md")
    given = parser.parse_args()
    if given.command == "spread":
        _, rows = spread.run(given.seeds, given.evaluations)
        print(spread.table(rows))
        if given.write:
            document.write_spread(rows, given.seeds)
        return 0 if spread.as_predicted(rows, given.seeds) else 1
    found = []
    for outcome in ties.outcomes():
        found.append(outcome)
        print(outcome, flush=True)
    print(ties.table(found))
    if given.write:
        document.write_ties(found)
    return 0 if all(one.broken for one in found) else 1


if __name__ == "__main__":
    sys.exit(main())
