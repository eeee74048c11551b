"""Robots with many hidden effects at once: `python -m benchmarks.robotlike_study COMMAND --work DIR`.

    make     simulate the sets that are not in DIR yet: DIR/cases, and what is hidden in them: DIR/truth
    run      diagnose those without a result, each in a process of its own: DIR/results
    report   print what was found, at which cost, and how far the stated confidences hold
    oracle   compare the held-out error of each diagnosis with that of a fit that is given the hidden effects

Each can be interrupted and goes on where it was.
"""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads would only wait for each other

from benchmarks.kept_results import say
from benchmarks.robotlike_study.cases import DURATION, SHARES, cases, parse_shares
from benchmarks.robotlike_study.effects import DRAWS
from benchmarks.robotlike_study.oracle import compare_all
from benchmarks.robotlike_study.report import report as text
from benchmarks.robotlike_study.report import scored_cases
from benchmarks.robotlike_study.running import COMMAND, LONGEST, DiagnosisRunner, made_cases, make_all


def main(arguments: list[str] | None = None) -> int:
    options = parser().parse_args(arguments)
    try:
        return options.act(options)
    except KeyboardInterrupt:
        say("interrupted; what is done is kept")
        return 130


def make(options: argparse.Namespace) -> int:
    """Simulate what is not there yet."""
    chosen = cases(options.seed, options.count, options.shares, options.duration, tuple(options.also))
    return make_all(options.work, [c for c in chosen if options.only in c.name], options.jobs)


def run(options: argparse.Namespace) -> int:
    """Diagnose what has no result."""
    command = tuple(shlex.split(options.command)) if options.command else COMMAND
    runner = DiagnosisRunner(options.work, options.label, options.timeout, command)
    runner.run(made_cases(options.work, options.only), options.jobs, options.retry)
    return 0


def report(options: argparse.Namespace) -> int:
    """Print the report; 1 if a case has no answer."""
    planned = made_cases(options.work, options.only)
    found = scored_cases(options.work, options.label, options.only)
    print(text(found, len(planned)))
    return int(len(found) < len(planned) or any(case.error is not None for case in found))


def oracle(options: argparse.Namespace) -> int:
    """Print each set's held-out error, and that of a fit that is given the hidden effects."""
    for compared in compare_all(options.work, options.only):
        print(compared.text(), flush=True)
    return 0


def parser() -> argparse.ArgumentParser:
    """The command line."""
    out = argparse.ArgumentParser(
        prog="python -m benchmarks.robotlike_study",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = out.add_subparsers(required=True)
    made = commands.add_parser("make", help="simulate the sets")
    made.set_defaults(act=make)
    made.add_argument("--seed", type=int, default=1)
    made.add_argument("--count", type=int, default=60)
    names = ", ".join(SHARES)
    made.add_argument("--shares", type=parse_shares, default=dict(SHARES), metavar="A:B:C",
                      help=f"parts of {names}; 2:1:1 by default")  # fmt: skip
    made.add_argument("--duration", type=float, default=DURATION, help="of each group [s]")
    made.add_argument("--also", action="append", default=[], choices=DRAWS, metavar="EFFECT",
                      help="hide this effect, too, on one joint of each robot")  # fmt: skip
    ran = commands.add_parser("run", help="diagnose the sets")
    ran.set_defaults(act=run)
    ran.add_argument("--timeout", type=float, default=LONGEST, metavar="S", help="for one set [s]")
    ran.add_argument("--retry", action="store_true", help="also those that gave no answer")
    ran.add_argument("--command", default="", help="the command flexviz; by default that of this Python")
    told = commands.add_parser("report", help="print what was found")
    told.set_defaults(act=report)
    known = commands.add_parser("oracle", help="compare with fits that are given the hidden effects")
    known.set_defaults(act=oracle)
    for command in (made, ran, told, known):
        command.add_argument(
            "--work", type=Path, required=True, help="folder of the sets, truths and results"
        )
        command.add_argument("--only", default="", metavar="TEXT", help="cases with TEXT in their names")
    for command in (made, ran):
        command.add_argument("--jobs", type=int, default=2)
    for command in (ran, told):
        command.add_argument(
            "--label", default="results", help="folder in DIR for the results of this version"
        )
    return out


if __name__ == "__main__":
    sys.exit(main())
