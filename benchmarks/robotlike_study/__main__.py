"""Robots with many hidden effects at once: `python -m benchmarks.robotlike_study COMMAND --work DIR`.

    make     simulate the sets that are not in DIR yet: DIR/cases, and what is hidden in them: DIR/truth
    run      diagnose those without a result, each in a process of its own: DIR/results
    report   print what was found, at which cost, and how far the stated confidences hold
    oracle   compare the held-out error of each diagnosis with that of a fit that is given the hidden effects

Each can be interrupted and goes on where it was.
"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated, Literal

from benchmarks.command import command
from benchmarks.diagnosis_study.judging import judge
from benchmarks.diagnosis_study.making import make_all
from benchmarks.diagnosis_study.report import report, text
from benchmarks.robotlike_study.cases import DURATION, cases, parse_shares
from benchmarks.robotlike_study.effects import DRAWS
from benchmarks.robotlike_study.making import make
from benchmarks.robotlike_study.oracle import compared
from benchmarks.running import (
    COMMAND,
    LONGEST,
    DiagnoseCommand,
    case_folder,
    diagnose_all,
    made_cases,
    read,
    result_file,
    truth_file,
)


@command
def main(
    what: Literal["make", "run", "report", "oracle"],
    *,
    work: Annotated[Path, "folder of the sets, truths and results"],
    only: Annotated[str, "cases with this text in their names"] = "",
    seed: int = 1,
    count: int = 60,
    shares: Annotated[str, "parts of 2r, ur5, panda"] = "2:1:1",
    duration: Annotated[float, "of each group [s]"] = DURATION,
    also: Annotated[list[str], "hide this effect, too, on one joint of each robot", DRAWS] = [],  # noqa: B006
    jobs: int = 2,
    timeout: Annotated[float, "for one set [s]"] = LONGEST,
    retry: Annotated[bool, "also those that gave no answer"] = False,
    command: Annotated[str, "the command flexviz; by default that of this Python"] = "",
    label: Annotated[str, "folder in DIR for the results of this version"] = "results",
) -> int:
    made = {name: case_folder(work, name) for name in made_cases(work, only)}
    if what == "make":
        planned = cases(seed, count, parse_shares(shares), duration, tuple(also))
        return make_all(work, [c for c in planned if only in c.name], make, jobs)
    if what == "run":
        words = tuple(shlex.split(command)) or COMMAND
        diagnose_all(made, {work / label: DiagnoseCommand(words, timeout)}, jobs, retry)
    elif what == "oracle":
        for line in compared(work, only):
            print(line, flush=True)
    else:
        files = {name: result_file(work / label, name) for name in made}
        found = {n: judge(read(truth_file(work, n)), read(f), True) for n, f in files.items() if f.is_file()}
        print(text(report({label: found}, {name: name.split("-")[1] for name in made})))
        return int(len(found) < len(made) or any(one.error is not None for one in found.values()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
