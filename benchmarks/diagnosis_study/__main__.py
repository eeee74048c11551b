"""The study of the diagnosis: `python -m benchmarks.diagnosis_study COMMAND --work DIR`.

    make     simulate the cases that are not in DIR yet
    run      diagnose those without a result, and fit them with the truth known
    table    print the tables; --write puts them into benchmarks/results/diagnosis-study.md
    all      the three

Each can be interrupted and goes on where it was. The exit code is 1 when a required figure is not reached.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from benchmarks.command import command
from benchmarks.diagnosis_study import document
from benchmarks.diagnosis_study.cases import Case, selected
from benchmarks.diagnosis_study.making import make, make_all
from benchmarks.diagnosis_study.running import known_file, run_all
from benchmarks.diagnosis_study.tables import figures, outcome
from benchmarks.running import is_made, read, result_file, say, truth_file


def table(work: Path, cases: list[Case], label: str, write: bool) -> bool:
    """Print the tables; whether every required figure is reached."""
    found = []
    for case in cases:
        paths = truth_file(work, case.name), known_file(work, case.name), result_file(work / label, case.name)
        if all(path.is_file() for path in paths):
            found.append(outcome(*map(read, paths)))
    if len(found) < len(cases):
        say(f"{len(found)} of {len(cases)} cases have a result")
    if not found:
        return False
    parts = document.parts(found)
    print(document.text(parts))
    if write:
        document.write(parts)
    return figures(found)[1]


@command
def main(
    what: Literal["make", "run", "table", "all"],
    *,
    work: Annotated[Path, "folder of the cases, their truth and results"],
    seed: int = 1,
    jobs: int = 2,
    scheduler: Annotated[str, "tcp://HOST:PORT of a dask cluster to run on"] = "",
    only: Annotated[str, "cases with this text in their names"] = "",
    of_each: Annotated[int | None, "at most so many cases of every kind and robot"] = None,
    label: Annotated[str, "folder in DIR for the results of this version"] = "results",
    write: Annotated[bool, "renew benchmarks/results/diagnosis-study.md"] = False,
) -> int:
    cases = selected(seed, only, of_each)
    if what in ("make", "all"):
        make_all(work, cases, make, jobs)
    if what in ("run", "all"):
        run_all(work, [case.name for case in cases if is_made(work, case.name)], jobs, label, scheduler)
    if what in ("table", "all"):
        return 0 if table(work, cases, label, write) else 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
