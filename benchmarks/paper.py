"""The paper's simulation against the truth: `python -m benchmarks.paper COMMAND [--write]`.

    table             groups A–F, both starts, every observer: errors, intervals, marks, condition number
    seeds             group B with --refine over many noise seeds, beside the Cramér–Rao bound

Each prints its tables, then pass or fail of what was to be shown; the exit code is 1 when something fails.
`--write` renews that part of docs/paper.md.
"""

from __future__ import annotations

import argparse
import os
import sys
import textwrap
from collections.abc import Sequence

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads would only wait for each other

from benchmarks.paper_study import document, findings, methods, seeds, tables
from benchmarks.paper_study.simulated import LETTERS, STARTS, pool, simulate_all


def table(letters: str, starts: Sequence[str], processes: int, write: bool) -> bool:
    """All methods on all groups."""
    simulate_all(letters, starts, processes)
    tasks = [(letter, start, m) for start in starts for letter in letters for m in methods.METHODS]
    outcomes = []
    with pool(processes) as workers:
        for outcome in workers.map(methods.run, *zip(*tasks, strict=True)):
            outcomes.append(outcome)
            _count(len(outcomes), len(tasks))
    results = findings.Results(outcomes)
    print(
        f"Largest error of each class in %, of the truth or of {methods.SMALL:g} where the truth is smaller"
    )
    for letter, start in results.studies():
        print(f"\nGroup {letter.upper()}, {document.START_TEXT[start]}")
        print(tables.plain(tables.compact(results.of(letter, start))))
    if set(letters) != set(LETTERS) or set(starts) != set(STARTS):
        return True
    checked = findings.criteria(results)
    _verdicts(checked)
    for text in findings.findings(results):
        print("\n" + textwrap.fill(text.replace("**", ""), 110, break_on_hyphens=False))
    if write:
        document.write("table", document.table_part(results, checked))
    return all(passed for _, passed in checked)


def many_seeds(starts: Sequence[str], count: int, processes: int, write: bool) -> bool:
    """The seeds of group B."""
    parts, fine = [], True
    for start in starts:
        statistics = seeds.run(start, count, processes)
        checked = seeds.criteria(statistics)
        print(f"\nGroup B, {document.START_TEXT[start]}, --refine, {count} noise seeds")
        print(tables.plain(tables.statistics(statistics)))
        _verdicts(checked)
        parts.append((start, statistics, checked))
        fine = fine and all(passed for _, passed in checked)
    if write:
        document.write("seeds", document.seeds_part(parts))
    return fine


def _verdicts(lines: list[tuple[str, bool]]) -> None:
    print()
    for text, passed in lines:
        print(f"{'pass' if passed else 'FAIL'}  {text}")


def _count(done: int, total: int) -> None:
    if sys.stderr.isatty():
        print(f"\r{done}/{total}", end="" if done < total else "\n", file=sys.stderr, flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.paper",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("command", choices=("table", "seeds"))
    parser.add_argument("--start", choices=(*STARTS, "both"), default="both")
    parser.add_argument("--groups", default=LETTERS, help="letters, for table (default: %(default)s)")
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--write", action="store_true", help="renew this part of docs/paper.md")
    options = parser.parse_args()
    starts = list(STARTS) if options.start == "both" else [options.start]
    if options.command == "table":
        fine = table(options.groups.lower(), starts, options.processes, options.write)
    else:
        fine = many_seeds(starts, options.seeds, options.processes, options.write)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
