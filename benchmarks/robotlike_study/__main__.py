"""Robots with many hidden effects at once: `python -m benchmarks.robotlike_study COMMAND --work DIR`.

    make     simulate the sets that are not in DIR yet: DIR/cases, and what is hidden in them: DIR/truth
    run      diagnose those without a result, each in a process of its own: DIR/results
    report   print what was found, at which cost, and how far the stated confidences hold

Each can be interrupted and goes on where it was.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads would only wait for each other

from benchmarks.diagnosis_study.running import say
from benchmarks.robotlike_study.cases import DURATION, SHARES, cases, parse_shares


def main(arguments: list[str] | None = None) -> int:
    options = parser().parse_args(arguments)
    try:
        if options.command == "make":
            from benchmarks.robotlike_study.running import make_all

            chosen = cases(options.seed, options.count, options.shares, options.duration)
            return make_all(options.work, [c for c in chosen if options.only in c.name], options.jobs)
    except KeyboardInterrupt:
        say("interrupted; what is done is kept")
        return 130
    return 0


def parser() -> argparse.ArgumentParser:
    """The command line."""
    out = argparse.ArgumentParser(
        prog="python -m benchmarks.robotlike_study",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = out.add_subparsers(dest="command", required=True)
    make = commands.add_parser("make", help="simulate the sets")
    make.add_argument("--seed", type=int, default=1)
    make.add_argument("--count", type=int, default=60)
    make.add_argument("--shares", type=parse_shares, default=dict(SHARES), metavar="A:B:C",
                      help=f"parts of {', '.join(SHARES)}, 2:1:1 by default")  # fmt: skip
    make.add_argument("--duration", type=float, default=DURATION, help="of each group [s]")
    for command in (make,):
        command.add_argument(
            "--work", type=Path, required=True, help="folder of the sets, truths and results"
        )
        command.add_argument("--only", default="", metavar="TEXT", help="cases with TEXT in their names")
        command.add_argument("--jobs", type=int, default=2)
    return out


if __name__ == "__main__":
    sys.exit(main())
