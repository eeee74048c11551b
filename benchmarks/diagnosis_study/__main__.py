"""The study of the diagnosis: `python -m benchmarks.diagnosis_study COMMAND --work DIR`.

    make     simulate the cases that are not in DIR yet
    run      diagnose those without a result, and fit them with the truth known
    table    print the tables; --write puts them into docs/diagnosis-study.md
    all      the three
    calibrate  print how often findings are right, by the confidence that was stated with them

Each can be interrupted and goes on where it was. The exit code is 1 when a required figure is not reached.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads would only wait for each other

from benchmarks.diagnosis_study import document, figures
from benchmarks.diagnosis_study import statistics as st
from benchmarks.diagnosis_study.cases import Case, selected
from benchmarks.diagnosis_study.judging import Judged, judge
from benchmarks.diagnosis_study.making import is_made, truth_file
from benchmarks.diagnosis_study.running import known_file, make_all, result_file, run_all, say
from benchmarks.diagnosis_study.tables import Outcome


def outcomes(work: Path, cases: list[Case], label: str) -> list[Outcome]:
    """Every case that has a result, judged."""
    out = []
    for case in cases:
        paths = truth_file(work, case.name), known_file(work, case.name), result_file(work, case.name, label)
        if all(path.is_file() for path in paths):
            truth, known, result = (json.loads(path.read_text(encoding="utf-8")) for path in paths)
            out.append((judge(truth, known, result), truth))
    return out


def table(work: Path, cases: list[Case], label: str, write: bool) -> bool:
    """Print the tables; whether every required figure is reached."""
    found = outcomes(work, cases, label)
    if len(found) < len(cases):
        say(f"{len(found)} of {len(cases)} cases have a result")
    if not found:
        return False
    parts = document.parts(found)
    print(document.text(parts))
    if write:
        document.write(parts)
    return all(f.passed is not False for f in figures.figures([case for case, _ in found]))


def calibrate(cases: list[Judged]) -> None:
    """Stated against right, a line a bin."""
    for low, high, mean, right in st.calibration([s for case in cases for s in case.stated]):
        if right.count:
            print(f"{low:.2f}-{high:.2f}: {right.hits} of {right.count} right, stated {mean:.3f}")


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.diagnosis_study",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("command", choices=("make", "run", "table", "all", "calibrate"))
    parser.add_argument(
        "--work", type=Path, required=True, help="folder of the cases, their truth and results"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--scheduler", default="", help="tcp://HOST:PORT of a dask cluster to run on")
    parser.add_argument("--only", default="", metavar="TEXT", help="cases with TEXT in their names")
    parser.add_argument("--of-each", type=int, metavar="N", help="at most N cases of every kind and robot")
    parser.add_argument("--label", default="results", help="folder in DIR for the results of this version")
    parser.add_argument("--write", action="store_true", help="renew docs/diagnosis-study.md")
    options = parser.parse_args(arguments)
    cases = selected(options.seed, options.only, options.of_each)
    try:
        if options.command in ("make", "all"):
            make_all(options.work, cases, options.jobs)
        if options.command in ("run", "all"):
            names = [case.name for case in cases if is_made(options.work, case)]
            run_all(options.work, names, options.jobs, options.label, options.scheduler)
        if options.command in ("table", "all"):
            return 0 if table(options.work, cases, options.label, options.write) else 1
        if options.command == "calibrate":
            calibrate([case for case, _ in outcomes(options.work, cases, options.label)])
    except KeyboardInterrupt:
        say("interrupted; what is done is kept")
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
