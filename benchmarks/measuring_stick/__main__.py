"""The diagnosis on every kind of set: `python -m benchmarks.measuring_stick COMMAND --work DIR`.

    make     simulate the sets of --seed that are not in DIR yet: DIR/fresh-SEED
    run      diagnose every set without a result by each --command NAME=CMD: DIR/results/NAME
    report   print a table for each class of sets, and the sets on which two commands differ

CMD is the command `flexviz` of one version, as in `--command base=/there/.venv/bin/flexviz`. Given two, each
set is diagnosed by both before the next one, so that times can be compared. A command is told nothing but
the set's folder. Each can be interrupted and goes on where it was.
"""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads would only wait for each other

from benchmarks.kept_results import say
from benchmarks.measuring_stick import running
from benchmarks.measuring_stick.sets import CLASSES, StickSet, find_sets

SEEDS = (1009, 2003, 3001)


def main(arguments: list[str] | None = None) -> int:
    options = parser().parse_args(arguments)
    try:
        return options.act(options)
    except KeyboardInterrupt:
        say("interrupted; what is done is kept")
        return 130


def make(options: argparse.Namespace) -> int:
    """Simulate what is not there yet."""
    from benchmarks.measuring_stick import (
        making,  # `run` stays small: its children's memory starts at its own
    )

    making.make(options.work, options.seed or SEEDS, options.jobs, options.larger)
    return 0


def run(options: argparse.Namespace) -> int:
    """Diagnose what has no result."""
    commands = dict(options.command)
    running.run(options.work, chosen(options), commands, options.jobs, options.timeout, options.retry)
    return 0


def report(options: argparse.Namespace) -> int:
    """Print the report."""
    from benchmarks.measuring_stick.report import report as text

    print(text(options.work, chosen(options), options.names or running.command_names(options.work)))
    return 0


def chosen(options: argparse.Namespace) -> list[StickSet]:
    """The sets that are asked for."""
    return find_sets(options.work, options.given, options.public, options.classes, options.only)


def named_command(given: str) -> tuple[str, tuple[str, ...]]:
    """NAME=CMD as a name and words."""
    name, sign, words = given.partition("=")
    if not (name.isidentifier() and sign and words.strip()):
        raise argparse.ArgumentTypeError(f'"{given}": expected NAME=CMD, as in base=/there/.venv/bin/flexviz')
    return name, tuple(shlex.split(words))


def parser() -> argparse.ArgumentParser:
    """The command line."""
    out = argparse.ArgumentParser(
        prog="python -m benchmarks.measuring_stick",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = out.add_subparsers(required=True)
    made = commands.add_parser("make", help="simulate the sets")
    made.set_defaults(act=make)
    made.add_argument("--seed", type=int, action="append", help=f"by default {SEEDS}")
    made.add_argument("--larger", type=int, default=1, metavar="N", help="N times as many as usual")
    ran = commands.add_parser("run", help="diagnose the sets")
    ran.set_defaults(act=run)
    ran.add_argument("--command", type=named_command, action="append", required=True, metavar="NAME=CMD")
    ran.add_argument("--timeout", type=float, default=running.LONGEST, metavar="S", help="of one set [s]")
    ran.add_argument("--retry", action="store_true", help="also those that gave no answer")
    told = commands.add_parser("report", help="print what was found")
    told.set_defaults(act=report)
    told.add_argument("--names", nargs="+", metavar="NAME", help="commands to compare; all by default")
    for command in (made, ran, told):
        command.add_argument("--work", type=Path, required=True, help="folder of simulated sets and results")
    for command in (made, ran):
        command.add_argument("--jobs", type=int, default=1)
    for command in (ran, told):
        command.add_argument("--given", type=Path, metavar="DIR", help="has practice, robotlike and real")
        command.add_argument("--public", type=Path, metavar="DIR", help="sets of benchmarks.public_robots")
        command.add_argument("--classes", nargs="+", choices=CLASSES, default=(), metavar="CLASS")
        command.add_argument("--only", default="", metavar="TEXT", help="sets with TEXT in their keys")
    return out


if __name__ == "__main__":
    sys.exit(main())
