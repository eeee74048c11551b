"""The diagnosis on every kind of set: `python -m benchmarks.measuring_stick COMMAND --work DIR`.

    make     simulate the sets of --seed that are not in DIR yet: DIR/fresh-SEED
    run      diagnose every set without a result by each --command NAME=CMD: DIR/results/NAME
    report   print a table for each class of sets, and the sets on which two commands differ

CMD is the command `flexviz` of one version, as in `--command base=/there/.venv/bin/flexviz`. Given two, each
set is diagnosed by both before the next one, so that times can be compared. A command is told nothing but
the set's folder. Each can be interrupted and goes on where it was.
"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated, Literal

from typer import BadParameter

from benchmarks.command import command
from benchmarks.measuring_stick.sets import CLASSES, find_sets
from benchmarks.running import LONGEST, DiagnoseCommand, diagnose_all

SEEDS = [1009, 2003, 3001]
NONE: list[str] = []


def named_command(given: str) -> tuple[str, tuple[str, ...]]:
    """NAME=CMD as a name and words."""
    name, sign, words = given.partition("=")
    if not (name.isidentifier() and sign and words.strip()):
        raise BadParameter(f'"{given}": expected NAME=CMD, as in base=/there/.venv/bin/flexviz')
    return name, tuple(shlex.split(words))


@command
def main(
    what: Literal["make", "run", "report"],
    *,
    work: Annotated[Path, "folder of simulated sets and results"],
    seed: Annotated[list[int], "of the sets to make"] = SEEDS,
    larger: Annotated[int, "so many times as many sets as usual"] = 1,
    jobs: int = 1,
    command: Annotated[list[str], "NAME=CMD"] = NONE,
    timeout: Annotated[float, "of one set [s]"] = LONGEST,
    retry: Annotated[bool, "also those that gave no answer"] = False,
    names: Annotated[list[str], "commands to compare; all by default"] = NONE,
    given: Annotated[Path | None, "folder that has practice, robotlike and real"] = None,
    public: Annotated[Path | None, "sets of benchmarks.public_robots"] = None,
    classes: Annotated[list[str], "of the sets, all by default", CLASSES] = NONE,
    only: Annotated[str, "sets with this text in their keys"] = "",
) -> int:
    # `run` imports little: its children's memory starts at its own
    if what == "make":
        from benchmarks.measuring_stick.making import make

        make(work, seed, jobs, larger)
        return 0
    sets = find_sets(work, given, public, classes, only)
    if what == "run":
        commands = dict(map(named_command, command))
        if not commands:
            raise BadParameter("run needs --command NAME=CMD")
        made = {
            work / "results" / name: DiagnoseCommand(words, timeout, True) for name, words in commands.items()
        }
        diagnose_all({one.key: one.folder for one in sets}, made, jobs, retry)
        return 0
    from benchmarks.measuring_stick.report import report

    there = sorted(path.name for path in (work / "results").glob("*") if path.is_dir())
    print(report(work, sets, names or there))
    return 0


if __name__ == "__main__":
    sys.exit(main())
