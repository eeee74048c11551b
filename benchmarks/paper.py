"""The paper's simulation against the truth: `python -m benchmarks.paper COMMAND [--write]`.

    table             groups A–F, both starts, every observer: errors, intervals, marks, condition number
    seeds             group B with --refine over many noise seeds, beside the Cramér–Rao bound

Each prints its tables, then pass or fail of what was to be shown; the exit code is 1 when something fails.
`--write` renews that part of benchmarks/results/paper.md.
"""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Sequence
from typing import Annotated, Literal

from benchmarks.command import command
from benchmarks.paper_study import document, findings, methods, seeds, tables
from benchmarks.paper_study.simulated import LETTERS, STARTS, pool, simulate_all
from benchmarks.running import say
from benchmarks.tables import plain


def table(letters: str, starts: Sequence[str], processes: int, write: bool) -> bool:
    """All methods on all groups."""
    simulate_all(letters, starts, processes)
    tasks = [(letter, start, m) for start in starts for letter in letters for m in methods.METHODS]
    outcomes = []
    with pool(processes) as workers:
        for outcome in workers.map(methods.run, *zip(*tasks, strict=True)):
            outcomes.append(outcome)
            say(f"{len(outcomes)}/{len(tasks)}")
    results = findings.Results(outcomes)
    print(
        f"Largest error of each class in %, of the truth or of {methods.SMALL:g} where the truth is smaller"
    )
    for letter, start in results.studies():
        print(f"\nGroup {letter.upper()}, {document.START_TEXT[start]}")
        print(plain(tables.compact(results.of(letter, start))))
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
        print(plain(tables.statistics(statistics)))
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


@command
def main(
    what: Literal["table", "seeds"],
    *,
    start: Literal["rest", "moving", "both"] = "both",
    groups: Annotated[str, "letters, for table"] = LETTERS,
    seeds: int = 100,
    processes: int = 2,
    write: Annotated[bool, "renew this part of benchmarks/results/paper.md"] = False,
) -> int:
    starts = list(STARTS) if start == "both" else [start]
    if what == "table":
        fine = table(groups.lower(), starts, processes, write)
    else:
        fine = many_seeds(starts, seeds, processes, write)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main())
